"""Errors about curves that cannot be followed: where, how far the tool got, and what to change."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.continuation import Stop, Trail
from pathcontrol.cartesian.ik.correction import KEPT
from pathcontrol.cartesian.ik.joint_range import distance_to_limits
from pathcontrol.cartesian.ik.nearest_posture import nearest_postures
from pathcontrol.cartesian.orientation import FreeOrientation
from pathcontrol.errors import TaskError
from pathcontrol.robot.model import RobotModel

_SEEDS = 64
_AHEAD = np.array([1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0])  # parts of the curve
_REGULAR = 0.02  # singular values above this do not stop an arm
_NOTHING = 1e-3  # share of a displacement that is negligible
_NEXT = 4  # points ahead; if one of them is out of reach, that is the reason


def trail_error(constraint: ToolConstraint, trail: Trail, tries: int = 1) -> TaskError:
    """Return the error for a trail that stops, the best of those from ``tries`` start postures."""
    s = trail.s[-1]
    along = 100 * (s - constraint.curve.s0) / constraint.curve.length
    best = f", from the best of {tries} start postures" if tries > 1 else ""
    return TaskError(
        f"{_tool(constraint)} follows the curve to {place(constraint, s)}, {along:.3g} % of it{best}: "
        f"{_reason(constraint, trail)}",
        s=float(s),
        **_limit_details(constraint, trail),
    )


def first_point_error(constraint: ToolConstraint, start: Array | None = None) -> TaskError:
    """Return the error for a first point that is not reached from ``start`` (n,), or from anywhere."""
    seeds = constraint.seeds(_SEEDS) if start is None else start[None]
    whence = "from any posture" if start is None else "from this start posture"
    other = "" if start is None else "; give another start posture, or none to have one searched"
    return TaskError(
        f"{_tool(constraint)} does not reach the first point of the curve {whence}: at "
        f"{place(constraint, constraint.curve.s0)}, {_gap(constraint, seeds, constraint.curve.s0)}{other}",
        s=float(constraint.curve.s0),
    )


def closing_error(constraint: ToolConstraint, trail: Trail) -> TaskError:
    """Return the error for a trail round a closed curve that does not come back to its beginning."""
    robot, change = constraint.tool.robot, trail.q[-1] - trail.q[0]
    i = int(np.argmax(np.abs(change)))
    return TaskError(
        f"{_tool(constraint)} follows the closed curve, but at {place(constraint, trail.s[-1])}, one lap on, "
        f"{robot.joint_names[i]} is {change[i]:+.6g} {robot.position_units[i]} from where it began, so the path of the "
        f"joints does not close; closed=False makes one lap an open path{_advise_freedom(constraint)}",
        joint=robot.joint_names[i],
        value=float(change[i]),
        s=float(trail.s[-1]),
    )


def place(constraint: ToolConstraint, s: float) -> str:
    """Write a point of the curve for a message."""
    x, y, z = constraint.curve.position(np.array(s))
    return f"s = {s:.6g} m, the point ({x:.4f}, {y:.4f}, {z:.4f}) m"


def _tool(constraint: ToolConstraint) -> str:
    """Name the tool for a message."""
    tool = constraint.tool
    return f"{'the tool in ' if tool.offset is not None else ''}{tool.frame} of {tool.robot.name}"


def _reason(constraint: ToolConstraint, trail: Trail) -> str:
    """Return the reason why a trail stops, with advice."""
    if trail.stop is Stop.LIMIT:
        return _limit(constraint, trail.beyond)
    return _find_out_of_reach(constraint, trail) or _explain_stop(constraint, trail)


def _passed_limit(robot: RobotModel, beyond: Array) -> tuple[int, str, float]:
    """Return the joint farthest beyond its limits, the side and the limit."""
    i = int(np.argmin(distance_to_limits(robot, beyond)))
    upper = beyond[i] > robot.limits.upper[i]
    return (i, "upper", robot.limits.upper[i]) if upper else (i, "lower", robot.limits.lower[i])


def _limit_details(constraint: ToolConstraint, trail: Trail) -> dict[str, Any]:
    """Return the joint that stops a trail at its limit, with both, as attributes of the error."""
    if trail.stop is not Stop.LIMIT:
        return {}
    robot = constraint.tool.robot
    i, _, limit = _passed_limit(robot, trail.beyond)
    return {"joint": robot.joint_names[i], "value": float(trail.beyond[i]), "limit": float(limit)}


def _limit(constraint: ToolConstraint, beyond: Array) -> str:
    """Write which joint is at which limit, with advice."""
    robot = constraint.tool.robot
    i, side, value = _passed_limit(robot, beyond)
    return (
        f"there {robot.joint_names[i]} is at its {side} limit, {value:.6g} {robot.position_units[i]}; give another "
        f"start posture or move the curve{_advise_freedom(constraint)}"
    )


def _explain_stop(constraint: ToolConstraint, trail: Trail) -> str:
    """Write why no posture continues a trail: a jump, or a singularity, with advice."""
    robot, rank = constraint.tool.robot, constraint.rank
    _, slope = constraint.at(trail.q[-1][None], np.array([trail.s[-1]]))
    _, values, motions = np.linalg.svd(slope[0])
    if values[rank - 1] > _REGULAR:
        return (
            "no posture next to the last one continues it; the curve or the orientation along it may jump there "
            "(both have to be smooth), or give another start posture"
        )
    motion = np.abs(motions[rank - 1])
    joints = [name for name, size in zip(robot.joint_names, motion, strict=True) if size > 0.3 * motion.max()]
    return (
        f"there the arm comes to a singularity (smallest singular value {values[rank - 1]:.1e}), in which "
        f"{' and '.join(joints)} can move without moving the tool; give another start posture, or move or tilt the "
        f"curve{_advise_freedom(constraint)}"
    )


def _advise_freedom(constraint: ToolConstraint) -> str:
    """Return advice for tools whose rotation is fully prescribed."""
    free = "; or leave the rotation about the tool axis free (NormalOrientation without reference)"
    return free if constraint.orientation.rows == 3 else ""


def _find_out_of_reach(constraint: ToolConstraint, trail: Trail) -> str | None:
    """Return what is out of reach ahead of a trail, if that ended it, else None."""
    curve = constraint.curve
    ahead = np.unique(np.minimum(trail.s[-1] + _AHEAD * curve.length, curve.s_end))
    seeds = np.concatenate([trail.q[-1][None], constraint.seeds(_SEEDS)])
    excess = constraint.excess(constraint.at(nearest_postures(constraint, seeds, ahead), ahead)[0])
    if (excess[:_NEXT] <= KEPT).all():  # the share of the tolerance that stopped it
        return None
    worst = float(ahead[np.argmax(excess)])
    return f"from there on it is out of reach; at {place(constraint, worst)}, {_gap(constraint, seeds, worst)}"


def _gap(constraint: ToolConstraint, seeds: Array, s: float) -> str:
    """Write how near the tool gets to the curve at s, and what would close the gap."""
    position, angle = _find_miss(constraint, seeds, s)
    turned = f" and {angle:.3g} rad" if constraint.orientation.rows else ""
    text = f"the nearest it gets is {np.linalg.norm(position):.3g} m{turned} away"
    if constraint.orientation.rows:
        position, _ = _find_miss(replace(constraint, orientation=FreeOrientation()), seeds, s)
        if np.linalg.norm(position) <= constraint.tolerance[0]:
            return (
                f"{text}, but the position alone is in reach: {_advise_frozen(constraint)}turn the tool, leave its "
                "orientation (partly) free, or move the curve"
            )
    x, y, z = np.where(np.abs(position) > _NOTHING * np.linalg.norm(position), position, 0.0)
    return f"{text}; {_advise_frozen(constraint)}move the curve by ({x:.3g}, {y:.3g}, {z:.3g}) m there, or more"


def _advise_frozen(constraint: ToolConstraint) -> str:
    """Return advice for arms with joints that have no room to move."""
    robot = constraint.tool.robot
    held = [
        f"{name} cannot move, since both of its limits are {value:g} {unit} (in a URDF that leaves them out they are 0)"
        for name, value, unit, frozen in zip(
            robot.joint_names, robot.limits.lower, robot.position_units, constraint.frozen, strict=True
        )
        if frozen
    ]
    return f"{' and '.join(held)}: give room between lower and upper, or " if held else ""


def _find_miss(constraint: ToolConstraint, seeds: Array, s: float) -> tuple[Array, float]:
    """Return the vector [m] from the curve at s to the tool in the nearest posture, and the remaining angle [rad]."""
    places = np.array([s])
    f, _ = constraint.at(nearest_postures(constraint, seeds, places), places)
    return constraint.length * f[0, :3], float(np.linalg.norm(f[0, 3:]))
