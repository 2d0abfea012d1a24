"""From a contour with corners to curves that a tool can follow without stopping in between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from pathcontrol._arrays import Array, scalar
from pathcontrol._expect import expect
from pathcontrol.errors import UnknownNameError
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.curve import CurvePoint, ToolCurve
from pathcontrol.toolpaths.segments.base import Polyline, Segment
from pathcontrol.toolpaths.smoothing.bends import regular
from pathcontrol.toolpaths.smoothing.blends import Arm, Junction, blend_length
from pathcontrol.toolpaths.smoothing.corners import SHARP, Corner, angles, corners, split
from pathcontrol.toolpaths.smoothing.hermite_data import ByLength, Knots, Stretch, curved
from pathcontrol.toolpaths.smoothing.polylines import rounded

Corners = Literal["blend", "stop"]

_TURN_BACK = np.radians(150.0)  # rad; sharper than this nothing can be blended without nearly standing still
_SHARE = 0.1  # of the tolerance, for polylines that stand for segments with sharp bends


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smooth curves that stand for a contour.

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
    """Curves with continuous tangent and curvature within ``tolerance`` of a contour.

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
    tolerance = scalar("tolerance", tolerance, positive=True)
    if corner not in get_args(Corners):
        raise UnknownNameError(f"corner = {corner!r}, expected one of {', '.join(map(repr, get_args(Corners)))}")
    parts = split(contour, _TURN_BACK if corner == "blend" else SHARP)
    done = [piece for part in parts for piece in _pieces(part, tolerance)]
    curves, deviations, normals = zip(*done, strict=True)
    stops = 0 if curves[0].closed else len(curves) - (not contour.closed)
    return Smoothed(curves, max(deviations), tuple(corners(contour)), stops, normals)


_Piece = tuple[ToolCurve, float, tuple[Array, Array] | None]


def _pieces(contour: Contour, tolerance: float) -> Iterator[_Piece]:
    """Smooth curves for a contour that may still turn back inside its segments."""
    segments, apart = zip(*(regular(segment, _SHARE * tolerance) for segment in contour.segments), strict=True)
    used = max(apart)
    for piece in split(replace(contour, segments=segments), _TURN_BACK):
        curve, deviation, normals = _curve(piece, tolerance - used)
        yield curve, deviation + used, normals


def _curve(contour: Contour, tolerance: float) -> _Piece:
    """One smooth curve for a contour without stops, its deviation [m], and the tool axes along it."""
    segments, closed = contour.segments, contour.closed
    following = segments[1:] + (segments[:1] if closed else ())
    junctions = [_junction(a, b, tolerance) for a, b in zip(segments, following, strict=False)]
    trims = [0.0, *(junction.trim for junction in junctions), 0.0]
    if closed:
        trims[0] = trims[-2]
    parts = [_stretch(*of, tolerance) for of in zip(segments, trims, trims[1:], strict=False)]
    knots = [part.knots for part in parts]
    gaps = [_gap(*ends) for ends in zip(knots, knots[1:] + knots[:1], junctions, strict=False)]
    curve = ToolCurve(*(_ring(knots, gaps) if closed else _chain(knots, gaps)), closed=closed)
    deviation = max(*(part.deviation for part in parts), *(junction.deviation for junction in junctions), 0.0)
    if contour.normals is None:
        return curve, deviation, None
    inside = parts[0].vertices[1:-1] + (0.5 * gaps[-1] if closed else 0.0)
    return curve, deviation, (np.concatenate([[curve.s0], inside, [curve.s_end]]), contour.normals)


def _stretch(segment: Segment, before: float, after: float, tolerance: float) -> Stretch:
    """What stands for a segment of which so much [m] is cut off at either end."""
    if isinstance(segment, Polyline):
        return rounded(segment, before, after, tolerance)
    return curved(segment, before, segment.length - after)


def _junction(before: Segment, after: Segment, tolerance: float) -> Junction:
    longest = min(_room(before, -1), _room(after, 0))
    return Junction.of(_arm(before, -1), _arm(after, 1), longest, tolerance)


def _room(segment: Segment, edge: int) -> float:
    """The most that may be cut off at the start (0) or the end (-1) of a segment [m]."""
    return 0.5 * (float(segment.edges[edge]) if isinstance(segment, Polyline) else segment.length)


def _arm(segment: Segment, sign: int) -> Arm:
    """The segment seen from its start (1) or its end (-1), by the distance from there."""
    curve = _Straight(segment) if isinstance(segment, Polyline) else ByLength(segment)
    length = segment.length
    return curve.at if sign > 0 else lambda way: curve.at(length - np.asarray(way))


@dataclass(frozen=True, eq=False)
class _Straight:
    """The first and last edge of a polyline by arc length."""

    polyline: Polyline

    def at(self, length: Array) -> CurvePoint:
        u = np.asarray(length) / self.polyline.length
        return CurvePoint(
            self.polyline.point(u), self.polyline.derivative(u) / self.polyline.length, np.zeros((*u.shape, 3))
        )


def _gap(before: Knots, after: Knots, junction: Junction) -> float:
    """Parameter length of the blend between two parts [m]; 0 where there is none."""
    if junction.trim == 0:
        return 0.0
    chord = np.asarray(np.linalg.norm(after.p[0] - before.p[-1]))
    return float(blend_length(chord, angles(before.dp[-1], after.dp[0])))


def _ring(parts: Sequence[Knots], gaps: Sequence[float]) -> Knots:
    """The knots of a closed curve, from the middle of its last blend."""
    first, last, gap = parts[0], parts[-1], gaps[-1]
    if gap == 0:
        return _chain([*parts, Knots(*(column[:1] for column in first))], gaps)
    seam = ToolCurve([0.0, gap], [last.p[-1], first.p[0]], [last.dp[-1], first.dp[0]], [last.ddp[-1], first.ddp[0]])
    middle = Knots(np.zeros(1), *seam.at([0.5 * gap]))
    return _chain([middle, *parts, middle], [0.5 * gap, *gaps[:-1], 0.5 * gap])


def _chain(parts: Sequence[Knots], gaps: Sequence[float]) -> Knots:
    """The knots of parts one after another; where there is no gap, the last of one is the first of the next."""
    begin, shifted = 0.0, []
    for part, gap in zip(parts, [*gaps, np.inf], strict=True):
        upto = len(part.s) if gap > 0 else -1
        shifted.append(Knots(begin + part.s[:upto], part.p[:upto], part.dp[:upto], part.ddp[:upto]))
        begin += float(part.s[-1]) + gap
    return Knots(*(np.concatenate(column) for column in zip(*shifted, strict=True)))
