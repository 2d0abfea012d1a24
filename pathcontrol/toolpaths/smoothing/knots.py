"""Hermite data of one smooth curve in place of a contour: segments, and blends where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.geometry.hermite import CurvePoint, hermite_polynomials
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.segment import Polyline, Segment
from pathcontrol.toolpaths.smoothing.blends import Arm, Junction, blend_length
from pathcontrol.toolpaths.smoothing.corners import angles
from pathcontrol.toolpaths.smoothing.hermite_data import ByLength, Knots, Stretch, curved_stretch
from pathcontrol.toolpaths.smoothing.rounded_polylines import round_polyline


class SmoothKnots(NamedTuple):
    """The knots of one smooth curve in place of a contour.

    Attributes:
        knots: Hermite data of the curve.
        deviation: largest distance between contour and curve [m].
        normals: the tool axes given with the contour, as (s, unit vectors), or None.
    """

    knots: Knots
    deviation: float
    normals: tuple[Array, Array] | None


def smooth_knots(contour: Contour, tolerance: float) -> SmoothKnots:
    """Return the knots of one smooth curve within a ``tolerance`` [m] of a contour without stops."""
    segments, closed = contour.segments, contour.closed
    following = segments[1:] + (segments[:1] if closed else ())
    junctions = [_junction(a, b, tolerance) for a, b in zip(segments, following, strict=False)]
    trims = [0.0, *(junction.trim for junction in junctions), 0.0]
    if closed:
        trims[0] = trims[-2]
    parts = [_stretch(*of, tolerance) for of in zip(segments, trims, trims[1:], strict=False)]
    knots = [part.knots for part in parts]
    gaps = [_gap(*ends) for ends in zip(knots, knots[1:] + knots[:1], junctions, strict=False)]
    joined = _ring(knots, gaps) if closed else _chain(knots, gaps)
    deviation = max(*(part.deviation for part in parts), *(junction.deviation for junction in junctions), 0.0)
    if contour.normals is None:
        return SmoothKnots(joined, deviation, None)
    inside = parts[0].vertices[1:-1] + (0.5 * gaps[-1] if closed else 0.0)
    s = np.concatenate([joined.s[:1], inside, joined.s[-1:]])
    return SmoothKnots(joined, deviation, (s, contour.normals))


def _stretch(segment: Segment, before: float, after: float, tolerance: float) -> Stretch:
    """Return Hermite data of a segment trimmed by lengths [m] at either end."""
    if isinstance(segment, Polyline):
        return round_polyline(segment, before, after, tolerance)
    return curved_stretch(segment, before, segment.length - after)


def _junction(before: Segment, after: Segment, tolerance: float) -> Junction:
    """Return the blend between two segments."""
    longest = min(_room(before, -1), _room(after, 0))
    return Junction.of(_arm(before, -1), _arm(after, 1), longest, tolerance)


def _room(segment: Segment, edge: int) -> float:
    """Return the most that may be cut off at the start (0) or the end (-1) of a segment [m]."""
    return 0.5 * (float(segment.edges[edge]) if isinstance(segment, Polyline) else segment.length)


def _arm(segment: Segment, sign: int) -> Arm:
    """Return the segment seen from its start (1) or its end (-1), by the distance from there."""
    curve = _Straight(segment) if isinstance(segment, Polyline) else ByLength(segment)
    length = segment.length
    return curve.at if sign > 0 else lambda way: curve.at(length - np.asarray(way))


@dataclass(frozen=True, eq=False)
class _Straight:
    """The first or last edge of a polyline by arc length."""

    polyline: Polyline

    def at(self, length: Array) -> CurvePoint:
        u = np.asarray(length) / self.polyline.length
        return CurvePoint(
            self.polyline.point(u), self.polyline.derivative(u) / self.polyline.length, np.zeros((*u.shape, 3))
        )


def _gap(before: Knots, after: Knots, junction: Junction) -> float:
    """Return the parameter length of the blend between two parts [m]; 0 where there is none."""
    if junction.trim == 0:
        return 0.0
    chord = np.asarray(np.linalg.norm(after.p[0] - before.p[-1]))
    return float(blend_length(chord, angles(before.dp[-1], after.dp[0])))


def _ring(parts: Sequence[Knots], gaps: Sequence[float]) -> Knots:
    """Return the knots of a closed curve, from the middle of its last blend."""
    first, last, gap = parts[0], parts[-1], gaps[-1]
    if gap == 0:
        return _chain([*parts, Knots(*(column[:1] for column in first))], gaps)
    ends = np.array([[values[0][-1], values[1][0]] for values in zip(last[1:], first[1:], strict=True)])
    seam, half = hermite_polynomials(np.array([0.0, gap]), ends), np.array([0.5 * gap])
    middle = Knots(np.zeros(1), seam(half), seam.derivative(1)(half), seam.derivative(2)(half))
    return _chain([middle, *parts, middle], [0.5 * gap, *gaps[:-1], 0.5 * gap])


def _chain(parts: Sequence[Knots], gaps: Sequence[float]) -> Knots:
    """Return the knots of parts in a row; without a gap, the last knot of one is the first of the next."""
    begin, shifted = 0.0, []
    for part, gap in zip(parts, [*gaps, np.inf], strict=True):
        upto = len(part.s) if gap > 0 else -1
        shifted.append(Knots(begin + part.s[:upto], part.p[:upto], part.dp[:upto], part.ddp[:upto]))
        begin += float(part.s[-1]) + gap
    return Knots(*(np.concatenate(column) for column in zip(*shifted, strict=True)))
