"""The fastest way to pass each cell, taken alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.profiles.topp.cell_constraints import Cells

_TRIALS = 60
_CLOSE = 1e-6
_FURTHER = 1 - 1e-9  # than Newton's step, so that rounding does not leave it outside
_TINY = 1e-12  # share of a limit


class Bound(NamedTuple):
    """A bound on x as a function of x', and its slope dx/dx', each (N,)."""

    x: Array
    slope: Array


def fastest_pair(cells: Cells, top: Array) -> tuple[Array, Array]:
    """Return the allowed x' ≤ ``top`` and x that maximise √x + √x' in each cell; each (N,).

    Where rest (0, 0) is allowed the set of allowed (x, x') is convex but for viscous friction, which bends its sides.
    Newton's method goes from ``top`` to the largest x' allowed, kept in a bracket. Where less is faster, because the
    largest x falls with x', bisection goes on from there.
    """
    A = np.where(np.abs(cells.A) * top[:, None] < _TINY, _TINY / top[:, None], cells.A)
    cells = cells._replace(A=A)  # rows without x bound x' as long as they have a little of it
    low, high, trial = np.zeros_like(top), top.copy(), top.copy()
    left = np.arange(len(top))
    for _ in range(_TRIALS):
        x_next = trial[left]
        most, least = bounds(cells.select(left), x_next)
        gap = most.x - least.x
        slower = most.slope < -np.sqrt(np.maximum(most.x, 0.0) / x_next)
        good = (gap >= 0) & ~slower
        low[left], high[left] = np.where(good, x_next, low[left]), np.where(good, high[left], x_next)
        narrowing = least.slope - most.slope
        newton = _FURTHER * (x_next + gap / narrowing)
        usable = ((gap < 0) | ~slower) & (newton > low[left]) & (newton < high[left])
        trial[left] = np.where(usable, newton, 0.5 * (low[left] + high[left]))
        found = good & ((gap < _CLOSE * narrowing * x_next) | (x_next == top[left]))
        left = left[~found & (high[left] - low[left] > _CLOSE * high[left])]
        if not left.size:
            break
    return low, bounds(cells, low)[0].x


def bounds(cells: Cells, x_next: Array) -> tuple[Bound, Bound]:
    """Return the largest and the least x for x' (N,): roots of A x + B √x = −C − A'x' − B'√x' = z/2.

    Of two roots the one on the side of x = x' counts. Where a row for this x' bounds x to less than 0, the bound is
    continued there.
    """
    A, B, A_next, B_next, C = cells
    x_next = x_next[:, None]
    y_next = np.sqrt(x_next)
    z = -2 * (C + A_next * x_next + B_next * y_next)
    disc = B * B + 2 * A * z
    root = B + np.sqrt(np.maximum(disc, 0.0))
    growing = (A > 0) | ((B + 2 * A * y_next > 0) & (disc >= 0))
    y_most = np.where(growing & (z >= 0), z / root, np.inf)
    y_least = np.where((A < 0) & ((z < 0) | (~growing & (disc >= 0))), np.maximum(root, 0.0) / (-2 * A), 0.0)
    x_most = np.where((A > 0) & (z < 0), z / (2 * A), y_most**2)
    rise = -A_next - 0.5 * B_next / y_next
    most, least = x_most.argmin(-1), y_least.argmax(-1)
    return _active(most, x_most, y_most, rise, A, B), _active(least, y_least**2, y_least, rise, A, B)


def _active(row: Array, *values: Array) -> Bound:
    """Return the bound of the chosen row of each cell, with its slope."""
    x, y, rise, A, B = (array[np.arange(len(row)), row] for array in values)
    bounding = np.isfinite(x) & (y > 0)
    return Bound(x, np.where(bounding, rise / (A + 0.5 * B / np.where(bounding, y, 1.0)), 0.0))
