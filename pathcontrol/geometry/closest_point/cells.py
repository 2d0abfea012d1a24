"""A subdivision of a curve into cells, over each of which its tangent turns little.

Each cell is looked at once more inside, at an irregular place, and is cut there where the tangent turns too much on
the way from end to end. A curve that says where its pieces meet begins with these pieces, each of which is simple. Any
other begins with 512 equal cells, and the neighbours of a cell that turns too much are cut too, since a detail that
repeats may hide from one cell but not from several. What is smaller than a cell and does not show in its tangents
there is not resolved, nor is what asks for more than 2^19 cells; a curve that turns so much over a quarter of its
parameter is refused. Where the curve says that its tangent may jump, a cell of next to no length lies across the jump,
so that no other cell has to be cut for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.geometry.closest_point.curve import Curve, Interval

#: numbers whose squares, and sums of many of these, are finite
FARTHEST = 1e150
_MAX_TURN = 0.5  # rad over a cell
_FIRST_CELLS, _MAX_CELLS = 512, 1 << 19
_NEIGHBOURS = 4  # cut with a cell on either side
_NARROWEST = 1e-10  # of the whole curve
_KINK = 1e-12  # of the whole curve, on either side of a jump of the tangent
_LOST = 2.0  # rad over a cell that tell nothing of the way in between
_ROUNDING = 1e-13  # of the largest coordinate
_GOLDEN = (5**0.5 - 1) / 2  # spreads the places inside the cells irregularly, so that no period of the curve meets them
_BLOCK = 1 << 15  # parameters evaluated at once


class Cells(NamedTuple):
    """K cells of a curve: their ends, and bounds on what the curve does in between.

    Attributes:
        s: parameters of the ends, increasing, (K + 1,).
        p: the curve there, (K + 1, m).
        middle: a point of the curve in each cell, (K, m).
        radius: bound on how far the curve in the cell is from there, (K,).
        sag: bound on the distance between the curve in the cell and its chord, (K,).
        turn: of the tangent in the cell [rad], (K,).
    """

    s: Array
    p: Array
    middle: Array
    radius: Array
    sag: Array
    turn: Array

    @classmethod
    def cut(cls, curve: Curve, interval: Interval, knots: Array | None = None, kinks: Array | None = None) -> Cells:
        """Cut ``curve`` into cells; its pieces meet at ``knots`` and its tangent jumps at ``kinks``, if it has any.

        Raises:
            TaskError: the curve is not finite somewhere, or too far away for its square to be, or it turns so much that
                the largest number of cells does not follow it.
        """
        ends = _first_ends(interval, knots)
        if kinks is not None:
            ends = np.union1d(ends, _kink_ends(kinks, interval))
        s, turn = _refine(curve, ends, 0 if knots is not None else _NEIGHBOURS)
        p, middle = _evaluate_points(curve, s), _evaluate_points(curve, (s[:-1] + s[1:]) / 2)
        # an arc whose tangent stays within ±φ/2 of a direction is no longer than its chord over cos φ/2
        stretch = 1 / np.cos(np.minimum(turn, 2.0) / 2)
        before, after = (np.linalg.norm(middle - end, axis=-1) * stretch for end in (p[:-1], p[1:]))
        sag = 0.5 * (before + after) * np.sin(np.minimum(turn, np.pi / 2))
        cells = cls(s, p, middle, np.maximum(before, after), sag, turn)
        if knots is None and len(turn) >= _MAX_CELLS:
            cells._check_resolved()
        return cells

    @property
    def rounding(self) -> float:
        """The distance below which points of the curve are the same but for rounding."""
        return _ROUNDING * float(np.abs(self.p).max())

    def _check_resolved(self) -> None:
        """Check that the cells follow the tangent over three quarters of the parameter at least."""
        lost = np.flatnonzero((self.turn > _LOST) & (self.radius > self.rounding))
        if (self.s[lost + 1] - self.s[lost]).sum() > 0.25 * (self.s[-1] - self.s[0]):
            first, last = self.s[lost[0]], self.s[lost[-1] + 1]
            raise TaskError(
                f"the path turns by more than {self.turn.sum():.3g} rad on the way from s = {first:g} to {last:g}, "
                f"and {_MAX_CELLS} cells do not follow it, expected a tangent that goes on from cell to cell; "
                "look for noise in the path or its derivatives, for other units, and for a frequency that is too high",
                value=self.turn.sum(),
                s=float(first),
            )

    def place(self, s: Array, interval: Interval) -> Array:
        """Return the position of ``s`` (*batch,) counted in cells, laps included: i + u at the share u of cell i."""
        lap = interval.lap(s)
        s = s - lap * interval.length
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.sag) - 1)
        return lap * len(self.sag) + i + (s - self.s[i]) / (self.s[i + 1] - self.s[i])

    def parameter(self, place: Array, interval: Interval) -> Array:
        """Return the parameter at a place (*batch,): the inverse of :meth:`place`, clipped to an open curve."""
        count = len(self.sag)
        lap = np.floor(place / count) if interval.closed else np.zeros_like(place)
        place = np.clip(place - lap * count, 0, count)
        i = np.minimum(place.astype(int), count - 1)
        return lap * interval.length + self.s[i] + (place - i) * (self.s[i + 1] - self.s[i])


def _first_ends(interval: Interval, knots: Array | None) -> Array:
    """Return the ends of the first cells: the knots, or else equidistant parameters."""
    if knots is None:
        return np.linspace(interval.lower, interval.upper, _FIRST_CELLS + 1)
    inside = knots[(knots > interval.lower) & (knots < interval.upper)]
    return np.unique(np.concatenate([[interval.lower], inside, [interval.upper]]))


def _kink_ends(kinks: Array, interval: Interval) -> Array:
    """Return the ends of the narrow cells across ``kinks``, as far as they are inside the interval."""
    margin = _KINK * interval.length
    ends = np.concatenate([kinks - margin, kinks + margin])
    return ends[(ends > interval.lower) & (ends < interval.upper)]


def _refine(curve: Curve, s: Array, neighbours: int) -> tuple[Array, Array]:
    """Halve cells until the tangent turns little over each; return their ends and the turn [rad] in each."""
    tangent, turn = _unit_tangents(curve, s), np.zeros(len(s) - 1)
    narrowest, cells = _NARROWEST * (s[-1] - s[0]), np.arange(len(s) - 1)
    while cells.size:
        share = 0.3 + 0.4 * np.modf(_GOLDEN * np.arange(1, len(cells) + 1))[0]
        middle = s[cells] + share * (s[cells + 1] - s[cells])
        between = _unit_tangents(curve, middle)
        turn[cells] = _angle(tangent[cells], between) + _angle(between, tangent[cells + 1])
        wide = s[cells + 1] - s[cells] > narrowest
        chosen = _widen((turn[cells] > _MAX_TURN) & wide, neighbours) & wide
        chosen = _select_worst(chosen, turn[cells], _MAX_CELLS - len(turn))
        cut = cells[chosen]
        s, tangent = np.insert(s, cut + 1, middle[chosen]), np.insert(tangent, cut + 1, between[chosen], axis=0)
        turn = np.insert(turn, cut + 1, turn[cut])
        halves = cut + np.arange(len(cut))
        cells = np.stack([halves, halves + 1], axis=-1).reshape(-1)
    return s, turn


def _widen(chosen: Array, neighbours: int) -> Array:
    """Return the mask ``chosen`` extended by ``neighbours`` to either side."""
    return np.convolve(chosen, np.ones(2 * neighbours + 1), "same")[: len(chosen)] > 0.5 if neighbours else chosen


def _select_worst(chosen: Array, turn: Array, room: int) -> Array:
    """Return the indices of ``chosen``, or of those that turn most where there is no ``room`` for all."""
    index = np.flatnonzero(chosen)
    return np.sort(index[np.argsort(-turn[index], kind="stable")[: max(room, 0)]])


def _evaluate_points(curve: Curve, s: Array) -> Array:
    """Evaluate the curve, and check that it is finite."""
    p = _evaluate_by_blocks(curve.p, s)
    if not (known := (np.abs(p) < FARTHEST).all(-1)).all():
        i = int(np.argmin(known))
        raise TaskError(
            f"the path is {p[i].tolist()} at s = {s[i]:g}, expected numbers below {FARTHEST:g} on the whole domain",
            value=p[i],
            limit=FARTHEST,
            s=float(s[i]),
        )
    return p


def _unit_tangents(curve: Curve, s: Array) -> Array:
    """Return the unit tangents."""
    dp = _evaluate_by_blocks(curve.dp, s)
    largest = np.abs(dp).max(-1)
    extreme = ~(largest < FARTHEST) | ((largest > 0) & (largest < 1 / FARTHEST))
    if extreme.any():  # their squares are not finite, or zero
        dp = np.nan_to_num(dp)
        dp[extreme] /= np.maximum(np.abs(dp[extreme]).max(-1, keepdims=True), np.finfo(float).tiny)
    return dp / np.maximum(np.linalg.norm(dp, axis=-1, keepdims=True), np.finfo(float).tiny)


def _evaluate_by_blocks(function: Callable[[Array], Array], s: Array) -> Array:
    """Evaluate a function of s block by block, to bound the memory."""
    return np.concatenate([function(s[i : i + _BLOCK]) for i in range(0, len(s), _BLOCK)])


def _angle(a: Array, b: Array) -> Array:
    """Return the angle between unit vectors [rad], (*batch,)."""
    return 2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=-1) / 2, 1.0))
