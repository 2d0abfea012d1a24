"""The expected answer of a position servo, and the deviation of an arm from it."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from pathcontrol._arrays import Array

_SMOOTHING = 0.02  # s, time constant of the rate of the deviation


class ServoModel:
    """Joints that follow their commands with a first-order lag, and what an arm deviates from them.

    Args:
        lag: time constants T [s], (n,), 0 for none.
        period: time between two commands [s].
    """

    def __init__(self, lag: Array, period: float) -> None:
        self._period = period
        self._share = -np.expm1(-period / np.maximum(lag, 1e-300))  # of the way to a command in a period
        self._smoothing = float(-np.expm1(-period / max(_SMOOTHING, period)))
        self._expected = self._deviation = self._rate = np.zeros(len(lag))
        self._measured: Array | None = None  # the last good measurement

    @property
    def deviation(self) -> tuple[Array, Array]:
        """The deviation d = q − q̂ [rad] and its smoothed rate [rad/s], (n,) each."""
        return self._deviation, self._rate

    def start(self, q: Array) -> None:
        """Start with an arm at q (n,) that is where it was told to be."""
        self._expected, self._deviation, self._rate = q.copy(), np.zeros_like(q), np.zeros_like(q)
        self._measured = q.copy()

    def forget(self) -> None:
        """Take the next measurement wherever it is."""
        self._measured = None

    def expect(self, command: Array) -> Self:
        """Follow a command (n,) for a period."""
        self._expected = self._expected + self._share * (command - self._expected)
        return self

    def update(self, q: Any, reach: Array) -> bool:
        """Take measured positions (n,); return whether they are numbers within ``reach`` (n,), else nothing changes."""
        try:
            position = np.asarray(q, dtype=np.float64).reshape(-1)
        except (TypeError, ValueError):
            return False
        if position.shape != self._expected.shape or not np.isfinite(position).all():
            return False
        if self._measured is not None and (np.abs(position - self._measured) > reach).any():
            return False
        self._measured, deviation = position.copy(), position - self._expected
        self._rate = self._rate + self._smoothing * ((deviation - self._deviation) / self._period - self._rate)
        self._deviation = deviation
        return True
