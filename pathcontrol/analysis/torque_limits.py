"""The torque limits that applied in a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.config import table

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run

_NO_LIMIT = 1e6  # N m: files without a limit give some huge number, or zero


def torque_limits(run: Run, robot: RobotModel | None) -> Array:
    """Return the limits of the torques [N m], (n,): those of the loop, else the robot's; inf without one."""
    n = len(run.array("joint"))
    own = np.full(n, np.inf) if robot is None or robot.n != n else robot.limits.effort
    limits = _loop_limits(run, n)
    limits = np.abs(own if limits is None else limits)
    return np.where((limits > 0) & (limits < _NO_LIMIT), limits, np.inf)


def _loop_limits(run: Run, n: int) -> Array | None:
    """Return the limits that the loop sets, ``None`` if they are the robot's own; inf where they differ by rollout."""
    try:
        given = np.asarray(table(run.config, "loop").get("torque_limits"), dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if given.ndim == 2:
        return np.full(n, np.inf)
    return given if given.shape == (n,) else None
