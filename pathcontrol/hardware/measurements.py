"""The screening of measurements: what is no number, late, repeated or impossible."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.hardware.envelope import CompleteEnvelope


class Screen:
    """The last good measurement of an arm, and the checks of the next one against it.

    Attributes:
        q: last good positions [rad], (n,).
        qd: last good velocities [rad/s], (n,).
        t: their time [s].
    """

    def __init__(self, envelope: CompleteEnvelope, q: Array, qd: Array, t: float) -> None:
        self._envelope, self._equal = envelope, 0
        self.q, self.qd, self.t = np.array(q, dtype=np.float64), np.array(qd, dtype=np.float64), float(t)

    def take(self, q: Any, qd: Any, t: Any) -> str:
        """Take a measurement if it is good, and return "", or the sentence on what is wrong with it."""
        if (measured := self.read(q, qd, t)) is None:
            return "a measurement is no number, or has another shape"
        position, velocity, time = measured
        gap = time - self.t
        if not gap > 0:
            return f"the time of a measurement is {gap:.3g} s after the one before: it is repeated or out of order"
        if fault := self._find_jump(position, velocity, gap):
            return fault
        if self._is_frozen(position, velocity):
            return f"{self._equal + 1} equal measurements of an arm that moves"
        self.q[:], self.qd[:], self.t = position, velocity, time
        return ""

    def read(self, q: Any, qd: Any, t: Any) -> tuple[Array, Array, float] | None:
        """Return a measurement as finite numbers, q and q̇ (n,) and t, or None where it is something else."""
        position, velocity, time = self._as_numbers(q), self._as_numbers(qd), self._as_numbers(t, 1)
        if position is None or velocity is None or time is None:
            return None
        return position, velocity, float(time[0])

    def _as_numbers(self, value: Any, size: int | None = None) -> Array | None:
        """Return a measurement as finite numbers, None where it is something else."""
        try:
            array = np.asarray(value, dtype=np.float64).reshape(-1)
        except (TypeError, ValueError):
            return None
        return array if array.size == (size or self.q.size) and np.isfinite(array).all() else None

    def _find_jump(self, q: Array, qd: Array, gap: float) -> str:
        """Return the sentence on a position that is farther than the arm can have come in a ``gap`` [s], or ""."""
        reach = self._envelope.jump + self._envelope.velocity * gap
        over = np.abs(q - self.q) - reach
        if not (over > 0).any():
            return ""
        i = int(over.argmax())
        limits, jump = self._envelope, q[i] - self.q[i]
        return f"the position of {limits.joints[i]} jumps by {jump:.3g} {limits.units[i]} in {gap:.3g} s"

    def _is_frozen(self, q: Array, qd: Array) -> bool:
        """Return whether the same numbers have come for too long from an arm that moves."""
        same = bool((q == self.q).all() and (qd == self.qd).all() and (qd != 0).any())
        self._equal = self._equal + 1 if same else 0
        return self._equal >= self._envelope.frozen
