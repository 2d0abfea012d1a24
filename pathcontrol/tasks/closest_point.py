"""The point of a curve nearest to a given point: all over the curve, or along the branch one is on.

The squared distance ½‖p(s) − x‖² has the derivative g(s) = (p(s) − x)ᵀp'(s), whose sign changes are bracketed on a
grid fine enough to follow the curve's turns, and refined by a bracketing root finder. A bound on the distance within
a cell of the grid tells which brackets can hold the global minimum. The grid is refined until the tangent turns little
over every cell; details smaller than 1/65536 of the curve are not resolved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize.elementwise import find_root

from pathcontrol._arrays import Array, as_array

_MAX_TURN = 0.15  # rad over a cell of the grid
_MIN_CELLS, _MAX_CELLS = 64, 1 << 16
_REACH = 1 / 8  # of the whole curve: how far the local search may go from where it began
_GOLDEN = (5**0.5 - 1) / 2  # spreads the points inside the cells irregularly, so that no period of the curve meets them
_CHUNK = 1 << 22  # distances held at once
_NEWTON_STEPS = 12


class Curve(NamedTuple):
    """A curve p(s) in R^m with its derivatives; each maps (*batch,) to (*batch, m). p'' serves the local search."""

    p: Callable[[Array], Array]
    dp: Callable[[Array], Array]
    ddp: Callable[[Array], Array] | None = None


@dataclass(frozen=True)
class ClosestPoint:
    """Nearest points of ``curve`` for s in [lower, upper]; a closed curve repeats with the period upper − lower."""

    curve: Curve
    lower: float
    upper: float
    closed: bool

    def __call__(self, x: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Parameter (*batch,) of the point nearest to x (*batch, m); see :meth:`PathTask.sigma_bar`."""
        x = as_array("x", x)
        flat = x.reshape(-1, x.shape[-1])
        if near is None:
            return self.anywhere(flat).reshape(x.shape[:-1])
        start = np.broadcast_to(as_array("near", near), x.shape[:-1]).reshape(-1)
        return self.along(flat, start).reshape(x.shape[:-1])

    def anywhere(self, x: Array) -> Array:
        """Global minimum for each row of x (N, m), in [lower, upper], or [lower, upper) when closed."""
        rows = max(1, _CHUNK // len(self._grid.s))
        parts = [self._search(x[i : i + rows]) for i in range(0, len(x), rows)]
        s = np.concatenate(parts) if parts else np.empty(0)
        return self.lower + np.mod(s - self.lower, self.upper - self.lower) if self.closed else s

    def along(self, x: Array, near: Array) -> Array:
        """Local minimum reached from ``near`` (N,) by Newton's method; the global one where there is none close by."""
        s, trusted = self._descend(x, near)
        if not trusted.all():
            lost = ~trusted
            found = self.anywhere(x[lost])
            s[lost] = self.unwrap(found, near[lost])
        return s

    def unwrap(self, s: Array, near: Array) -> Array:
        """``s`` shifted by whole periods to lie nearest to ``near``."""
        if not self.closed:
            return s
        period = self.upper - self.lower
        return s + period * np.round((near - s) / period)

    # --- the local search -----------------------------------------------------------------------------------

    def _descend(self, x: Array, near: Array) -> tuple[Array, Array]:
        """Newton's method on g from ``near``; also says which results are local minima within reach of ``near``.

        A step turns the tangent by half a radian at most, so that it does not leave the branch.
        """
        reach = _REACH * (self.upper - self.lower)
        s, moving = near.copy(), np.ones(near.shape, dtype=bool)
        for _ in range(_NEWTON_STEPS):
            slope, curvature, gradient, bend = self._slope(s, x)
            step = -slope / np.where(curvature > 0.1 * gradient, curvature, gradient)
            longest = np.minimum(reach, 0.5 * np.sqrt(gradient) / np.maximum(bend, np.finfo(float).tiny))
            # rows that have arrived stay, so that no result depends on how long others take
            s, previous = np.where(moving, self._inside(s + np.clip(step, -longest, longest)), s), s
            moving &= np.abs(s - previous) > 1e-14 * (1 + np.abs(s))
            if not moving.any():
                break
        slope, curvature, gradient, _ = self._slope(s, x)
        at_end = ~np.array(self.closed) & ((s <= self.lower) & (slope > 0) | (s >= self.upper) & (slope < 0))
        stationary = np.abs(slope) <= 1e-9 * gradient * (self.upper - self.lower)
        return s, (stationary & (curvature > 0) | at_end) & (np.abs(s - near) <= reach)

    def _slope(self, s: Array, x: Array) -> tuple[Array, Array, Array, Array]:
        """g = (p − x)ᵀp', its derivative ‖p'‖² + (p − x)ᵀp'', ‖p'‖², and ‖p''‖."""
        difference, dp = self.curve.p(s) - x, self.curve.dp(s)
        # without p'' this is the Gauss–Newton method
        ddp = np.zeros_like(dp) if self.curve.ddp is None else self.curve.ddp(s)
        gradient = (dp * dp).sum(-1)
        curvature = gradient + (difference * ddp).sum(-1)
        return (difference * dp).sum(-1), curvature, gradient, np.linalg.norm(ddp, axis=-1)

    def _inside(self, s: Array) -> Array:
        return s if self.closed else np.clip(s, self.lower, self.upper)

    # --- the global search ----------------------------------------------------------------------------------

    @cached_property
    def _grid(self) -> _Grid:
        cells, fine_enough = _MIN_CELLS, 0
        while True:
            grid = _Grid.sample(self.curve, np.linspace(self.lower, self.upper, cells + 1))
            # twice in a row: a detail may hide between the samples of one grid
            fine_enough = fine_enough + 1 if grid.turn <= _MAX_TURN else 0
            if fine_enough == 2 or cells >= _MAX_CELLS:
                return grid
            cells *= 2

    def _search(self, x: Array) -> Array:
        grid = self._grid
        distance = np.sqrt(np.maximum(_squared_distances(x, grid.p), 0.0))
        row, node = np.nonzero(self._candidates(distance))
        refined = self._refine(x, row, node)
        exact = np.linalg.norm(self.curve.p(refined) - x[row], axis=-1)
        # rows are sorted: the best of each row's candidates comes first after this
        order = np.lexsort((exact, row))
        found, first = np.unique(row[order], return_index=True)
        nearest = np.full(len(x), np.nan)  # a row with a NaN in it has no candidates
        nearest[found] = refined[order[first]]
        return nearest

    def _candidates(self, distance: Array) -> Array:
        """Grid points that are nearer than their neighbours and may be next to the global minimum."""
        before, after = np.roll(distance, 1, axis=1), np.roll(distance, -1, axis=1)
        if self.closed:  # first and last grid point are the same point
            before[:, 0], after[:, -1] = distance[:, -2], np.inf
        else:
            before[:, 0], after[:, -1] = np.inf, np.inf
        slack = self._grid.longest * (1 + 1e-6) + 1e-7 * (1 + distance.min(1, keepdims=True))
        near_enough = distance <= distance.min(1, keepdims=True) + slack
        return (distance <= before) & (distance <= after) & near_enough

    def _refine(self, x: Array, row: Array, node: Array) -> Array:
        """Root of g beside each candidate grid point; the grid point itself where g does not change sign."""
        s = self._grid.s
        step = s[1] - s[0]
        here = self._gradient(s[node], x[row])
        lower = np.where(here > 0, s[node] - step, s[node])
        upper = np.where(here > 0, s[node], s[node] + step)
        lower, upper = self._inside(lower), self._inside(upper)
        bracketed = self._gradient(lower, x[row]) * self._gradient(upper, x[row]) < 0
        refined = s[node].copy()
        if bracketed.any():
            keep = row[bracketed]
            found = find_root(lambda t, r: self._gradient(t, x[r]), (lower[bracketed], upper[bracketed]), args=(keep,))
            refined[bracketed] = found.x
        return refined

    def _gradient(self, s: Array, x: Array) -> Array:
        return ((self.curve.p(s) - x) * self.curve.dp(s)).sum(-1)


class _Grid(NamedTuple):
    """Samples of a curve, with what is needed to bound distances between them."""

    s: Array
    p: Array
    longest: float  # the longest cell [same unit as p]
    turn: float  # the largest turn of the tangent over a cell, by way of a point inside it [rad]

    @classmethod
    def sample(cls, curve: Curve, s: Array) -> _Grid:
        p, dp = curve.p(s), curve.dp(s)
        speed = np.linalg.norm(dp, axis=-1, keepdims=True)
        tangent = _unit(dp)
        cell = float(s[1] - s[0])
        inside = s[:-1] + cell * (0.2 + 0.6 * np.modf(_GOLDEN * np.arange(1, len(s)))[0])
        between = _unit(curve.dp(inside))
        turn = float((_angle(tangent[:-1], between) + _angle(between, tangent[1:])).max())
        longest = max(float(np.linalg.norm(np.diff(p, axis=0), axis=-1).max()), float(speed.max()) * cell)
        return cls(s, p, longest, turn)


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny)


def _angle(a: Array, b: Array) -> Array:
    """Angle between unit vectors [rad], (*batch,)."""
    return 2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=-1) / 2, 1.0))


def _squared_distances(x: Array, p: Array) -> Array:
    """‖x_i − p_j‖², (N, K), by one matrix product; accurate enough to choose brackets."""
    return (x * x).sum(-1)[:, None] - 2 * x @ p.T + (p * p).sum(-1)
