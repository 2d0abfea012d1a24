"""Checks of masses and inertias: physically possible, and enough for every joint to move something."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from pathcontrol.robot.urdf.checks.finding import Finding, Level, place
from pathcontrol.robot.urdf.links import Link
from pathcontrol.robot.urdf.model_values import Arm, axis_inertia, has_direction, moving_bodies
from pathcontrol.robot.urdf.posture_dynamics import mass_matrix, postures

INERTIA_TOLERANCE = 1e-6  # of the largest principal moment: what rounding in a file may cost
NO_INERTIA = 1e-15  # kg m^2, far below any finger joint
_ROUNDING = 1e-12  # of the largest moment: what the computation of moments may cost
_TINY_SHARE = 0.05  # of the largest moment: a negative one that is smaller may be forgiven
_TINY_MOMENT = 1e-4  # kg m^2, likewise
NO_MASS = 1e-15  # kg


def check_masses(arm: Arm) -> Iterator[Finding]:
    """Check that no mass is negative, and that a body with inertia has mass."""
    moving = arm.moving
    for name, inertial in arm.inertials.items():
        if inertial.mass < 0:
            message = f"the mass is {inertial.mass:g} kg; expected zero or more, correct it"
            yield Finding("error", "mass-negative", place("link", name), message)
        elif inertial.mass == 0 and name in moving and np.any(inertial.inertia):
            message = "the mass is 0 kg although it has inertia and moves; expected a mass, give one"
            yield Finding("warning", "mass-zero", place("link", name), message)


def check_inertias(arm: Arm) -> Iterator[Finding]:
    """Check that every inertia is physically possible: no moment negative or above the sum of the two others.

    A negative moment that is tiny, as rounding leaves it, does no harm where the mass matrix is positive definite.
    """
    moving, is_positive_definite = arm.moving, cache(lambda: _is_positive_definite(arm))
    for name, inertial in arm.inertials.items():
        moments = np.linalg.eigvalsh(inertial.inertia)
        slack = max(NO_INERTIA, INERTIA_TOLERANCE * np.abs(moments).max())
        given = f"the principal moments are {', '.join(f'{moment:g}' for moment in moments)} kg m^2"
        if moments[0] < -NO_INERTIA - _ROUNDING * moments[2]:
            tiny = -moments[0] <= max(_TINY_SHARE * moments[2], _TINY_MOMENT) and is_positive_definite()
            tiny = tiny or -moments[0] <= slack
            level: Level = "error" if name in moving and not tiny else "warning"
            message = f"{given}; expected none below zero, check signs and products of inertia"
            yield Finding(level, "inertia-negative", place("link", name), message)
        elif moments[2] - moments[0] - moments[1] > slack:
            message = f"{given}; expected none above the sum of the two others, check units and axes"
            yield Finding("warning", "inertia-triangle", place("link", name), message)


def check_inertials(arm: Arm) -> Iterator[Finding]:
    """Check that every moving body has an inertial, and so has every moving link with a shape."""
    if is_massless(arm):
        return  # reported once
    for body in moving_bodies(arm):
        bare = [name for name in body.poses if arm.links[name].inertial is None]
        if len(bare) < len(body.poses):
            bare = [name for name in bare if name in arm.shaped]
        for name in bare:
            message = "it moves but has no <inertial> and so no mass; expected one, give mass and inertia"
            yield Finding("warning", "inertial-missing", place("link", name), message)


def check_mass_matrix(arm: Arm) -> Iterator[Finding]:
    """Check that every joint moves some mass; otherwise the mass matrix is singular in every configuration."""
    if is_massless(arm):
        message = (
            "no link has a mass, so there are kinematics and no dynamics; give <inertial>, or let it be estimated with "
            "load_robot(..., estimated_inertia=True)"
        )
        yield Finding("warning", "no-mass", "robot", message)
        return
    weight: dict[str, np.ndarray] = {}
    for body in reversed(moving_bodies(arm)):
        parts = [_weight(arm.links[name]) for name in body.poses]
        parts += [weight[outer.joint.name] for outer in body.outer]
        mass, inertia = weight[body.joint.name] = np.sum(parts, axis=0)
        slides = body.joint.type == "prismatic"
        singular = mass < NO_MASS and (slides or inertia < NO_INERTIA)
        if not slides and not body.outer and has_direction(body.joint):
            singular = abs(axis_inertia(arm, body)) < NO_INERTIA
        if singular:
            what = f"mass is {mass:g} kg" if slides else "inertia about its axis is 0 kg m^2"
            message = (
                f"the {what} for all it moves: the mass matrix is singular; give <inertial>, lock it, "
                "or estimate it with load_robot(..., estimated_inertia=True)"
            )
            yield Finding("error", "mass-matrix-singular", place("joint", body.joint.name), message)


def is_massless(arm: Arm) -> bool:
    """Return whether no moving link has a mass or an inertia."""
    return not any(_weight(arm.links[name]).any() for name in arm.moving)


def _is_positive_definite(arm: Arm) -> bool:
    """Return whether the mass matrix is positive definite in all sampled postures."""
    M = mass_matrix(arm, postures(arm))
    return bool(np.linalg.eigvalsh(M).min() > NO_INERTIA)


def _weight(link: Link) -> np.ndarray:
    """Return the mass of a link [kg] and the size of its inertia [kg m^2]."""
    if link.inertial is None:
        return np.zeros(2)
    return np.array([abs(link.inertial.mass), np.abs(link.inertial.inertia).sum()])
