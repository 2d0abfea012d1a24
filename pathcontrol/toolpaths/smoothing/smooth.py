"""Smoothing of a contour with corners to curves that a tool can follow without stopping in between."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._expect import expect, expect_choice
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.segment import SAME_POINT, Polyline, Segment
from pathcontrol.toolpaths.smoothing.corners import (
    SHARP,
    TURN_BACK,
    Corner,
    angles,
    corners,
    end_tangent,
    split,
    start_tangent,
)
from pathcontrol.toolpaths.smoothing.knots import smooth_knots
from pathcontrol.toolpaths.tool_curve import ToolCurve

Corners = Literal["blend", "stop"]

_SHARE = 0.1  # of the tolerance, for polylines that stand for segments with sharp bends
_BETWEEN = 64  # points of each piece at which a polyline is compared with the segment it replaces
_FIRST_PIECES = 32
_TURN = 0.2  # rad over a piece
_NARROWEST = 2.0**-40
_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The smooth curves in place of a contour.

    Attributes:
        curves: one after another; more than one where the tool stops at corners.
        deviation: largest distance between contour and curves [m], on both.
        corners: the corners that were blended or stopped at.
        stops: how often the tool stops on its way, at corners; round a closed contour at its start too.
        normals: for each curve the tool axes given with the contour, as (s, unit vectors), or None.
    """

    curves: tuple[ToolCurve, ...]
    deviation: float
    corners: tuple[Corner, ...]
    stops: int
    normals: tuple[tuple[Array, Array] | None, ...]


def smooth(contour: Contour, tolerance: float = 1e-4, corner: Corners = "blend") -> Smoothed:
    """Return curves with continuous tangent and curvature within ``tolerance`` of a contour.

    Junctions where the tangent or the curvature jumps are replaced by quintic blends. Corners that turn by more than
    5° are blended as well, or else end one curve and begin the next; those that turn by more than 150° always do.
    Curves are parametrised nearly by arc length, 0.5 ≤ ‖p'‖ ≤ 2, and begin where their contour does: an open one or one
    with stops exactly, a closed one in the middle of the blend there.

    Args:
        contour: what is to be followed.
        tolerance: largest distance between contour and curves [m].
        corner: ``"blend"`` sharp corners or ``"stop"`` at them.

    Raises:
        InputError: the tolerance is not positive, or a segment cannot be resolved to 1 nm.
        UnknownNameError: ``corner`` is neither.
    """
    expect("contour", contour, Contour)
    tolerance = as_scalar("tolerance", tolerance, positive=True)
    expect_choice("corner", corner, get_args(Corners))
    parts = split(contour, TURN_BACK if corner == "blend" else SHARP)
    done = [piece for part in parts for piece in _pieces(part, tolerance)]
    curves, deviations, normals = zip(*done, strict=True)
    stops = 0 if curves[0].closed else len(curves) - (not contour.closed)
    return Smoothed(curves, max(deviations), tuple(corners(contour)), stops, normals)


_Piece = tuple[ToolCurve, float, tuple[Array, Array] | None]


def _pieces(contour: Contour, tolerance: float) -> Iterator[_Piece]:
    """Yield smooth curves for a contour that may still turn back inside its segments."""
    segments, apart = zip(*(regularize(segment, _SHARE * tolerance) for segment in contour.segments), strict=True)
    used = max(apart)
    for piece in split(replace(contour, segments=segments), TURN_BACK):
        knots, deviation, normals = smooth_knots(piece, tolerance - used)
        yield ToolCurve(*knots, closed=piece.closed), deviation + used, normals


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
