"""A curve, the interval it is searched on, and the slope of the squared distance along it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array


class Curve(NamedTuple):
    """A curve p(s) in R^m with its derivatives; each maps (*batch,) to (*batch, m). p'' serves the local search."""

    p: Callable[[Array], Array]
    dp: Callable[[Array], Array]
    ddp: Callable[[Array], Array] | None = None

    def slope(self, s: Array, x: Array) -> Array:
        """g(s) = (p(s) − x)ᵀp'(s), the derivative of ½‖p(s) − x‖², (*batch,), for points x (*batch, m)."""
        return ((self.p(s) - x) * self.dp(s)).sum(-1)

    def root(self, x: Array, first: Array, second: Array) -> Array:
        """A root of g for each row of x (N, m) between two parameters (N,) where it has different signs."""
        from scipy.optimize.elementwise import find_root  # loads all of scipy.optimize

        lower, upper = np.minimum(first, second), np.maximum(first, second)
        return find_root(lambda s, row: self.slope(s, x[row]), (lower, upper), args=(np.arange(len(x)),)).x


class Interval(NamedTuple):
    """Where the parameter of a curve lives; a closed curve repeats with the period upper − lower."""

    lower: float
    upper: float
    closed: bool

    @property
    def length(self) -> float:
        """Upper − lower: the period of a closed curve."""
        return self.upper - self.lower

    def inside(self, s: Array) -> Array:
        """``s`` itself, or the end of an open curve that it is beyond."""
        return s if self.closed else np.minimum(np.maximum(s, self.lower), self.upper)

    def at_lower(self, s: Array) -> Array:
        """Where ``s`` is the beginning of an open curve, or before it."""
        return (s <= self.lower) & (not self.closed)

    def at_upper(self, s: Array) -> Array:
        """Where ``s`` is the end of an open curve, or beyond it."""
        return (s >= self.upper) & (not self.closed)

    def lap(self, s: Array) -> Array:
        """How many whole periods ``s`` is beyond the interval."""
        return np.floor((s - self.lower) / self.length) if self.closed else np.zeros_like(s)

    def unwrap(self, s: Array, near: Array) -> Array:
        """``s`` shifted by whole periods to lie nearest to ``near``."""
        return s + self.length * np.round((near - s) / self.length) if self.closed else s
