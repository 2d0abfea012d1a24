"""The solution of a constraint by a joint spline: start posture, continuation, refinement, verification."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline

from pathcontrol._arrays import Array, as_joint_array, check_finite
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.continuation import SINGULAR, Stop, Trail, find_faults, follow
from pathcontrol.cartesian.ik.correction import correct
from pathcontrol.cartesian.ik.failure import closing_error, trail_error
from pathcontrol.cartesian.ik.inverse_kinematics import InverseKinematics, Samples
from pathcontrol.cartesian.ik.joint_range import distance_to_limits, is_outside
from pathcontrol.cartesian.ik.path_report import CartesianReport, measure
from pathcontrol.cartesian.ik.preference import sort_by_preference
from pathcontrol.cartesian.ik.redundancy import PostureCost, rest_curve
from pathcontrol.cartesian.ik.refinement import Refined, refine
from pathcontrol.cartesian.ik.start_posture import move_start, rewind_starts, search_starts
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel

_REWINDS = 3  # joints that are wound back one after another
_SAME = 1e-6  # rad, between the first and the last posture of a lap
_LEFT = 3.0  # rad, largest gap that is closed; half a turn and more would change the number of turns
_PACE = 0.1  # rad, closed in one step


def solve(constraint: ToolConstraint, start: Array | None, closed: bool) -> tuple[BSpline, CartesianReport]:
    """Return the joint spline along the curve and the measurements on it.

    Raises:
        TaskError: the curve cannot be followed, or a closed path does not close.
    """
    trails = _search_trails(constraint) if start is None else _follow(constraint, move_start(constraint, start))
    lap = _choose_trail(constraint, trails, closed)
    kinematics = InverseKinematics(constraint, rest_curve(lap.s, lap.q, closed))
    refined = refine(kinematics, lap, closed)
    report = measure(constraint, refined, len(trails), searched=start is None)
    _check_between(constraint, refined, report)
    return refined.spline, report


def _search_trails(constraint: ToolConstraint) -> list[Trail]:
    """Return trails from searched start postures, a whole turn back where none gets along otherwise."""
    latest = _follow(constraint, search_starts(constraint))
    trails = list(latest)
    for _ in range(_REWINDS):
        starts = rewind_starts(constraint, latest)
        if any(trail.stop is Stop.NONE for trail in trails) or not len(starts):
            break
        latest = _follow(constraint, starts)
        trails += latest
    return trails


def _follow(constraint: ToolConstraint, starts: Array) -> list[Trail]:
    return follow(constraint, starts, constraint.curve.s0, constraint.curve.s_end)


def check_posture(robot: RobotModel, start: ArrayLike) -> Array:
    """Check that ``start`` is a posture (n,) within the joint limits."""
    q = check_finite("start", as_joint_array("start", start, robot.n, robot.joint_names))
    if q.shape != (robot.n,):
        raise InputError(f"start has shape {q.shape}, expected one posture ({robot.n},)", argument="start", value=start)
    if is_outside(robot, q):
        i = int(np.argmin(distance_to_limits(robot, q)))
        low, high = robot.limits.lower[i], robot.limits.upper[i]
        raise InputError(
            f"start has {robot.joint_names[i]} at {q[i]:g}, outside its limits from {low:g} to {high:g}",
            argument="start",
            joint=robot.joint_names[i],
            value=float(q[i]),
            limit=(float(low), float(high)),
        )
    return np.clip(q, robot.limits.lower, robot.limits.upper)


def _choose_trail(constraint: ToolConstraint, trails: list[Trail], closed: bool) -> Samples:
    """Return the preferred trail of those that go all the way, and come back if they have to."""
    complete = [trail for trail in trails if trail.stop is Stop.NONE]
    for trail in sort_by_preference(constraint, complete):
        s, q = np.array(trail.s), np.array(trail.q)
        lap = close_lap(constraint, s, q) if closed else q
        if lap is not None:
            return Samples(s, lap)
    if complete:
        raise closing_error(constraint, complete[0])
    raise trail_error(constraint, max(trails, key=lambda trail: trail.s[-1]), len(trails))


def _check_between(constraint: ToolConstraint, refined: Refined, report: CartesianReport) -> None:
    """Check limits and singularities between the knots, where Newton's method has not been."""
    if is_outside(constraint.tool.robot, refined.spline(report.limit_at)):
        raise _stop_error(constraint, refined, report.limit_at, Stop.LIMIT)
    if report.smallest_singular_value < SINGULAR:
        raise _stop_error(constraint, refined, report.singular_at, Stop.SINGULAR)


def _stop_error(constraint: ToolConstraint, refined: Refined, s: float, stop: Stop) -> Exception:
    """Return the error for a spline that fails at s between its knots."""
    q = refined.spline(s)
    return trail_error(constraint, Trail([s], [q], stop=stop, beyond=q))


def close_lap(constraint: ToolConstraint, s: Array, q: Array) -> Array | None:
    """Close a lap: change postures q (K, n) at s (K,) so that the last is the first; None if that fails.

    Where there is a choice of postures, the difference that a lap of least motion leaves is taken back little by little
    and evenly along the curve, each time by the nearest postures that hold the tool.
    """
    left, limits = q[-1] - q[0], constraint.tool.robot.limits
    size = float(np.abs(left).max())
    if constraint.freedom and size < _LEFT:
        share = ((s - s[0]) / (s[-1] - s[0]))[:, None]
        closing, times = q, int(np.ceil(size / _PACE))
        for i in range(1, times + 1):
            found = correct(constraint, PostureCost.nearest(q - i / times * share * left, limits), closing, s)
            if (find_faults(constraint, found) != Stop.NONE).any():
                return None
            closing = found.q
        q = closing
    return q if np.abs(q[-1] - q[0]).max() < _SAME else None
