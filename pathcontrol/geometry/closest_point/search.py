"""The closest point of a curve: the global minimum, or the local one that continues from an earlier one.

The squared distance ½‖p(s) − x‖² has the derivative g(s) = (p(s) − x)ᵀp'(s). Its minima are the roots at which g rises:
bracketed between samples close enough to follow the curve's turns, and refined by a bracketing root finder.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array
from pathcontrol.geometry.closest_point.cells import Cells
from pathcontrol.geometry.closest_point.curve import Curve, Interval
from pathcontrol.geometry.closest_point.global_search import GlobalSearch
from pathcontrol.geometry.closest_point.local_search import (
    WINDOW,
    descend_by_cells,
    descend_by_newton,
    is_nearly_normal,
)


@dataclass(frozen=True)
class ClosestPoint:
    """Nearest points of ``curve`` for s in [lower, upper]; a closed curve repeats with the period upper − lower.

    The curve is cut once into cells over which its tangent turns by half a radian at most; k-d trees of them give those
    near a point, and a bound on the distance of each those that can hold the global minimum. Pieces of an eighth of a
    radian in which minima crowd, as near a centre of curvature, are divided by up to 16; see
    :class:`~pathcontrol.geometry.closest_point.cells.Cells` for what the cells may miss. The local search looks no
    farther than the distance falls, so it costs the same on a curve of any length.

    Attributes:
        curve: p(s) and its derivatives.
        lower: where the curve begins.
        upper: where it ends.
        closed: whether it repeats.
        knots: where its pieces meet, increasing, (K,); ``None`` for a curve that is all of one piece.
        kinks: where its tangent may jump, increasing, (J,); ``None`` for a smooth curve.
    """

    curve: Curve
    lower: float
    upper: float
    closed: bool
    knots: Array | None = None
    kinks: Array | None = None

    def __call__(self, x: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Return the parameter (*batch,) of the point nearest to x (*batch, m); see :meth:`PathTask.sigma_bar`."""
        x = as_array("x", x)
        flat = x.reshape(-1, x.shape[-1])
        if near is None:
            return self.anywhere(flat).reshape(x.shape[:-1])
        start = np.broadcast_to(as_array("near", near), x.shape[:-1]).reshape(-1)
        return self.along(flat, start).reshape(x.shape[:-1])

    def anywhere(self, x: Array) -> Array:
        """Return the global minimum for each row of x (N, m), in [lower, upper], or [lower, upper) when closed."""
        s = self._everywhere(x)
        return s - self._interval.lap(s) * self._interval.length

    def along(self, x: Array, near: Array) -> Array:
        """Return the local minimum downhill from ``near`` (N,), by Newton's method or, where that fails, cell by cell.

        Only where it is not close by, and ``near`` cannot be the nearest point of a moment ago, it is the global one.
        """
        s, found = descend_by_newton(self.curve, self._interval, x, near)
        if found.all():
            return s
        lost = np.flatnonzero(~found)
        x, near = x[lost], self._interval.inside(near[lost])
        downhill = descend_by_cells(self.curve, self._interval, self._cells, x, near)
        close = np.abs(downhill - near) <= WINDOW * self._interval.length
        s[lost] = downhill
        jump = ~close & ~(is_nearly_normal(self.curve, x, near) & np.isfinite(downhill))
        s[lost[jump]] = self._interval.unwrap(self.anywhere(x[jump]), near[jump])
        return s

    @cached_property
    def _interval(self) -> Interval:
        return Interval(self.lower, self.upper, self.closed)

    @cached_property
    def _cells(self) -> Cells:
        return Cells.cut(self.curve, self._interval, self.knots, self.kinks)

    @cached_property
    def _everywhere(self) -> GlobalSearch:
        return GlobalSearch(self.curve, self._cells)
