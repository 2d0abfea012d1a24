"""Which torques an arm was held to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.config import table

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run

_NO_LIMIT = 1e6  # N m: files that know no limit say some huge number, or zero


def torque_limits(run: Run, robot: RobotModel | None) -> Array:
    """Limits of the torques [N m], (n,): those that were clamped to, else the robot's; inf without one."""
    n = len(run.array("joint"))
    own = np.full(n, np.inf) if robot is None or robot.n != n else robot.limits.effort
    limits = _clamped(run, n)
    limits = np.abs(own if limits is None else limits)
    return np.where((limits > 0) & (limits < _NO_LIMIT), limits, np.inf)


def _clamped(run: Run, n: int) -> Array | None:
    """What the loop clamped to if that were not the robot's own limits; of rows for rollouts it is not known whose."""
    try:
        given = np.asarray(table(run.config, "loop").get("torque_limits"), dtype=np.float64)
    except (TypeError, ValueError):
        return None
    if given.ndim == 2:
        return np.full(n, np.inf)
    return given if given.shape == (n,) else None
