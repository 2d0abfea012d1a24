"""Checks of the joints: their types, axes, limits and friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pathcontrol.robot.urdf.checks.finding import Finding, place, quote
from pathcontrol.robot.urdf.elements import MOVABLE_TYPES
from pathcontrol.robot.urdf.links import Joint, Limit
from pathcontrol.robot.urdf.model_values import Arm, has_direction, moving_bodies
from pathcontrol.robot.urdf.numbers import ABSURD
from pathcontrol.robot.urdf.posture_dynamics import gravity_torque, postures

UNIT_TOLERANCE = 1e-3


def check_joint_types(arm: Arm) -> Iterator[Finding]:
    """Check that the base is fixed and that a joint moves."""
    for joint in arm.joints:
        if joint.type in ("floating", "planar"):
            message = f"type '{joint.type}' is refused: fixed-base arms only; make the joint fixed"
            yield Finding("error", f"joint-{joint.type}", place("joint", joint.name), message)
    if not arm.free:
        message = f"0 of {len(arm.joints)} joints can move; expected one that is {' or '.join(MOVABLE_TYPES)}"
        yield Finding("error", "no-movable-joint", "robot", message)


def check_mimics(arm: Arm) -> Iterator[Finding]:
    """Check that no joint follows another, for Pinocchio would take it as independent."""
    for joint in arm.movable:
        if joint.name in arm.mimics and joint.name not in arm.locked:
            leader = arm.mimics[joint.name]
            message = f"it mimics joint {quote(leader)}, which is refused; " + (
                f"lock {quote(leader)}, which locks it too, or keep other joints only, or make it fixed or independent"
                if leader != joint.name and leader in {other.name for other in arm.joints}
                else "no other joint has that name; correct it, lock this one, or make it fixed or independent"
            )
            yield Finding("error", "joint-mimic", place("joint", joint.name), message)


def check_axes(arm: Arm) -> Iterator[Finding]:
    """Check that every axis has a direction and unit length."""
    for joint in arm.movable:
        length = float(np.linalg.norm(joint.axis))
        axis = " ".join(f"{value:g}" for value in joint.axis)
        if not has_direction(joint):
            message = f"the axis '{axis}' has no direction; expected a unit vector such as '0 0 1'"
            yield Finding("error", "axis-zero", place("joint", joint.name), message)
        elif abs(length - 1) > UNIT_TOLERANCE:
            message = f"the axis '{axis}' has length {length:g} and is normalised; expected length 1"
            yield Finding("warning", "axis-not-unit", place("joint", joint.name), message)


def check_limits(arm: Arm) -> Iterator[Finding]:
    """Check that limits are given, in order, and neither zero nor absurdly large."""
    for joint in arm.movable:
        if joint.limit is None:
            yield _no_limit(joint)
            continue
        yield from _wrong_limits(joint, joint.limit)
        if joint.name not in arm.locked:
            yield from _doubtful_limits(joint, joint.limit)


def check_dynamics(arm: Arm) -> Iterator[Finding]:
    """Check that no friction drives the arm; note friction that is given, and continuous joints."""
    for joint in arm.free:
        given = {name: float(getattr(joint.dynamics, name, None) or 0) for name in ("damping", "friction")}
        for name, value in given.items():
            if value < 0:
                message = f"{name} is {value:g}, which would drive the joint; expected zero or more"
                yield Finding("error", f"{name}-negative", place("joint", joint.name), message)
        if max(given.values()) > 0:
            values = " and ".join(f"{name} {value:g}" for name, value in given.items())
            message = f"it has {values}; Pinocchio's own dynamics contain neither"
            yield Finding("note", "friction-present", place("joint", joint.name), message)
        if joint.type == "continuous":
            message = "it turns without end and is treated as one angle; lower and upper are ignored"
            yield Finding("note", "joint-continuous", place("joint", joint.name), message)


def check_efforts(arm: Arm) -> Iterator[Finding]:
    """Check that each joint can hold what it carries, in some hundred postures within the limits."""
    bodies = moving_bodies(arm)
    if not bodies or not all(has_direction(body.joint) for body in bodies):
        return
    q = postures(arm)
    for body, torque in zip(bodies, np.abs(gravity_torque(arm, q)).T, strict=True):
        effort = np.inf if body.joint.limit is None else body.joint.limit.effort
        if 0 < effort < torque.max():
            unit = "N" if body.joint.type == "prismatic" else "N m"
            share = (torque > effort).mean()
            message = (
                f"the limit of effort is {effort:g} {unit}, but holding its own weight takes up to "
                f"{torque.max():.4g} {unit}, and too much in {share:.0%} of postures; check the effort"
            )
            yield Finding("warning", "effort-below-weight", place("joint", body.joint.name), message)


def _no_limit(joint: Joint) -> Finding:
    if joint.type == "continuous":
        message = "there is no <limit>, so effort and velocity are infinite; expected both, give them"
        return Finding("warning", "joint-no-limit", place("joint", joint.name), message)
    message = f"a {joint.type} joint must have a <limit>; give lower, upper, effort and velocity"
    return Finding("error", "joint-no-limit", place("joint", joint.name), message)


def _wrong_limits(joint: Joint, limit: Limit) -> Iterator[Finding]:
    lower, upper = limit.lower or 0.0, limit.upper or 0.0
    if joint.type != "continuous" and lower > upper:
        message = f"lower {lower:g} is above upper {upper:g} (a missing one is 0); expected lower below upper"
        yield Finding("error", "limit-inverted", place("joint", joint.name), message)
    for name in ("effort", "velocity"):
        if (value := getattr(limit, name)) < 0:
            message = f"the limit of {name} is {value:g}; expected a positive number"
            yield Finding("error", f"{name}-negative", place("joint", joint.name), message)


def _doubtful_limits(joint: Joint, limit: Limit) -> Iterator[Finding]:
    lower, upper = limit.lower or 0.0, limit.upper or 0.0
    if joint.type != "continuous" and lower == upper:
        message = f"lower and upper are both {lower:g} (a missing one is 0); expected a range, give one"
        yield Finding("warning", "limit-no-range", place("joint", joint.name), message)
    for name in ("effort", "velocity"):
        if getattr(limit, name) == 0:
            message = f"the limit of {name} is 0, and clamping to it stops the joint; give a positive number"
            yield Finding("warning", f"{name}-zero", place("joint", joint.name), message)
    for name in ("lower", "upper", "effort", "velocity"):
        if abs(value := getattr(limit, name) or 0.0) >= ABSURD:
            message = f"the limit {name} is {value:g}, which limits nothing; expected what the joint can do"
            yield Finding("warning", "limit-absurd", place("joint", joint.name), message)
