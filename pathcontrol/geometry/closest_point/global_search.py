"""The global minimum of the distance: cells that can hold it by a bound, and the roots of the slope in them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.geometry.closest_point.cells import FARTHEST, Cells
from pathcontrol.geometry.closest_point.curve import Curve

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_TURN = 1 / 8  # rad over a piece of a cell, which holds one minimum at most but near a centre of curvature
_SIZES, _RATIO = 6, 4.0  # how many groups of cells by size, and their sizes
_BLOCK = 1 << 18  # pairs of a point and a cell held at once
_PIECES = 1 << 20  # pieces of cells searched at once
_DIVISIONS = 2  # by four, of pieces that hold several extrema
_NEAR = 0.25  # of the mean of g': nearer to zero its parabola may be wrong about the sign
_WORTH = 1e-9  # of the squared distance; less is not gained by a division
_TIE = 1e-12  # by how much a sample must be nearer than a root: not by rounding alone


class GlobalSearch:
    """A search for the globally nearest point of a curve that is cut into cells.

    The nearest point is in a cell whose middle is no farther than the nearest of all middles plus the radius of the
    cell. Cells of a size have a tree of their own, so that a few large ones do not widen the look at many small ones.
    """

    def __init__(self, curve: Curve, cells: Cells) -> None:
        self._curve, self._cells = curve, cells
        self._groups = list(_group_by_size(cells))
        self._rounding = cells.rounding
        turn = np.where(cells.radius > self._rounding, cells.turn, 0.0)  # the turns of a point are rounding errors
        self._pieces = np.maximum(np.ceil(turn / _TURN), 1).astype(int)

    def __call__(self, x: Array) -> Array:
        """Return the parameter (N,) of the point nearest to each row of x (N, m); NaN where ‖x‖² overflows."""
        nearest, known = np.full(len(x), np.nan), np.flatnonzero((np.abs(x) < FARTHEST).all(-1))
        x = x[known]
        bound = np.min([group.tree.query(x)[0] for group in self._groups], axis=0) * (1 + _TIE) + self._rounding
        for rows in self._split_rows(x, bound):
            nearest[known[rows]] = self._search(x[rows], bound[rows])
        return nearest

    def _split_rows(self, x: Array, bound: Array) -> Iterator[slice]:
        """Yield slices of rows whose candidate cells fit into memory together."""
        if len(x) < 2:
            yield slice(0, len(x))
            return
        count = sum(g.tree.query_ball_point(x, bound + g.radius, return_length=True) for g in self._groups)
        edges = np.flatnonzero(np.diff(np.cumsum(count) // _BLOCK, prepend=-1, append=-1))
        yield from map(slice, edges[:-1], edges[1:])

    def _search(self, x: Array, bound: Array) -> Array:
        """Return the parameter (N,) of the nearest point among the candidate cells of each row."""
        row, cell, least = self._narrow_candidates(x, *self._candidates(x, bound))
        nearest, distance = np.empty(len(x)), np.full(len(x), np.inf)
        for pairs in self._split_pairs(cell, least):
            pairs = pairs[least[pairs] <= distance[row[pairs]]]
            if pairs.size:
                rows, closest, s = self._search_cells(x, row[pairs], cell[pairs])
                closer = closest < distance[rows]
                nearest[rows[closer]], distance[rows[closer]] = s[closer], closest[closer]
        return nearest

    def _split_pairs(self, cell: Array, least: Array) -> Iterator[Array]:
        """Yield the indices of pairs whose pieces fit into memory together, those first that may be nearest."""
        count = self._pieces[cell]
        if count.sum() <= _PIECES:
            yield np.arange(len(cell))
            return
        order = np.argsort(least, kind="stable")
        edges = np.flatnonzero(np.diff(np.cumsum(count[order]) // _PIECES, prepend=-1, append=-1))
        yield from np.split(order, edges[1:-1])

    def _search_cells(self, x: Array, row: Array, cell: Array) -> tuple[Array, Array, Array]:
        """Return the rows that occur in the pairs, with the distance to and the parameter of their nearest point."""
        row, s, slope, distance = self._evaluate(x, *self._divide(row, cell))
        i = np.flatnonzero((slope[0] < 0) & (slope[1] > 0))
        root = self._curve.root(x[row[i]], *s[:, i]) if i.size else np.empty(0)
        # the ends of an open curve, and ends of pieces that are roots themselves
        every, best = np.arange(len(row)), distance.argmin(0)
        return _select_nearest(
            np.concatenate([row[i], row]),
            np.concatenate([np.linalg.norm(self._curve.p(root) - x[row[i]], axis=-1), distance[best, every]]),
            np.concatenate([root, s[best, every]]),
            len(root),
        )

    def _evaluate(self, x: Array, row: Array, lower: Array, upper: Array) -> tuple[Array, ...]:
        """Return the row (M,) of pieces, and s, g and the distance at their ends, (2, M) each.

        Pieces that may hold a minimum and a maximum beside each other, as near a centre of curvature of the curve, are
        divided, and their quarters once more, so that the two are told apart.
        """
        clear: list[tuple[Array, ...]] = []
        for division in range(_DIVISIONS + 1):
            s = np.stack([lower, upper])
            difference, dp = self._curve.p(s) - x[row], self._curve.dp(s)
            slope, distance = np.vecdot(difference, dp), np.linalg.norm(difference, axis=-1)
            crowded = self._find_crowded(s, difference, dp, slope, division) & (division < _DIVISIONS)
            clear.append(tuple(part[..., ~crowded] for part in (row, s, slope, distance)))
            if not crowded.any():
                break
            row, lower, upper = _quarter(row[crowded], lower[crowded], upper[crowded])
        return tuple(np.concatenate(parts, axis=-1) for parts in zip(*clear, strict=True))

    def _find_crowded(self, s: Array, difference: Array, dp: Array, slope: Array, division: int) -> NDArray[np.bool_]:
        """Return the mask (M,) of pieces in which g may have more roots than its signs at the ends tell.

        That is where both signs are the same and g in between is not of it, or where they differ and g' comes near to
        zero; a curve without p'' is divided there once. Slopes that are next to nothing tell nothing.
        """
        # derivatives by the share of a piece, whose products do not overflow
        h, chord = s[1] - s[0], difference[1] - difference[0]
        g = slope * h
        away = np.linalg.norm(difference[0], axis=-1)
        least = (_WORTH * away + self._rounding) * away
        # the mean of g is that of (½‖p − x‖²)', without cancellation
        crowded = _crosses(g[0], g[1], 0.5 * np.vecdot(chord, difference[0] + difference[1]), least)
        i = np.flatnonzero((np.sign(g[0]) * np.sign(g[1]) < 0) & (np.abs(g).max(0) > least))
        if self._curve.ddp is None:
            crowded[i] = division == 0
        elif i.size:
            h, dp, ddp = h[i, None], dp[:, i], self._curve.ddp(s[:, i])
            bend = np.vecdot(h * dp, h * dp) + np.vecdot(difference[:, i], h * h * ddp)
            mean = g[1, i] - g[0, i]
            against = (bend * np.sign(mean)).min(0) <= 0
            crowded[i] = against | _crosses(bend[0], bend[1], mean, -_NEAR * np.abs(mean))
        return crowded

    def _divide(self, row: Array, cell: Array) -> tuple[Array, Array, Array]:
        """Divide the cells into pieces; return (row, lower end, upper end) of each piece."""
        count, s = self._pieces[cell], self._cells.s
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        row, cell, count = (np.repeat(a, count) for a in (row, cell, count))
        lower, length = s[cell], s[cell + 1] - s[cell]
        return row, lower + number / count * length, lower + (number + 1) / count * length

    def _candidates(self, x: Array, bound: Array) -> tuple[Array, Array]:
        """Return the cells that may come within ``bound`` (N,) of x, as pairs (row, cell), sorted by row."""
        found = [group.within(x, bound) for group in self._groups]
        row, cell = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.argsort(row, kind="stable")
        return row[order], cell[order]

    def _narrow_candidates(self, x: Array, row: Array, cell: Array) -> tuple[Array, Array, Array]:
        """Return the pairs whose chord, less the sag, is no farther than any other chord plus its sag, and the former.

        Chord less sag is a lower bound (M,) on the distance of each pair (row, cell).
        """
        cells = self._cells
        start, chord = cells.p[cell] - x[row], cells.p[cell + 1] - cells.p[cell]
        square = np.maximum((chord * chord).sum(-1), np.finfo(float).tiny)
        share = np.clip(-(start * chord).sum(-1) / square, 0.0, 1.0)
        distance = np.linalg.norm(start + share[:, None] * chord, axis=-1)
        sag = cells.sag[cell] + _TIE * distance + self._rounding
        bound = np.minimum.reduceat(distance + sag, np.searchsorted(row, np.arange(len(x))))
        least = distance - sag
        near = least <= bound[row]
        return row[near], cell[near], least[near]


class _Group(NamedTuple):
    """Cells of similar size: their numbers, the largest radius, and a k-d tree of their middles."""

    cell: Array
    radius: float
    tree: cKDTree

    def within(self, x: Array, bound: Array) -> tuple[Array, Array]:
        """Return the pairs (row, cell), sorted by row, of cells that may come within ``bound`` (N,) of x (N, m)."""
        found = self.tree.query_ball_point(x, bound + self.radius)
        count = np.fromiter(map(len, found), int, len(x))
        index = np.fromiter(chain.from_iterable(found), int, count.sum())
        return np.repeat(np.arange(len(x)), count), self.cell[index]


def _crosses(first: Array, last: Array, mean: Array, least: Array) -> NDArray[np.bool_]:
    """Return the mask of functions with one sign at both ends that seem to be beyond zero by ``least`` in between.

    They are taken for the parabola a + bt + ct², t = 0 … 1, with the same values at the ends and the same mean.
    """
    # in units of the largest, so that no square overflows
    size = np.maximum.reduce([np.abs(first), np.abs(last), np.abs(mean), np.abs(least)])
    size = np.copysign(np.maximum(size, np.finfo(float).tiny), first)
    first, last, mean, least = first / size, last / size, mean / size, least / np.abs(size)
    middle = 1.5 * mean - 0.25 * (first + last)
    b, c = 4 * middle - 3 * first - last, 2 * (first + last - 2 * middle)
    return (last > 0) & (b < 0) & (-b < 2 * c) & (b * b > 4 * c * (first + least))


def _quarter(row: Array, lower: Array, upper: Array) -> tuple[Array, Array, Array]:
    """Divide pieces (M,) into four each; return (row, lower end, upper end), (4M,) each."""
    edges = lower + np.linspace(0, 1, 5)[:, None] * (upper - lower)
    edges[-1] = upper
    return np.tile(row, 4), edges[:-1].ravel(), edges[1:].ravel()


def _group_by_size(cells: Cells) -> Iterator[_Group]:
    """Group the cells by size."""
    from scipy.spatial import cKDTree  # loads all of scipy.spatial, which few runs need

    largest = cells.radius.max()
    size = np.log(largest / np.maximum(cells.radius, np.finfo(float).tiny)) / np.log(_RATIO)
    size = np.minimum(size, _SIZES - 1).astype(int)
    for i in np.unique(size):
        cell = np.flatnonzero(size == i)
        yield _Group(cell, float(cells.radius[cell].max()), cKDTree(cells.middle[cell], balanced_tree=False))


def _select_nearest(row: Array, distance: Array, s: Array, roots: int) -> tuple[Array, Array, Array]:
    """Return each row, its least ``distance`` and the ``s`` of it; a sample beats a root by more than rounding only."""
    distance[roots:] *= 1 + _TIE
    order = np.lexsort((distance, row))
    rows, first = np.unique(row[order], return_index=True)
    return rows, distance[order[first]], s[order[first]]
