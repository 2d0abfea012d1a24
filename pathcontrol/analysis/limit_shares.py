"""Positions, velocities and torques of a run as shares of the limits of its arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.torque_limits import recorded_limits, torque_limits, torque_shares
from pathcontrol.analysis.window import Samples
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run

#: the metrics that are above 1 where a limit is passed
RATIOS = {"position_limit_ratio": "position", "velocity_limit_ratio": "velocity", "torque_limit_ratio": "torque"}
_NO_LIMIT = 1e6  # rad, m, rad/s or m/s: files without a limit give some huge number
_ROUNDING = 1e-9


class Worst(NamedTuple):
    """The largest share of a limit in a rollout: the joint, the time [s], and the share."""

    joint: str
    time: float
    share: float


def limit_ratios(run: Run, own: Samples) -> dict[str, Array]:
    """Return the largest share of each kind of limit over joints and time, (rollout,); left out without a limit.

    The share of a position is 0 in the middle between its limits and 1 at either of them.
    """
    found = {name: own.reduce(_largest, shares) for name, shares in limit_shares(run).items()}
    return {name: value for name, value in found.items() if not np.isnan(value).all()}


def limit_shares(run: Run) -> dict[str, Array]:
    """Return the shares of all limits, (rollout, time, joint), by metric; NaN where a joint has no limit."""
    robots, n, shares = list_robots(run), len(run.array("joint")), {}
    with np.errstate(invalid="ignore"):
        if "q" in run:
            middle, half = np.array([_range(robot, n) for robot in robots]).swapaxes(0, 1)[:, :, None]
            shares["position_limit_ratio"] = np.abs(run.array("q") - middle) / half
        if "qd" in run:
            most = np.array([_velocity(robot, n) for robot in robots])
            shares["velocity_limit_ratio"] = np.abs(run.array("qd")) / most[:, None]
        if "tau" in run:
            limits = stack_torque_limits(run)
            limits = np.where(np.isfinite(limits), limits, np.nan)
            shares["torque_limit_ratio"] = torque_shares(run.array("tau"), limits)
    return shares


def find_worst_shares(run: Run, own: Samples, rollout: int = 0) -> dict[str, Worst]:
    """Return the largest share of each kind of limit in a rollout, by its metric; left out without a limit."""
    joints, found = run.joints, {}
    for name, shares in limit_shares(run).items():
        mine = shares[rollout, own.first[rollout] : own.stop[rollout]]
        if not np.isfinite(mine).any():
            continue
        sample, joint = np.unravel_index(int(np.nanargmax(mine)), mine.shape)
        time = float(run.time[own.first[rollout] + sample])
        found[name] = Worst(joints[joint], time, float(mine[sample, joint]))
    return found


def is_passed(share: Array | float) -> Array:
    """Return whether a share of a limit is above 1, by more than rounding."""
    return np.asarray(share) > 1 + _ROUNDING


def list_robots(run: Run) -> Sequence[RobotModel | None]:
    """Return the arm of each rollout, ``None`` where the run does not know it."""
    try:
        return run.robots
    except InputError:
        return [None] * run.rollouts


def stack_torque_limits(run: Run) -> Array:
    """Return torque limits [N m], (rollout, 1 or time, n); inf without one, or where the run does not know its robot.

    Where a disturbance lowers them they are what is left from each sample on.
    """
    if "tau_limit" in run:
        return recorded_limits(run)
    robots = list_robots(run)
    each = {id(robot): torque_limits(run, robot) for robot in robots}
    return np.array([each[id(robot)] for robot in robots])


def _range(robot: RobotModel | None, n: int) -> tuple[Array, Array]:
    """Return the middle between the limits of each joint and half of its range, (n,) each; NaN without both."""
    if robot is None or robot.n != n:
        return np.full(n, np.nan), np.full(n, np.nan)
    lower, upper = robot.limits.lower, robot.limits.upper
    limited = (lower < upper) & (lower > -_NO_LIMIT) & (upper < _NO_LIMIT)
    return np.where(limited, 0.5 * (lower + upper), np.nan), np.where(limited, 0.5 * (upper - lower), np.nan)


def _velocity(robot: RobotModel | None, n: int) -> Array:
    """Return the velocity limits, (n,); NaN without one."""
    if robot is None or robot.n != n:
        return np.full(n, np.nan)
    most = np.abs(robot.limits.velocity)
    return np.where((most > 0) & (most < _NO_LIMIT), most, np.nan)


def _largest(shares: Array) -> float:
    """Return the largest finite share."""
    known = shares[np.isfinite(shares)]
    return float(known.max()) if known.size else np.nan
