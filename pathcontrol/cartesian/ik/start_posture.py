"""Search of the postures that put the tool on the first point of a curve."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.continuation import Stop, Trail, find_faults, rate_comfort
from pathcontrol.cartesian.ik.correction import KEPT, Corrected, correct
from pathcontrol.cartesian.ik.failure import first_point_error, trail_error
from pathcontrol.cartesian.ik.joint_range import distance_to_limits, unwind
from pathcontrol.cartesian.ik.nearest_posture import reach
from pathcontrol.cartesian.ik.preference import above_base
from pathcontrol.cartesian.ik.redundancy import PostureCost
from pathcontrol.errors import TaskError

_SEEDS = 256
_MOST = 12  # start postures from which the whole curve is tried
_APART = np.pi  # rad; start postures nearer to each other than this are too alike to be worth as much
_SAME = 1e-3  # rad
_BELOW = 0.2  # how much a posture with a joint below the base plane is worth


def search_starts(constraint: ToolConstraint) -> Array:
    """Search start postures (N, n), the most comfortable of those above the base plane first.

    Seeds spread over the joint range are moved onto the curve by :func:`reach`. Kept are at most 12 postures that are
    comfortable and differ from each other.

    Raises:
        TaskError: the first point was not reached from any of them, or only where the arm is singular.
    """
    reached = _approach(constraint, constraint.seeds(_SEEDS))
    found = _correct_nearby(constraint, unwind(constraint.tool.robot, reached))
    stops = find_faults(constraint, found)
    fit = stops == Stop.NONE
    if not fit.any():
        raise _no_start(constraint, found)
    comfort = rate_comfort(constraint, found) * np.where(above_base(constraint, found.q), 1.0, _BELOW)
    return found.q[_select_diverse(found.q, np.where(fit, comfort, 0.0))]


def rewind_starts(constraint: ToolConstraint, trails: list[Trail]) -> Array:
    """Return the starts (N, n) of trails that met a joint limit, with that joint a whole turn back if possible."""
    robot, starts = constraint.tool.robot, []
    for trail in trails:
        if trail.stop is Stop.LIMIT:
            i = int(np.argmin(distance_to_limits(robot, trail.beyond)))
            turn = 2 * np.pi if trail.beyond[i] < robot.limits.lower[i] else -2 * np.pi
            start = trail.q[0] + turn * (np.arange(robot.n) == i)
            if robot.position_units[i] == "rad" and (distance_to_limits(robot, start) > 0).all():
                starts.append(start)
    return np.array(starts).reshape(-1, robot.n)


def _no_start(constraint: ToolConstraint, found: Corrected, start: Array | None = None) -> TaskError:
    """Return the error for a first point that is reached in singular postures only, or not at all."""
    s = np.full(len(found.q), constraint.curve.s0)
    there = np.flatnonzero(constraint.excess(constraint.at(found.q, s)[0]) <= KEPT)
    if not there.size:
        return first_point_error(constraint, start)
    return trail_error(constraint, Trail([constraint.curve.s0], [found.q[there[0]]], stop=Stop.SINGULAR))


def move_start(constraint: ToolConstraint, start: Array) -> Array:
    """Return the posture ``start`` (n,) moved onto the first point, (1, n).

    Raises:
        TaskError: it does not get there, or is singular.
    """
    found = _correct_nearby(constraint, _approach(constraint, start[None]))
    stop = Stop(find_faults(constraint, found)[0])
    if stop is Stop.LOST:
        raise _no_start(constraint, found, start)
    if stop is not Stop.NONE:
        raise trail_error(constraint, Trail([constraint.curve.s0], [found.q[0]], stop=stop, beyond=found.q[0]))
    return found.q


def _approach(constraint: ToolConstraint, q: Array) -> Array:
    """Return postures q (N, n) moved as near to the first point as possible."""
    return reach(constraint, q, np.full(len(q), constraint.curve.s0))


def _correct_nearby(constraint: ToolConstraint, q: Array) -> Corrected:
    """Correct postures q (N, n) that are nearly on the first point to be exactly on it."""
    cost = PostureCost.nearest(q, constraint.tool.robot.limits)
    return correct(constraint, cost, q, np.full(len(q), constraint.curve.s0))


def _select_diverse(q: Array, comfort: Array) -> list[int]:
    """Return indices of postures (N, n), each the best by comfort times distance to those before it."""
    chosen: list[int] = []
    worth = comfort.copy()
    while len(chosen) < _MOST and worth.max(initial=0.0) > 0:
        chosen.append(int(np.argmax(worth)))
        distance = np.linalg.norm(q - q[chosen[-1]], axis=-1)
        worth = np.minimum(worth, comfort * np.where(distance > _SAME, np.minimum(distance / _APART, 1.0), 0.0))
    return chosen
