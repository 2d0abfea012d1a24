"""The corners of a contour, and its pieces between them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.bezier_columns import end_tangents, measure_lengths
from pathcontrol.toolpaths.segments.segment import Polyline, Segment

TURN_BACK = np.radians(150.0)  # rad; sharper than this nothing can be blended without nearly standing still
SHARP = np.radians(5.0)  # rad, turns above this are corners: counted, shown and stopped at


class Corner(NamedTuple):
    """A place where the tangent of a contour jumps.

    Attributes:
        segment: index of the segment that ends or, inside a polyline, turns there.
        vertex: index of the point of the polyline; 0 where it is a junction of two segments.
        station: arc length from the contour's start [m].
        point: where it is [m], (3,).
        turn: angle between the tangents before and after [rad].
    """

    segment: int
    vertex: int
    station: float
    point: Array
    turn: float


def corners(contour: Contour, angle: float = SHARP) -> list[Corner]:
    """Return the corners that turn by more than ``angle`` [rad], in order, that of a closed contour's start last."""
    found, station = [], 0.0
    measure_lengths(contour.segments)
    starts, ends = end_tangents(contour.segments)
    turns_at = angles(ends, np.roll(starts, -1, axis=0))
    for i, segment in enumerate(contour.segments):
        if isinstance(segment, Polyline):
            turns = angles(segment.directions[:-1], segment.directions[1:])
            for j in np.flatnonzero(turns > angle) + 1:
                where = station + float(segment.stations[j])
                found.append(Corner(i, int(j), where, segment.points[j], float(turns[j - 1])))
        station += segment.length
        if (i + 1 < len(contour.segments) or contour.closed) and turns_at[i] > angle:
            found.append(Corner(i, 0, station, segment.last, float(turns_at[i])))
    return found


def split(contour: Contour, angle: float) -> list[Contour]:
    """Cut the contour at the corners that turn by more than ``angle`` [rad].

    A closed contour with such corners becomes open pieces from where it begins to where it ends.
    """
    places = corners(contour, angle)
    if not places:
        return [contour]
    pieces, current = [], _Piece(contour)
    cuts = {(c.segment, c.vertex) for c in places}
    for i, segment in enumerate(contour.segments):
        inside = sorted(vertex for piece, vertex in cuts if piece == i and vertex)
        for part, first, last in _parts(segment, inside):
            current.take(part, first, last)
            if last or (i, 0) in cuts:
                pieces.append(current.done())
                current = _Piece(contour)
    if current.segments:
        pieces.append(current.done())
    return pieces


def start_tangent(segment: Segment) -> Array:
    """Return the unit tangent at the start, (3,), also where the derivative vanishes there."""
    return _tangent(segment, np.array([0.0, 1e-6, 1e-4, 1e-2]))


def end_tangent(segment: Segment) -> Array:
    """Return the unit tangent at the end, (3,)."""
    return _tangent(segment, 1.0 - np.array([0.0, 1e-6, 1e-4, 1e-2]))


def angles(a: Array, b: Array) -> Array:
    """Return the angle between unit vectors (*batch, 3) [rad], (*batch,)."""
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


class _Piece:
    """A piece of a contour under construction."""

    def __init__(self, whole: Contour) -> None:
        self._whole = whole
        self.segments: list[Segment] = []
        self._normals: Array | None = None

    def take(self, segment: Segment, first: int, last: int) -> None:
        self.segments.append(segment)
        if self._whole.normals is not None:
            self._normals = self._whole.normals[first : last + 1 if last else None]

    def done(self) -> Contour:
        return replace(self._whole, segments=tuple(self.segments), closed=False, normals=self._normals)


def _parts(segment: Segment, vertices: list[int]) -> list[tuple[Segment, int, int]]:
    """Cut a polyline at ``vertices``; return the parts with their first and last index, 0 for the end of the whole."""
    if not vertices:
        return [(segment, 0, 0)]
    assert isinstance(segment, Polyline)
    bounds = [0, *vertices, len(segment.points) - 1]
    lasts = [*vertices, 0]
    return [
        (Polyline(segment.points[a : b + 1]), a, last)
        for a, b, last in zip(bounds[:-1], bounds[1:], lasts, strict=True)
    ]


def _tangent(segment: Segment, u: Array) -> Array:
    derivative = segment.derivative(u)
    speed = np.linalg.norm(derivative, axis=-1)
    i = int(np.argmax(speed > 1e-9 * speed.max()))
    return derivative[i] / speed[i]
