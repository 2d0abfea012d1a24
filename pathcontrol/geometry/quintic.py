"""Quintic curves in space by Hermite interpolation between knots with given p, p' and p''."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BPoly, PPoly

from pathcontrol._arrays import Array


class CurvePoint(NamedTuple):
    """A curve at s: position [m] and its first two derivatives with respect to s, each (*batch, 3)."""

    p: Array
    dp: Array
    ddp: Array


def quintic_spline(s: Array, values: Array) -> PPoly:
    """Return the quintic spline with p, p' and p'', ``values`` (k + 1, 3, 3), at the knots s (k + 1,)."""
    points = quintic_points(np.diff(s), values[:-1], values[1:])
    return PPoly.from_bernstein_basis(BPoly(np.moveaxis(points, -2, 0), s))


def quintic_points(length: Array, start: Array, end: Array) -> Array:
    """Return the Bézier points (*batch, 6, 3) of quintics of a ``length`` (*batch,) from p, p', p'' (*batch, 3, 3)."""
    h = length[..., None]
    (p0, v0, a0), (p1, v1, a1) = (np.moveaxis(values, -2, 0) for values in (start, end))
    # a Bézier curve's end derivatives in terms of its control points, solved for them
    first = [p0, p0 + h * v0 / 5, p0 + 2 * h * v0 / 5 + h**2 * a0 / 20]
    last = [p1 - 2 * h * v1 / 5 + h**2 * a1 / 20, p1 - h * v1 / 5, p1]
    return np.stack(first + last, axis=-2)
