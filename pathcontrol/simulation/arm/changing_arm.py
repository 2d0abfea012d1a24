"""The simulated arm where disturbances change the arm itself, from tick to tick."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array, as_array
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Disturbance

Arm = RobotModel | RobotBatch


class ChangingArm:
    """The arm that is simulated in each period: the arm as ever, or what a disturbance makes of it.

    A change acts in the periods whose middle it covers, so it comes at a tick.

    Args:
        robot: the arm as ever, or one for each rollout.
        disturbance: what may change it.
        period: of the loop [s].
    """

    def __init__(self, robot: Arm, disturbance: Disturbance | None, period: float) -> None:
        self._robot, self._disturbance = robot, disturbance
        times = np.empty(0) if disturbance is None else as_array("arm_change_times", disturbance.arm_change_times)
        self._times = np.unique(times[np.isfinite(times)])
        self._ticks = np.ceil(self._times / period - 0.5)
        self._early = int((self._times < 0).sum())
        self._interval, self._arm = 0, robot

    @property
    def changes(self) -> bool:
        """True if the arm changes at all."""
        return bool(self._times.size)

    def at(self, tick: int) -> Arm:
        """Return the arm of the period that begins at a tick; the same object until it changes."""
        interval = self._find_interval(tick)
        if interval != self._interval and self._disturbance is not None:
            self._arm = self._disturbance.change_arm(self._middle(interval), self._robot)
            self._interval = interval
        return self._arm

    def strike(self, tick: int, q: Array, qd: Array) -> Array:
        """Return q̇ (N, n) after the change of the arm that comes at a tick: by M⁻¹ times its impulse, M after it."""
        interval, before = self._find_interval(tick), self._find_interval(tick - 1)
        if interval == before or self._disturbance is None:
            return qd
        impulse = self._disturbance.strike(self._middle(before), self._middle(interval), q, qd)
        if impulse is None or not impulse.any():
            return qd
        rows, after, arm = np.flatnonzero(impulse.any(-1)), qd.copy(), self.at(tick)
        M = arm.mass_matrix(q[rows], rows) if isinstance(arm, RobotBatch) else arm.mass_matrix(q[rows])
        after[rows] += np.linalg.solve(M, impulse[rows][..., None])[..., 0]
        return after

    def _find_interval(self, tick: int) -> int:
        """Return the number of changes up to a tick; those before the start have come before tick 0."""
        if not self.changes:  # the common case, asked three times a tick
            return 0
        return max(self._early, int(np.searchsorted(self._ticks, tick, side="right")))

    def next_change(self, tick: int) -> float:
        """Return the first tick after ``tick`` at which the arm may change, inf without one."""
        later: Array = self._ticks[self._ticks > tick]
        return float(later[0]) if later.size else np.inf

    def _middle(self, interval: int) -> float:
        """Return a time [s] within the interval between two changes, away from both."""
        ends = np.concatenate([self._times[:1] - 2.0, self._times, self._times[-1:] + 2.0])
        return float(0.5 * (ends[interval] + ends[interval + 1]))
