"""Replacement of segments that bend more sharply than a tolerance by polylines within it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.segments.segment import SAME_POINT, Polyline, Segment
from pathcontrol.toolpaths.smoothing.corners import angles, end_tangent, start_tangent

_BETWEEN = 64  # points of each piece at which a polyline is compared with the segment it replaces
_FIRST_PIECES = 32
_TURN = 0.2  # rad over a piece
_NARROWEST = 2.0**-40
_TINY = np.finfo(float).tiny


def regularize(segment: Segment, tolerance: float) -> tuple[Segment, float]:
    """Return the segment itself, or a polyline within ``tolerance`` [m] if it turns by more than 0.2 rad within that.

    Cusps and loops smaller than the tolerance become corners of the polyline. The second value is how far apart they
    are [m].
    """
    if isinstance(segment, Polyline):
        return segment, 0.0
    pieces = _Pieces.of(segment, np.linspace(0.0, 1.0, _FIRST_PIECES + 1))
    while (coarse := (pieces.turn > _TURN) & (pieces.size > tolerance)).any():
        pieces = pieces.halved(segment, coarse)
    if (pieces.turn <= _TURN).all():
        return segment, 0.0
    while (coarse := (pieces.sagitta > tolerance) & (pieces.size > tolerance)).any():
        pieces = pieces.halved(segment, coarse)
    least = max(SAME_POINT, min(0.1 * tolerance, 0.01 * segment.length))
    polyline = Polyline(_thin_out(segment.point(pieces.u), least))
    shares = np.linspace(0.0, 1.0, _BETWEEN, endpoint=False)[:, None]
    between = segment.point(pieces.u[:-1] + np.diff(pieces.u) * shares)
    return polyline, float(polyline.distance(between).max())


class _Pieces(NamedTuple):
    """Pieces of a segment between parameters u (k + 1,): their size [m], turn [rad] and sagitta [m], each (k,)."""

    u: Array
    size: Array
    turn: Array
    sagitta: Array

    @classmethod
    def of(cls, segment: Segment, u: Array) -> _Pieces:
        p, middle = segment.point(u), segment.point(0.5 * (u[:-1] + u[1:]))
        derivative = segment.derivative(u)
        t = derivative / np.maximum(np.linalg.norm(derivative, axis=-1, keepdims=True), _TINY)
        t[0], t[-1] = start_tangent(segment), end_tangent(segment)
        size = np.linalg.norm(middle - p[:-1], axis=-1) + np.linalg.norm(p[1:] - middle, axis=-1)
        turn = angles(t[:-1], t[1:])
        sagitta = np.linalg.norm(middle - 0.5 * (p[:-1] + p[1:]), axis=-1)
        # a piece too narrow to be halved has no size
        return cls(u, np.where(np.diff(u) > _NARROWEST, size, 0.0), turn, np.maximum(sagitta, size * turn / 8))

    def halved(self, segment: Segment, chosen: Array) -> _Pieces:
        """Return the pieces with the ``chosen`` ones halved."""
        return _Pieces.of(segment, np.sort(np.append(self.u, 0.5 * (self.u[:-1] + self.u[1:])[chosen])))


def _thin_out(points: Array, least: float) -> Array:
    """Return the first and last point, and of those between some that are ``least`` [m] apart."""
    kept = [points[0]]
    for point in points[1:-1]:
        if np.linalg.norm(point - kept[-1]) > least:
            kept.append(point)
    if len(kept) > 1 and np.linalg.norm(points[-1] - kept[-1]) <= least:
        kept.pop()
    return np.array([*kept, points[-1]])
