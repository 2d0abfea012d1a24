"""From a contour with corners to curves that a tool can follow without stopping in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from pathcontrol._arrays import Array, scalar
from pathcontrol.errors import InputError, UnknownNameError
from pathcontrol.toolpaths.blends import Arm, blend_length, junction_trim, straight_trims
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.corners import SHARP, Corner, angles, corners, split
from pathcontrol.toolpaths.curve import CurvePoint, ToolCurve
from pathcontrol.toolpaths.hermite import ByLength, Knots, curved_knots, regular
from pathcontrol.toolpaths.segments import Polyline, Segment

Corners = Literal["blend", "stop"]

_TURN_BACK = np.radians(150.0)  # rad; sharper than this nothing can be blended without nearly standing still
_GENTLE = np.radians(30.0)  # rad; turns of a polyline below this may be samples of a smooth curve
_UNEQUAL = 3.0  # how much farther a blend may reach on one side than on the other
_TINY = 1e-12  # m


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smooth curves that stand for a contour.

    Attributes:
        curves: one after another; more than one where the tool stops at corners.
        deviation: largest distance between contour and curves [m], measured on both.
        corners: the corners that were blended or stopped at.
        stops: how many of them are stopped at.
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

    Args:
        contour: what is to be followed.
        tolerance: largest distance between contour and curves [m].
        corner: ``"blend"`` sharp corners or ``"stop"`` at them.

    Raises:
        InputError: the tolerance is not positive, or a segment has a kink inside that cannot be resolved.
        UnknownNameError: ``corner`` is neither.
    """
    tolerance = scalar("tolerance", tolerance, positive=True)
    if corner not in get_args(Corners):
        raise UnknownNameError(f"corner = {corner!r}, expected one of {', '.join(map(repr, get_args(Corners)))}")
    pieces = split(contour, _TURN_BACK if corner == "blend" else SHARP)
    found = tuple(corners(contour))
    stops = 0 if pieces == [contour] else len(pieces) - (not contour.closed)
    for rounded in (True, False):
        done = [_curve(piece, tolerance, rounded) for piece in pieces]
        curves = tuple(curve for curve, _ in done)
        deviation = max(_off_contour(contour, curves), _off_curves(found, curves))
        if deviation <= 1.001 * tolerance + 2e-9:
            return Smoothed(curves, deviation, found, stops, tuple(normals for _, normals in done))
    raise InputError(
        f"contour {contour.name!r} cannot be smoothed within tolerance = {tolerance:g} m: {deviation:g} m was reached"
    )


def _curve(contour: Contour, tolerance: float, rounded: bool) -> tuple[ToolCurve, tuple[Array, Array] | None]:
    """One smooth curve for a contour without stops, and the tool axes along it."""
    segments = [regular(segment, 0.1 * tolerance) for segment in contour.segments]
    trims = _trims(segments, contour.closed, tolerance)
    parts = [
        _polyline_knots(s, ends, _inner_trims(s, tolerance), rounded)
        if isinstance(s, Polyline)
        else curved_knots(s, ends[0], s.length - ends[1])
        for s, ends in zip(segments, trims, strict=True)
    ]
    knots = _chained(parts, contour.closed)
    curve = ToolCurve(*knots, closed=contour.closed)
    return curve, None if contour.normals is None else _axes(contour, curve)


def _trims(segments: Sequence[Segment], closed: bool, tolerance: float) -> Array:
    """How much is cut off at the start and the end of each segment [m], (segments, 2)."""
    ends = np.zeros((len(segments), 2))
    last = len(segments) if closed else len(segments) - 1
    for i in range(last):
        j = (i + 1) % len(segments)
        longest = min(_room(segments[i], -1), _room(segments[j], 0))
        ends[i, 1] = ends[j, 0] = junction_trim(_arm(segments[i], -1), _arm(segments[j], 1), longest, tolerance)
    return ends


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


def _inner_trims(polyline: Polyline, tolerance: float) -> tuple[Array, Array]:
    """What is cut off before and after each inner point of a polyline [m], each (k − 1,)."""
    turns = angles(polyline.directions[:-1], polyline.directions[1:])
    longest = straight_trims(turns, tolerance)
    before, after = np.minimum(longest, 0.5 * polyline.edges[:-1]), np.minimum(longest, 0.5 * polyline.edges[1:])
    return np.minimum(before, _UNEQUAL * after), np.minimum(after, _UNEQUAL * before)


def _polyline_knots(polyline: Polyline, ends: Array, inner: tuple[Array, Array], rounded: bool) -> Knots:
    """Hermite data at both ends of what is left of each edge."""
    at_start, at_end = np.append(ends[0], inner[1]), np.append(inner[0], ends[1])
    left = np.maximum(polyline.edges - at_start - at_end, 0.0)
    t = polyline.directions
    begin, end = polyline.points[:-1] + at_start[:, None] * t, polyline.points[1:] - at_end[:, None] * t
    gaps = blend_length(np.linalg.norm(begin[1:] - end[:-1], axis=-1), angles(t[:-1], t[1:]))
    steps = np.stack([np.append(0.0, gaps), left], axis=1).reshape(-1)
    bend = _bends(t, gaps, left) if rounded and len(t) > 2 else np.zeros_like(t)
    p, dp, ddp = np.stack([begin, end], axis=1).reshape(-1, 3), np.repeat(t, 2, axis=0), np.repeat(bend, 2, axis=0)
    keep = np.append(True, steps[1:] > _TINY)
    return Knots(np.cumsum(steps)[keep], p[keep], dp[keep], ddp[keep])


def _bends(t: Array, gaps: Array, left: Array) -> Array:
    """Curvature vector [1/m] in the middle of edges that are blended from end to end, (k, 3).

    Where such an edge turns on the same way at both ends, its points sample a smooth curve, whose curvature it takes.
    """
    turn = np.diff(t, axis=0)
    mean = turn / np.maximum(gaps, _TINY)[:, None]
    bend = np.zeros_like(t)
    bend[1:-1] = 0.5 * (mean[:-1] + mean[1:])
    bend -= (bend * t).sum(-1, keepdims=True) * t
    gentle = np.linalg.norm(turn, axis=-1) < _GENTLE
    goes_on = np.zeros(len(t), dtype=bool)
    goes_on[1:-1] = (turn[:-1] * turn[1:]).sum(-1) > 0
    goes_on[1:-1] &= gentle[:-1] & gentle[1:] & (left[1:-1] <= _TINY)
    return np.where(goes_on[:, None], bend, 0.0)


def _chained(parts: Sequence[Knots], closed: bool) -> Knots:
    """The knots of all parts, with the blends between them as the gaps in s."""
    s, begin = [], 0.0
    for i, part in enumerate(parts):
        s.append(begin + part.s)
        after = parts[(i + 1) % len(parts)]
        chord = float(np.linalg.norm(after.p[0] - part.p[-1]))
        begin = float(s[-1][-1]) + float(blend_length(np.array(chord), angles(part.dp[-1], after.dp[0])))
    columns = [np.concatenate(column) for column in list(zip(*parts, strict=True))[1:]]
    station = np.concatenate(s)
    if closed:
        station = np.append(station, begin)
        columns = [np.concatenate([column, column[:1]]) for column in columns]
    keep = np.concatenate([[True], np.diff(station) > _TINY])
    if closed and not keep[-1]:  # the last knot is the first one: leave out the one before it
        keep[-1] = True
        keep[np.flatnonzero(keep)[-2]] = False
    return Knots(station[keep], *(column[keep] for column in columns))


def _axes(contour: Contour, curve: ToolCurve) -> tuple[Array, Array]:
    """The tool axes at the parameters of the curve nearest to the points they were given with."""
    polyline = contour.segments[0]
    assert isinstance(polyline, Polyline)
    assert contour.normals is not None
    share = polyline.stations / polyline.length
    stations = curve.nearest(polyline.points, near=curve.s0 + share * curve.length)
    return np.maximum.accumulate(stations), contour.normals


def _off_contour(contour: Contour, curves: Sequence[ToolCurve]) -> float:
    """Largest distance of the curves from the contour [m], sampled nine times between knots."""
    samples = []
    for curve in curves:
        step = np.diff(curve.knots)[:, None]
        samples.append(curve.position((curve.knots[:-1, None] + step * np.linspace(0, 1, 9)).reshape(-1)))
    return float(contour.distance(np.concatenate(samples)).max())


def _off_curves(found: Sequence[Corner], curves: Sequence[ToolCurve]) -> float:
    """Largest distance of a corner from the curves [m]."""
    if not found:
        return 0.0
    points = np.array([corner.point for corner in found])
    return float(np.min([curve.distance(points) for curve in curves], axis=0).max())
