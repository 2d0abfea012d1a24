"""The sensors of the arm: encoders of finite resolution, velocity by differentiation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array


class Reading(NamedTuple):
    """Measured positions [rad] and velocities [rad/s], (N, n)."""

    q: Array
    qd: Array


class Sensors(NamedTuple):
    """The measuring chain of a sampled loop.

    Attributes:
        period: sampling period [s].
        resolution: angle of one encoder count [rad], (1, n) or (N, n), or None for exact positions.
        differentiate: velocity as the difference of two positions over the period, instead of the true one.
        cutoff: corner frequency of a first-order low-pass filter on the velocity [Hz], or None.
    """

    period: float
    resolution: Array | None
    differentiate: bool
    cutoff: float | None

    def start(self, q: Array, qd: Array) -> Reading:
        """Return the reading one period before the run, had the arm moved steadily at q̇."""
        return Reading(self._position(q - self.period * qd), qd)

    def read(self, q: Array, qd: Array, last: Reading) -> Reading:
        """Return the next reading of an arm at (q, q̇), after ``last``."""
        position = self._position(q)
        velocity = (position - last.q) / self.period if self.differentiate else qd
        if self.cutoff is not None:
            # the exact response of the filter to a velocity held over the period
            keep = np.exp(-2 * np.pi * self.cutoff * self.period)
            velocity = keep * last.qd + (1 - keep) * velocity
        return Reading(position, velocity)

    def _position(self, q: Array) -> Array:
        """Return positions rounded to encoder counts."""
        return q if self.resolution is None else np.rint(q / self.resolution) * self.resolution
