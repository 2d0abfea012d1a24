"""Segments by arc length, and their Hermite data (p, p', p''), from which smooth curves are made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.geometry.hermite import CurvePoint, hermite_polynomials
from pathcontrol.toolpaths.segments.segment import Segment
from pathcontrol.toolpaths.smoothing.corners import end_tangent, start_tangent

_ACCURACY = 1e-9  # m, between a segment and the quintics in its place
_MOST_PIECES = 1 << 16
_STILL = 1e-6  # share of the mean speed that counts as standstill
_SHORTEST = 1e-12  # m


class Knots(NamedTuple):
    """Hermite data along a stretch: s [m] from its beginning, p, dp/ds and d²p/ds², (k,) and (k, 3)."""

    s: Array
    p: Array
    dp: Array
    ddp: Array


class Stretch(NamedTuple):
    """The Hermite data of a segment, or of a part of it.

    Attributes:
        knots: Hermite data.
        deviation: largest distance from the segment [m].
        vertices: where the points of a polyline are: parameters [m] from the beginning, the middles of blends.
    """

    knots: Knots
    deviation: float
    vertices: Array


@dataclass(frozen=True, eq=False)
class ByLength:
    """A curved segment with its arc length [m] as parameter.

    Where its own parameter stands still, which it may at its ends, the curvature may have no bound; it is 0 here.
    """

    segment: Segment

    def at(self, length: ArrayLike) -> CurvePoint:
        """Return position and derivatives by arc length, at ``length`` (*batch,) from the start [m]."""
        u = self.segment.arc_length.inverse(np.asarray(length, dtype=np.float64))
        first, second = self.segment.derivative(u), self.segment.derivative(u, 2)
        speed = np.linalg.norm(first, axis=-1, keepdims=True)
        moves = speed > _STILL * self.segment.length
        speed = np.where(moves, speed, 1.0)
        tangent = np.where(moves, first / speed, 0.0)
        if not moves.all():
            limit = np.where(u[..., None] < 0.5, start_tangent(self.segment), end_tangent(self.segment))
            tangent = np.where(moves, tangent, limit)
        across = second - (second * tangent).sum(-1, keepdims=True) * tangent
        return CurvePoint(self.segment.point(u), tangent, np.where(moves, across / speed**2, 0.0))


def curved_stretch(segment: Segment, start: float, end: float) -> Stretch:
    """Return Hermite data of a curved segment between arc lengths ``start`` and ``end`` [m], accurate to 1 nm.

    Raises:
        InputError: the segment is so far away, or bends so sharply, that 1 nm cannot be resolved.
    """
    curve = ByLength(segment)
    s = np.linspace(start, end, 5 if end - start > _SHORTEST else 1)
    while True:
        data = curve.at(s)
        between = s[:-1] + 0.4 * np.diff(s)  # beside the middle, where an odd error would not show
        if not between.size:
            break
        error = np.linalg.norm(hermite_polynomials(s, np.stack(data))(between) - curve.at(between).p, axis=-1)
        allowed = 0.6 * _ACCURACY  # elsewhere in a piece it may be 1.6 times as large
        coarse, resolved = error > allowed, np.spacing(np.abs(data.p).max()) <= allowed
        if resolved and not coarse.any():
            break
        if not resolved or len(s) > _MOST_PIECES:
            raise InputError(
                f"a {type(segment).__name__} of length {segment.length:g} m at {data.p[0].tolist()} cannot be followed "
                "to 1 nm: it bends too sharply, or is too far from the origin",
                value=segment.length,
            )
        s = np.sort(np.concatenate([s, 0.5 * (s[:-1] + s[1:])[coarse]]))
    return Stretch(Knots(s - s[0], *data), _ACCURACY, np.array([0.0, s[-1] - s[0]]))
