"""The torque limits that applied in a run, or in each sample of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.config import table

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run

_NO_LIMIT = 1e6  # N m: files without a limit give some huge number, or zero


def torque_limits(run: Run, robot: RobotModel | None) -> Array:
    """Return the limits of the first rollout's torques [N m], (1, n), or (time, n) where they change; inf without one.

    They are those of the loop, as a disturbance leaves them, else the robot's.
    """
    if "tau_limit" in run:
        return recorded_limits(run)[0]
    n = len(run.array("joint"))
    own = np.full(n, np.inf) if robot is None or robot.n != n else robot.limits.effort
    limits = _loop_limits(run, n)
    limits = np.abs(own if limits is None else limits)
    return np.where((limits > 0) & (limits < _NO_LIMIT), limits, np.inf)[None]


def recorded_limits(run: Run) -> Array:
    """Return the limits that a run recorded [N m], (rollout, time, n); inf without one."""
    left = run.array("tau_limit")
    return np.where(left < _NO_LIMIT, left, np.inf)


def _loop_limits(run: Run, n: int) -> Array | None:
    """Return the limits that the loop sets, (n,), ``None`` if they are the robot's own; inf where they are unknown."""
    given = table(run.config, "loop").get("torque_limits")
    if isinstance(given, Mapping):  # a summary of many rows, in a file of an earlier version
        return np.full(n, np.inf)
    try:
        limits = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if limits.ndim == 2:
        same = len(limits) > 0 and limits.shape[1] == n and (limits == limits[0]).all()
        return limits[0] if same else np.full(n, np.inf)
    return limits if limits.shape == (n,) else None


def torque_shares(torques: Array, limits: Array) -> Array:
    """Return sizes of torques over their limits, which may be 0: nothing of nothing is 0."""
    sizes = np.abs(torques)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((sizes == 0) & (limits == 0), 0.0, sizes / limits)
