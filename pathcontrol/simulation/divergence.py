"""Rollouts that diverge: found at once, marked, and kept where they disturb no other."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import SimulationError
from pathcontrol.simulation.arm.sensors import Reading

_ABSURD = 1e6  # rad and rad/s, beyond any arm
BEYOND = (
    "its state left all bounds; if it does so with more substeps of the loop too, shorten the period, lower the gains, "
    "or start nearer to the path"
)
NO_NUMBERS = "its law asks for torques that are no numbers; look for a NaN in the task, q_d or ϑ, near where the arm is"
CRAWLED = (
    "the integrator crawls, by steps of a few µs at most; start away from where the law is not defined, such as the "
    "centre of a circle, lower the gains, widen friction_width, or use a SampledLoop"
)
STOPPED = "the integrator gave up; lower the gains, or widen friction_width"


class Divergence:
    """Which rollouts have diverged, when and why.

    A state is lost when a position or velocity is no number or beyond 10⁶ rad or rad/s, a law when one of its torques
    is no number. A lost rollout is put back to where it started and held there, where its law is known to work, until
    the run ends: no other one waits for it, and none can see it.

    Attributes:
        time: when each rollout diverged [s], NaN where it has not, (N,).
        reason: why, and what to try, (N,); empty where it has not.
        lost: which have diverged, (N,).
        any: whether one has.
    """

    def __init__(self, q: Array, qd: Array) -> None:
        self._home, rollouts = Reading(q, qd), len(q)
        self.time, self.reason = np.full(rollouts, np.nan), np.full(rollouts, "", dtype=object)
        self.lost, self.any, self._why = np.zeros(rollouts, dtype=bool), False, ""

    @property
    def all(self) -> bool:
        """Whether no rollout is left."""
        return self.any and bool(self.lost.all())

    def look_at_state(self, t: float, q: Array, qd: Array) -> None:
        """Mark the rollouts whose state is lost at t [s]; q and q̇ are (N, n)."""
        # one number says that all is well, as it nearly always is
        if not np.vdot(q, q) + np.vdot(qd, qd) < _ABSURD**2:
            self.mark(t, ~sound(q, qd))

    def look_at_torque(self, t: float, tau: Array) -> None:
        """Mark the rollouts whose law asks for torques (N, n) that are no numbers at t [s]."""
        if not isfinite(np.vdot(tau, tau)):
            self.mark(t, np.asarray(~np.isfinite(tau).all(-1)), NO_NUMBERS)

    def mark(self, t: float, rows: Array, reason: str = BEYOND) -> None:
        """``rows`` (N,) have diverged at t [s], unless they had before."""
        news = rows & ~self.lost
        self.time[news], self.reason[news] = t, reason
        self.lost = self.lost | rows
        self.any = bool(self.lost.any())

    def explain(self, *causes: str) -> None:
        """Say in the error of :meth:`check` why states left all bounds, where ``causes`` are known, which may be empty.

        ``reason`` stays what it is: the causes are those of a batch, and a rollout has the same reason alone.
        """
        self._why = "; ".join(filter(None, causes))

    def _told(self, row: int) -> str:
        """The reason of a rollout with what is known of its cause."""
        if not self._why or self.reason[row] == NO_NUMBERS:
            return str(self.reason[row])
        return f"its state left all bounds: {self._why}"

    def home(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """(q, q̇), each (N, n), with lost rollouts where they started."""
        return self.replaced(q, self._home.q), self.replaced(qd, self._home.qd)

    def replaced(self, values: Array, by: Array | float) -> Array:
        """``values`` (N, …), for lost rollouts those given."""
        return np.where(self.lost.reshape(-1, *[1] * (values.ndim - 1)), by, values)

    def erase(self, arrays: Mapping[str, Array], time: Array) -> None:
        """Make what is recorded (N, time, …) of a lost rollout NaN from when it diverged on; False for truth values."""
        for row in np.flatnonzero(self.lost):
            first = int(np.searchsorted(time, self.time[row]))
            for array in arrays.values():
                array[row, first:] = False if array.dtype == bool else np.nan

    def outcome(self) -> dict[str, Array]:
        """What a run says of it."""
        return {"diverged_time": self.time, "reason": self.reason.astype(str)}

    def check(self, run: Any) -> None:
        """Nobody is served by a ``run`` of nothing but rollouts that have diverged.

        Raises:
            SimulationError: all have.
        """
        if not self.all:
            return
        if len(self.time) == 1:
            message = f"rollout 0 diverged at t = {self.time[0]:.4g} s: {self._told(0)}"
        else:
            last = int(np.argmax(self.time))
            message = (
                f"all {len(self.time)} rollouts diverged, the last one, {last}, at t = {self.time[last]:.4g} s: "
                f"{self._told(last)}"
            )
        raise SimulationError(message, run, time=float(self.time.max()))


def sound(q: Array, qd: Array) -> Array:
    """Which of the states q and q̇ (N, n) an arm can be in, (N,)."""
    return np.maximum(np.abs(q), np.abs(qd)).max(-1) < _ABSURD
