"""The local minimum of the distance downhill from a start: by Newton's method, or cell by cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.geometry.closest_point.cells import Cells
from pathcontrol.geometry.closest_point.curve import Curve, Interval

WINDOW = 1 / 8  # of the whole curve: what is close by
_TURN = 0.5  # rad, by which a step turns the tangent at most
_STEPS = 12
_CONVERGED = 1e-9  # rad of the curve
_SHARES = 4  # samples in a cell
_FIRST_SAMPLES = 16
_TINY = float(np.finfo(np.float64).tiny)


class Slope(NamedTuple):
    """Derivatives of the squared distance at s: g = (p − x)ᵀp', g' = ‖p'‖² + (p − x)ᵀp'', ‖p'‖², ‖p''‖ and ‖p − x‖."""

    slope: Array
    curvature: Array
    gradient: Array
    bend: Array
    distance: Array

    @classmethod
    def of(cls, curve: Curve, s: Array, x: Array) -> Slope:
        """Evaluate the derivatives at s (N,), for the rows of x (N, m)."""
        difference, dp = curve.p(s) - x, curve.dp(s)
        # without p'' this is the Gauss–Newton method
        ddp = np.zeros_like(dp) if curve.ddp is None else curve.ddp(s)
        gradient = _dot(dp, dp)
        curvature = gradient + _dot(difference, ddp)
        square = _dot(difference, difference)
        return cls(_dot(difference, dp), curvature, gradient, np.sqrt(_dot(ddp, ddp)), np.sqrt(square))

    def step(self, reach: Array) -> Array:
        """Return the step of Newton's method, damped where the distance is flat, and bounded."""
        longest = np.minimum(reach, _TURN * np.sqrt(self.gradient) / np.maximum(self.bend, _TINY))
        step = -self.slope / np.maximum(self.curvature, 0.1 * self.gradient)
        return np.minimum(np.maximum(step, -longest), longest)

    def minimum(self) -> Array:
        """Return the mask of the rows that are at a local minimum inside the curve."""
        return (np.abs(self.slope) <= _CONVERGED * np.sqrt(self.gradient)) & (self.curvature > 0)


def descend_by_newton(curve: Curve, interval: Interval, x: Array, near: Array) -> tuple[Array, Array]:
    """Run Newton's method on g from ``near`` (N,); return its end, and whether that is the local minimum downhill.

    A step turns the tangent by half a radian at most, so that it does not leave the branch. Newton's method has lost
    its way where g' < 0, on a hill that may hide a minimum nearer by, and beyond an arc of πD: from a point at the
    distance D from x all that lies downhill is within D of x, and an arc in there that does not wind is no longer.
    """
    s = near = interval.inside(near)
    here, moving = Slope.of(curve, s, x), np.ones(near.shape, dtype=bool)
    convex = moving
    reach = np.minimum(WINDOW * interval.length, np.pi * here.distance / np.sqrt(here.gradient) + _CONVERGED)
    for _ in range(_STEPS):
        convex = convex & (~moving | (here.curvature > 0))
        # rows that have arrived stay, so that no result depends on how long others take
        s, previous = np.where(moving, interval.inside(s + here.step(reach)), s), s
        moving &= np.abs(s - previous) > 1e-14 * (1 + np.abs(s))
        if not moving.any():
            break
        here = Slope.of(curve, s, x)
    held = interval.at_lower(s) & (here.slope > 0) | interval.at_upper(s) & (here.slope < 0)
    return s, (here.minimum() | held) & convex & (np.abs(s - near) <= reach)


def is_nearly_normal(curve: Curve, x: Array, near: Array) -> Array:
    """Return whether ``near`` (N,) can have been the nearest point a moment ago: x − p is normal within 30°."""
    difference, dp = curve.p(near) - x, curve.dp(near)
    return np.abs(_dot(difference, dp)) <= 0.5 * np.sqrt(_dot(difference, difference) * _dot(dp, dp))


def descend_by_cells(curve: Curve, interval: Interval, cells: Cells, x: Array, near: Array) -> Array:
    """Find the first local minimum downhill from ``near`` (N,), cell by cell; NaN if there is none in a lap.

    All of it is one branch: the distance falls all the way.
    """
    found, rows = np.full(len(x), np.nan), np.flatnonzero(np.isfinite(x).all(-1) & np.isfinite(near))
    begin, direction = cells.place(near, interval), np.where(curve.slope(near, x) > 0, -1.0, 1.0)
    done, ahead = 0, _FIRST_SAMPLES
    while rows.size and done < _SHARES * len(cells.sag):
        ways = direction[rows, None] * np.arange(done, done + ahead + 1) / _SHARES
        s = cells.parameter(begin[rows, None] + ways, interval)
        if done == 0:
            s[:, 0] = near[rows]  # where the slope is known to fall, rounding or not
        rising = direction[rows, None] * curve.slope(s[:, 1:], x[rows, None]) > 0
        hit = rising.any(1)
        if hit.any():
            found[rows[hit]] = _first_root(curve, x[rows[hit]], s[hit], rising[hit])
        ended = ~hit & (interval.at_lower(s[:, -1]) | interval.at_upper(s[:, -1]))
        found[rows[ended]] = s[ended, -1]
        rows = rows[~hit & ~ended]
        done, ahead = done + ahead, 2 * ahead
    return found


def _first_root(curve: Curve, x: Array, s: Array, rising: Array) -> Array:
    """Return the root of g before the first of the samples s (N, K + 1) where the distance is ``rising`` (N, K)."""
    row, first = np.arange(len(x)), rising.argmax(1)
    return curve.root(x, s[row, first], s[row, first + 1])


def _dot(a: Array, b: Array) -> Array:
    """Return the inner products of rows."""
    return np.vecdot(a, b)
