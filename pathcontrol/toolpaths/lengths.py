"""The arc length of a curve, and the curve's parameter as a function of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array

_FIRST_CELLS, _MOST_CELLS = 8, 1 << 14
_NARROWEST = 2.0**-40
_ACCURACY = 1e-13  # of the length, in each cell
_TURN = 0.9  # rad over a cell; what quadrature would miss in the corner of a cell shows in the tangents at its ends
_NEWTON_STEPS = 64  # where the speed vanishes Newton's method begins by halving
_SMALLEST = np.finfo(float).tiny
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)

Function = Callable[[Array], Array]


class ArcLength:
    """The arc length s(u) = ∫₀ᵘ ‖dp/du‖ du [m] for u ∈ [0, 1], by Gauss–Legendre quadrature in small enough cells.

    Args:
        derivative: dp/du [m], (*batch, 3), at u (*batch,).
    """

    def __init__(self, derivative: Function) -> None:
        self._derivative = derivative
        self._u, lengths = _cells(derivative)
        self._s = np.concatenate([[0.0], np.cumsum(lengths)])

    @property
    def total(self) -> float:
        """The length of the whole curve, s(1) [m]."""
        return float(self._s[-1])

    def parameter(self, s: ArrayLike) -> Array:
        """Return the u at which the arc length is s (*batch,) [m]."""
        s = np.asarray(s, dtype=np.float64)
        cell = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._u) - 2)
        left, right, wanted = self._u[cell], self._u[cell + 1], s - self._s[cell]
        u = left + (right - left) * np.clip(wanted / np.maximum(self._s[cell + 1] - self._s[cell], _SMALLEST), 0, 1)
        for _ in range(_NEWTON_STEPS):
            error = _length(self._derivative, left, u) - wanted
            if (np.abs(error) <= 1e-15 * self.total).all():
                break
            u = np.clip(u - error / np.maximum(_speed(self._derivative, u), _SMALLEST), left, right)
        return u


def _cells(derivative: Function) -> tuple[Array, Array]:
    """Return the ends of cells over which the quadrature is accurate (k + 1,), and the length over each [m], (k,)."""
    u = np.linspace(0.0, 1.0, _FIRST_CELLS + 1)
    while True:
        middle = 0.5 * (u[:-1] + u[1:])
        tangent = derivative(u) / np.maximum(_speed(derivative, u), _SMALLEST)[:, None]
        whole = _length(derivative, u[:-1], u[1:])
        halves = _length(derivative, u[:-1], middle) + _length(derivative, middle, u[1:])
        coarse = np.abs(halves - whole) > _ACCURACY * halves.sum()
        coarse |= np.linalg.norm(np.diff(tangent, axis=0), axis=-1) > _TURN
        coarse &= np.diff(u) > _NARROWEST
        if not coarse.any() or len(u) > _MOST_CELLS:
            return u, whole
        u = np.sort(np.append(u, middle[coarse]))


def _length(derivative: Function, a: Array, b: Array) -> Array:
    """Return the length from each a to b (*batch,) [m]."""
    half = 0.5 * (b - a)[..., None]
    return (_speed(derivative, 0.5 * (a + b)[..., None] + half * _NODES) * _WEIGHTS * half).sum(-1)


def _speed(derivative: Function, u: Array) -> Array:
    """Return ‖dp/du‖ [m], (*batch,)."""
    return np.linalg.norm(derivative(u), axis=-1)
