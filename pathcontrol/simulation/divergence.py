"""The detection of rollouts that diverge: they are marked and held where they disturb no other."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import SimulationError
from pathcontrol.simulation.arm.sensors import Reading

_ABSURD = 1e6  # rad and rad/s, beyond the reach of any arm
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
    """The record of diverged rollouts: which, when and why.

    A state is lost when a position or velocity is no number or beyond 10⁶ rad or rad/s, a law when one of its torques
    is no number. A lost rollout is put back to where it started and held there, where its law is known to work, until
    the run ends: no other one waits for it, and none can see it.

    Attributes:
        time: when each rollout diverged [s], NaN where it has not, (N,).
        reason: why, and what to try, (N,); empty where it has not.
        lost: which have diverged, (N,).
        any: True if one has.
    """

    def __init__(self, q: Array, qd: Array) -> None:
        self._home, rollouts = Reading(q, qd), len(q)
        self.time, self.reason = np.full(rollouts, np.nan), np.full(rollouts, "", dtype=object)
        self.lost, self.any, self._why = np.zeros(rollouts, dtype=bool), False, ""

    @property
    def all(self) -> bool:
        """True if no rollout is left."""
        return self.any and bool(self.lost.all())

    def check_state(self, t: float, q: Array, qd: Array) -> None:
        """Mark the rollouts whose state is lost at t [s]; q and q̇ are (N, n)."""
        # one comparison serves the common case that all is well
        if not np.vdot(q, q) + np.vdot(qd, qd) < _ABSURD**2:
            self.mark(t, ~is_bounded(q, qd))

    def check_torque(self, t: float, tau: Array) -> None:
        """Mark the rollouts whose law asks for torques (N, n) that are no numbers at t [s]."""
        if not isfinite(np.vdot(tau, tau)):
            self.mark(t, np.asarray(~np.isfinite(tau).all(-1)), NO_NUMBERS)

    def mark(self, t: float, rows: Array, reason: str = BEYOND) -> None:
        """Mark the ``rows`` (N,) as diverged at t [s], unless they were marked before."""
        news = rows & ~self.lost
        self.time[news], self.reason[news] = t, reason
        self.lost = self.lost | rows
        self.any = bool(self.lost.any())

    def explain(self, *causes: str) -> None:
        """Set the likely ``causes``, which may be empty texts, for the error of :meth:`check`.

        ``reason`` stays what it is: the causes are those of a batch, and a rollout has the same reason alone.
        """
        self._why = "; ".join(filter(None, causes))

    def _explain_rollout(self, row: int) -> str:
        """Return the reason of a rollout with its likely cause."""
        if not self._why or self.reason[row] == NO_NUMBERS:
            return str(self.reason[row])
        return f"its state left all bounds: {self._why}"

    def reset_lost(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return (q, q̇), each (N, n), with lost rollouts at their initial states."""
        return self.replace_lost(q, self._home.q), self.replace_lost(qd, self._home.qd)

    def replace_lost(self, values: Array, by: Array | float) -> Array:
        """Return ``values`` (N, …), those of lost rollouts replaced."""
        return np.where(self.lost.reshape(-1, *[1] * (values.ndim - 1)), by, values)

    def erase(self, arrays: Mapping[str, Array], time: Array) -> None:
        """Set the record (N, time, …) of lost rollouts to NaN from their divergence on; truth values to False."""
        for row in np.flatnonzero(self.lost):
            first = int(np.searchsorted(time, self.time[row]))
            for array in arrays.values():
                array[row, first:] = False if array.dtype == bool else np.nan

    def outcome(self) -> dict[str, Array]:
        """Return times and reasons, for the outcome of a run."""
        return {"diverged_time": self.time, "reason": self.reason.astype(str)}

    def check(self, run: Any) -> None:
        """Check that some rollout of ``run`` has not diverged.

        Raises:
            SimulationError: all have.
        """
        if not self.all:
            return
        if len(self.time) == 1:
            message = f"rollout 0 diverged at t = {self.time[0]:.4g} s: {self._explain_rollout(0)}"
        else:
            last = int(np.argmax(self.time))
            message = (
                f"all {len(self.time)} rollouts diverged, the last one, {last}, at t = {self.time[last]:.4g} s: "
                f"{self._explain_rollout(last)}"
            )
        raise SimulationError(message, run, time=float(self.time.max()))


def is_bounded(q: Array, qd: Array) -> Array:
    """Return for which states q and q̇ (N, n) an arm is within bounds, (N,)."""
    return np.maximum(np.abs(q), np.abs(qd)).max(-1) < _ABSURD
