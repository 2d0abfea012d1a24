"""Segments by arc length, and the Hermite data (p, p', p'') from which smooth curves are made."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.curve import CurvePoint
from pathcontrol.toolpaths.segments import Polyline, Segment

_TABLE = 128  # pieces of the table of arc lengths
_NEWTON_STEPS = 6
_ACCURACY = 1e-9  # m, between a segment and the quintics that stand for it
_MOST_PIECES = 1 << 14


class Knots(NamedTuple):
    """Hermite data along a stretch: s [m] from its beginning, p, dp/ds and d²p/ds², (k,) and (k, 3)."""

    s: Array
    p: Array
    dp: Array
    ddp: Array


@dataclass(frozen=True, eq=False)
class ByLength:
    """A curved segment with its arc length [m] for parameter."""

    segment: Segment

    def at(self, length: ArrayLike) -> CurvePoint:
        """Position and derivatives with respect to arc length, at ``length`` (*batch,) from the start [m]."""
        u = self.parameter(np.asarray(length, dtype=np.float64))
        first, second = self.segment.derivative(u), self.segment.derivative(u, 2)
        speed = np.linalg.norm(first, axis=-1, keepdims=True)
        tangent = first / speed
        along = (second * tangent).sum(-1, keepdims=True)
        return CurvePoint(self.segment.point(u), tangent, (second - along * tangent) / speed**2)

    def parameter(self, length: Array) -> Array:
        """The parameter u at which the segment is ``length`` long, by Newton's method from a table."""
        u_table, lengths = self._table
        cell = np.clip(np.searchsorted(lengths, length, side="right") - 1, 0, _TABLE - 1)
        left, width = u_table[cell], u_table[1] - u_table[0]
        wanted = length - lengths[cell]
        u = left + width * wanted / (lengths[cell + 1] - lengths[cell])
        for _ in range(_NEWTON_STEPS):
            u = u - (self._partial(left, u) - wanted) / self.segment.speed(u)
        return np.clip(u, 0.0, 1.0)

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        u = np.linspace(0.0, 1.0, _TABLE + 1)
        return u, self.segment.arc_length(u)

    def _partial(self, left: Array, u: Array) -> Array:
        """Arc length from left to u, both (*batch,), by Gauss–Legendre quadrature."""
        step = u - left
        return (self.segment.speed(left[..., None] + step[..., None] * _NODES) * _WEIGHTS).sum(-1) * step


_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(12)[0] + 1) / 2, np.polynomial.legendre.leggauss(12)[1] / 2


def curved_knots(segment: Segment, start: float, end: float) -> Knots:
    """Hermite data of a curved segment between the arc lengths ``start`` and ``end`` [m], accurate to 1 nm."""
    curve, pieces = ByLength(segment), 4
    while True:
        s = np.linspace(start, end, pieces + 1)
        knots = Knots(s - start, *curve.at(s))
        if _middle_error(curve, s, knots) <= _ACCURACY:
            return knots
        if pieces >= _MOST_PIECES:
            raise InputError(
                f"a {type(segment).__name__} of length {segment.length:g} m bends too sharply to be followed to 1 nm: "
                "it has a cusp or a kink inside; split it there"
            )
        pieces *= 2


def _middle_error(curve: ByLength, s: Array, knots: Knots) -> float:
    """Largest distance between quintic and segment half-way between knots."""
    h = np.diff(s)[:, None]
    middle = 0.5 * (knots.p[:-1] + knots.p[1:]) + 5 / 32 * h * (knots.dp[:-1] - knots.dp[1:])
    middle += h**2 / 64 * (knots.ddp[:-1] + knots.ddp[1:])
    return float(np.linalg.norm(curve.at(0.5 * (s[:-1] + s[1:])).p - middle, axis=-1).max())


def regular(segment: Segment, tolerance: float) -> Segment:
    """The segment itself, or where its parameter stands still (a cusp) a polyline within ``tolerance`` [m] of it."""
    if isinstance(segment, Polyline) or segment.speed(np.linspace(0.0, 1.0, 257)).min() > 1e-5 * segment.length:
        return segment
    pieces = 16
    while True:
        points = segment.point(np.linspace(0.0, 1.0, 2 * pieces + 1))
        sagitta = np.linalg.norm(points[1::2] - 0.5 * (points[:-2:2] + points[2::2]), axis=-1).max()
        if sagitta <= tolerance or pieces >= _MOST_PIECES:
            keep = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=-1) > _ACCURACY])
            keep[-1], keep[-2] = True, keep[-2] and keep[-1]
            return Polyline(points[keep])
        pieces *= 2
