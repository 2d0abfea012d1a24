"""A curve, the interval of its parameter, and the slope of the squared distance along it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array

_MOST_STEPS = 200
_LAST_DIGITS = 2 * float(np.finfo(np.float64).eps)
_TINY = float(np.finfo(np.float64).tiny)


class Curve(NamedTuple):
    """A curve p(s) in R^m with its derivatives; each maps (*batch,) to (*batch, m). p'' serves the local search."""

    p: Callable[[Array], Array]
    dp: Callable[[Array], Array]
    ddp: Callable[[Array], Array] | None = None

    def slope(self, s: Array, x: Array) -> Array:
        """Return g(s) = (p(s) − x)ᵀp'(s), the derivative of ½‖p(s) − x‖², (*batch,), for points x (*batch, m)."""
        return ((self.p(s) - x) * self.dp(s)).sum(-1)

    def root(self, x: Array, first: Array, second: Array) -> Array:
        """Return a root of g for each row of x (N, m), between two parameters (N,) where g has different signs."""
        return _find_root(lambda s, rows: self.slope(s, x[rows]), first, second)


def _find_root(g: Callable[[Array, NDArray[np.intp]], Array], a: Array, b: Array) -> Array:
    """Return a root of g(s, row) for each row between a (N,) and b (N,), where g has different signs.

    Inverse quadratic interpolation where that is safe, else halving (T. R. Chandrupatla, Advances in Engineering
    Software 28, 1997), as SciPy's ``find_root``, which takes five times as long for a few rows.
    """
    rows = np.arange(len(a))
    a, b, t = np.array(a), np.array(b), np.full(len(a), 0.5)
    g_a, g_b, root = g(a, rows), g(b, rows), np.array(a)
    for _ in range(_MOST_STEPS):
        s = a + t * (b - a)
        value = g(s, rows)
        same = np.sign(value) == np.sign(g_a)
        c, g_c = np.where(same, a, b), np.where(same, g_a, g_b)
        b, g_b = np.where(same, b, a), np.where(same, g_b, g_a)
        a, g_a = s, value
        best = np.where(np.abs(g_a) < np.abs(g_b), a, b)
        root[rows] = best
        # a and b are one where rounding gives both the same sign
        least = _LAST_DIGITS * (np.abs(best) + _TINY) / np.maximum(np.abs(b - a), _TINY)
        going = (least < 0.5) & (g_a != 0) & (g_b != 0)
        if not going.all():
            rows, a, b, c, g_a, g_b, g_c, least = (part[going] for part in (rows, a, b, c, g_a, g_b, g_c, least))
            if not rows.size:
                break
        t = np.minimum(np.maximum(_interpolate(a, b, c, g_a, g_b, g_c), least), 1 - least)
    return root


def _interpolate(a: Array, b: Array, c: Array, g_a: Array, g_b: Array, g_c: Array) -> Array:
    """Return the share t of the way from a to b: inverse quadratic where that is monotonic, else 1/2."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        xi, phi = (a - b) / (c - b), (g_a - g_b) / (g_c - g_b)
        t = g_a / (g_b - g_a) * g_c / (g_b - g_c) + (c - a) / (b - a) * g_a / (g_c - g_a) * g_b / (g_c - g_b)
        return np.where((phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi) & np.isfinite(t), t, 0.5)


class Interval(NamedTuple):
    """The interval of the parameter of a curve; a closed curve repeats with the period upper − lower."""

    lower: float
    upper: float
    closed: bool

    @property
    def length(self) -> float:
        """The length upper − lower: the period of a closed curve."""
        return self.upper - self.lower

    def inside(self, s: Array) -> Array:
        """Clip ``s`` to the interval of an open curve; leave that of a closed one as it is."""
        return s if self.closed else np.minimum(np.maximum(s, self.lower), self.upper)

    def at_lower(self, s: Array) -> Array:
        """Return the mask of the ``s`` at or before the beginning of an open curve."""
        return (s <= self.lower) & (not self.closed)

    def at_upper(self, s: Array) -> Array:
        """Return the mask of the ``s`` at or beyond the end of an open curve."""
        return (s >= self.upper) & (not self.closed)

    def lap(self, s: Array) -> Array:
        """Return the number of whole periods by which ``s`` is beyond the interval."""
        return np.floor((s - self.lower) / self.length) if self.closed else np.zeros_like(s)

    def unwrap(self, s: Array, near: Array) -> Array:
        """Return ``s`` shifted by whole periods to lie nearest to ``near``."""
        return s + self.length * np.round((near - s) / self.length) if self.closed else s
