"""Preference among trails: above the base plane, elbow up, away from limits and singularities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.continuation import Trail
from pathcontrol.engine.frame_kinematics import frame_poses

PLANE = 1e-3  # m below the base plane that is still on it
_AS_COMFORTABLE = 0.5  # share of the best comfort from which on the higher elbow counts more
_SAMPLES = 32  # postures of a trail that are compared


def heights(constraint: ToolConstraint, q: Array) -> Array:
    """Return the heights [m] above the base plane, z = 0, of the joints that move the tool, (N, joints)."""
    return frame_poses(constraint.tool.robot, q, _movers(constraint))[..., 2, 3]


def find_lowest(constraint: ToolConstraint, q: Array) -> tuple[str, float]:
    """Return the joint that comes lowest in postures q (N, n), and its height above the base plane [m]."""
    least = heights(constraint, q).min(0)
    return _movers(constraint)[int(np.argmin(least))], float(least.min())


def above_base(constraint: ToolConstraint, q: Array) -> Array:
    """Return whether all joints of postures q (N, n) are above the base plane, (N,)."""
    return np.asarray((heights(constraint, q) >= -PLANE).all(-1))


def sort_by_preference(constraint: ToolConstraint, trails: Sequence[Trail]) -> list[Trail]:
    """Return the trails, the preferred first.

    Those that stay above the base plane come before others; then those at least half as comfortable as the best, the
    higher their joints on average the sooner; then the others by comfort.
    """
    height = [heights(constraint, _sample(trail)) for trail in trails]
    above = np.array([(h >= -PLANE).all() for h in height], dtype=bool)
    comfort = np.array([trail.comfort for trail in trails])
    best = np.array([comfort[above == side].max() for side in above])
    good = comfort >= _AS_COMFORTABLE * best
    mean = np.array([h.mean() for h in height])
    order = np.lexsort((-np.where(good, mean, comfort), ~good, ~above))
    return [trails[i] for i in order]


def _movers(constraint: ToolConstraint) -> list[str]:
    """Return the names of the joints that move the tool."""
    names = constraint.tool.robot.joint_names
    return [name for name, moves in zip(names, constraint.moving, strict=True) if moves]


def _sample(trail: Trail) -> Array:
    """Return postures of a trail from its beginning to its end, (k, n)."""
    chosen = np.unique(np.linspace(0, len(trail.q) - 1, _SAMPLES).astype(int))
    return np.array(trail.q)[chosen]
