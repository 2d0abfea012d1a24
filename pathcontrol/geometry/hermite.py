"""Piecewise Hermite interpolation of a function by its values and derivatives at the ends of cells.

The values of a function and its first, or its first two, derivatives at the ends of a cell of width h make a cubic or
a quintic in between (Hermite interpolation). Splines of that degree are reproduced up to rounding, other smooth
functions to O(h⁴) or O(h⁶).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

#: maps s (m,) to a function and its first, or first two, derivatives there, (2 or 3, m, n)
Jet = Callable[[Array], Array]

_INSIDE = np.array([0.23, 0.5, 0.81])  # of a cell, where function and polynomial are compared
#: allowed differences of values and slopes, of the extent of the function and of its largest slope, for a jet of 2 or 3
_ALLOWED = {2: (1e-9, 1e-6), 3: (1e-11, 1e-9)}
_ROUNDING = 32 * np.finfo(float).eps
_HALVINGS = 40
_MOST_CELLS = 1 << 12  # more than there were at first


class CurvePoint(NamedTuple):
    """A curve at s: position [m] and its first two derivatives with respect to s, each (*batch, 3)."""

    p: Array
    dp: Array
    ddp: Array


def hermite_polynomials(s: Array, jets: Array) -> PPoly:
    """Return the polynomials in the cells between s (m,), from the ``jets`` (2 or 3, m, n) there."""
    from scipy.interpolate import PPoly  # takes longer to load than a simulation that needs none

    return PPoly(coefficients(s, jets), s)


def coefficients(s: Array, jets: Array) -> Array:
    """Return the coefficients (4 or 6, m - 1, n) of the polynomials between s (m,), from the highest power down."""
    h = np.diff(s)[:, None]
    y, dy = jets[0, :-1], jets[1, :-1]
    if len(jets) == 2:
        r, v = jets[0, 1:] - y - h * dy, jets[1, 1:] - dy
        return np.stack([v / h**2 - 2 * r / h**3, 3 * r / h**2 - v / h, dy, y])
    ddy = jets[2, :-1]
    # what the Taylor polynomial of the left end lacks at the right end
    r, v, a = jets[0, 1:] - y - h * dy - h**2 / 2 * ddy, jets[1, 1:] - dy - h * ddy, jets[2, 1:] - ddy
    fifth = 6 * r / h**5 - 3 * v / h**4 + a / (2 * h**3)
    fourth = -15 * r / h**4 + 7 * v / h**3 - a / h**2
    third = 10 * r / h**3 - 4 * v / h**2 + a / (2 * h)
    return np.stack([fifth, fourth, third, ddy / 2, dy, y])


def bezier_points(length: Array, start: Array, end: Array) -> Array:
    """Return the Bézier points (*batch, 6, 3) of the quintics of a ``length`` (*batch,) from jets (*batch, 3, 3)."""
    h = length[..., None]
    (p0, v0, a0), (p1, v1, a1) = (np.moveaxis(jet, -2, 0) for jet in (start, end))
    # a Bézier curve's end derivatives in terms of its control points, solved for them
    first = [p0, p0 + h * v0 / 5, p0 + 2 * h * v0 / 5 + h**2 * a0 / 20]
    last = [p1 - 2 * h * v1 / 5 + h**2 * a1 / 20, p1 - h * v1 / 5, p1]
    return np.stack(first + last, axis=-2)


def horner(coefficients: Array, x: Array) -> tuple[Array, Array]:
    """Return value and slope at x of polynomials with ``coefficients`` (degree + 1, …) from the highest power down."""
    value, slope = coefficients[0], np.zeros_like(coefficients[0])
    for coefficient in coefficients[1:]:
        slope = slope * x + value
        value = value * x + coefficient
    return value, slope


def sample_adaptively(jet: Jet, s: Array, compared: Jet | None = None) -> tuple[Array, Array]:
    """Sample a function densely enough: halve cells between s (m,) until the polynomials reproduce it.

    Inside the cells values differ by 1e-11 of the extent of the function and slopes by 1e-9 of the largest, or for
    cubics by 1e-9 and 1e-6. By more only where the function is less smooth than the polynomials, in cells too narrow to
    matter, or where derivatives do not fit the function: 40 halvings and 2^12 cells are spent on such places.
    ``compared`` gives value and slope alone, as they are all that is looked at inside the cells.
    """
    jets, cells = jet(s), np.arange(len(s) - 1)
    room = _MOST_CELLS
    for _ in range(_HALVINGS):
        error = _error(compared or jet, s, jets, cells)
        coarse = cells[_select_worst(error, room)]
        if not coarse.size:
            break
        middle = 0.5 * (s[coarse] + s[coarse + 1])
        s, jets = np.insert(s, coarse + 1, middle), np.insert(jets, coarse + 1, jet(middle), axis=1)
        halves = coarse + np.arange(len(coarse))
        cells, room = np.stack([halves, halves + 1], axis=-1).reshape(-1), room - len(coarse)
    return s, jets


def _error(compared: Jet, s: Array, jets: Array, cells: NDArray[np.intp]) -> Array:
    """Return the error of the polynomials in the ``cells``, (len(cells),), as a multiple of what is allowed."""
    width = np.diff(s)[cells]
    beyond = _INSIDE[:, None] * width
    wanted = compared((s[cells] + beyond).reshape(-1))
    pieces = coefficients(s, jets)
    found = horner((pieces if len(cells) == pieces.shape[1] else pieces[:, cells])[:, None], beyond[..., None])
    size, slope, extent = np.abs(jets[0]).max(), np.abs(jets[1]).max(), np.ptp(jets[0], axis=0).max()
    values, slopes = _ALLOWED[len(jets)]
    allowed = values * extent + _ROUNDING * size, slopes * slope + _ROUNDING * size / width
    apart = (np.abs(found[k] - wanted[k].reshape(found[k].shape)).max(0).max(-1) for k in (0, 1))
    return np.max([a / np.maximum(b, np.finfo(float).tiny) for a, b in zip(apart, allowed, strict=True)], axis=0)


def _select_worst(error: Array, room: int) -> NDArray[np.intp]:
    """Return the cells with too large an error, or the worst of them where there is no ``room`` for all."""
    index = np.flatnonzero(error > 1)
    return np.sort(index[np.argsort(-error[index], kind="stable")[: max(room, 0)]])
