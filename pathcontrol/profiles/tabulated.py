"""A velocity profile given by a table, with constant pseudo-acceleration between its knots."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol.errors import InputError
from pathcontrol.tasks.profile import Path, VelocityProfile

MOST_POINTS = 1_000_000  # of a table that is computed


class TabulatedProfile(VelocityProfile):
    """A velocity profile with ϑ² linear in s between knots, so that s̈ = ½ dϑ²/ds is constant there.

    ϑ is continuous; ϑ' jumps at the knots, where it is that of the cell to the right. Beyond the ends of an open
    path ϑ keeps its end values.

    Args:
        s: knots, (m,), m ≥ 2, strictly increasing; for a closed path from s0 to s0 + period.
        squared: ϑ² > 0 [1/s²] at the knots, (m,); for a closed path the last value is the first again.
        period: the period of a closed path; ``None`` for an open one.

    Attributes:
        s: the knots, read-only.
        squared: ϑ² at the knots, read-only.
        period: as given.
    """

    kept_as = "TabulatedProfile"

    def __init__(self, s: ArrayLike, squared: ArrayLike, period: float | None = None) -> None:
        self.s = _check_knots(s)
        self.squared = _check_squares(self.s, check_finite("squared", as_array("squared", squared)))
        self.period = None if period is None else _check_period(self.s, self.squared, period)
        self._acceleration = 0.5 * np.diff(self.squared) / np.diff(self.s)

    def theta(self, path: Path, s: Array) -> Array:
        return np.sqrt(np.interp(self._within(s), self.s, self.squared))

    def dtheta(self, path: Path, s: Array) -> Array:
        return self._both(s)[1]

    def at(self, dq_d: Array, ddq_d: Array, path: Path, s: Array) -> tuple[Array, Array]:
        return self._both(s)

    def knots(self, path: Path) -> Array | None:
        return self.s

    @property
    def traversal_time(self) -> float:
        """Time [s] from the first knot to the last: Σ 2Δs/(ϑ_i + ϑ_{i+1})."""
        theta = np.sqrt(self.squared)
        return float((2 * np.diff(self.s) / (theta[:-1] + theta[1:])).sum())

    def describe(self) -> dict[str, Any]:
        """Return name, number of knots and traversal time [s]; the whole table would be too long."""
        return {"profile": type(self).__name__, "knots": len(self.s), "traversal_time": self.traversal_time}

    def _both(self, s: Array) -> tuple[Array, Array]:
        s = self._within(s)
        theta = np.sqrt(np.interp(s, self.s, self.squared))
        cell = np.minimum(np.maximum(np.searchsorted(self.s, s, side="right") - 1, 0), len(self.s) - 2)
        inside = (s >= self.s[0]) & (s <= self.s[-1])
        return theta, np.where(inside, self._acceleration[cell], 0.0) / theta

    def _within(self, s: Array) -> Array:
        if self.period is None:
            return np.asarray(s)
        # nothing is rounded in the first lap, so that a knot stays in the cell to its right
        return s - self.period * np.floor((s - self.s[0]) / self.period)


def _check_knots(s: ArrayLike) -> Array:
    knots = check_finite("s", as_array("s", s))
    if knots.ndim != 1 or len(knots) < 2:
        raise InputError(f"s has shape {knots.shape}, expected at least two knots, (m,)", argument="s", value=s)
    if not (np.diff(knots) > 0).all():
        i = int(np.argmax(np.diff(knots) <= 0))
        raise InputError(
            f"s[{i}] = {knots[i]:g} is followed by {knots[i + 1]:g}, expected strictly increasing knots",
            argument="s",
            value=knots[i + 1],
            limit=knots[i],
        )
    return freeze(knots)


def _check_squares(s: Array, squared: Array) -> Array:
    if squared.shape != s.shape:
        raise InputError(
            f"squared has shape {squared.shape} and s {s.shape}, expected one ϑ² for each knot",
            argument="squared",
            value=squared,
        )
    if not (squared > 0).all():
        i = int(np.argmin(squared))
        raise InputError(
            f"squared[{i}] = {squared[i]:g} at s = {s[i]:g}, expected ϑ² > 0: where it is not, the motion plan "
            "ṡ = ϑ(s) stops for ever",
            argument="squared",
            value=squared[i],
            limit=0.0,
            s=float(s[i]),
        )
    return freeze(squared)


def _check_period(s: Array, squared: Array, period: float) -> float:
    period = as_scalar("period", period, positive=True)
    if not np.isclose(s[-1] - s[0], period, rtol=1e-9, atol=0):
        raise InputError(
            f"period = {period:g}, but the knots span {s[-1] - s[0]:g}; give knots from s0 to s0 + period",
            argument="period",
            value=period,
        )
    if not np.isclose(squared[0], squared[-1], rtol=1e-9, atol=0):
        raise InputError(
            f"squared begins with {squared[0]:g} and ends with {squared[-1]:g}, expected the same on a closed path",
            argument="squared",
            value=squared,
        )
    return period
