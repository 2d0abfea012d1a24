"""Polylines with blended corners, or rounded to the smooth curve that their points are samples of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.geometry.hermite import CurvePoint
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.toolpaths.smoothing.blends import Blends, blend_length, straight_trims
from pathcontrol.toolpaths.smoothing.corners import angles
from pathcontrol.toolpaths.smoothing.hermite_data import Knots, Stretch

_GENTLE = np.radians(30.0)  # rad; turns below this may be samples of a smooth curve
_UNEQUAL = 3.0  # how much farther a blend of such a turn may reach on one side than on the other
_TINY = 1e-12  # m
_SAMPLES = 33
_BLOCK = 1 << 13  # blends evaluated together


def round_polyline(polyline: Polyline, before: float, after: float, tolerance: float) -> Stretch:
    """Return Hermite data of a polyline trimmed by lengths [m] at either end."""
    edges = _Edges.of(polyline, before, after, tolerance)
    bend, deviation = _bends(polyline, edges, tolerance)
    steps = np.stack([np.append(0.0, edges.gaps), edges.left], axis=1).reshape(-1)
    s = np.cumsum(steps)
    p = np.stack([edges.begin, edges.end], axis=1).reshape(-1, 3)
    dp, ddp = np.repeat(polyline.directions, 2, axis=0), np.repeat(bend, 2, axis=0)
    keep = np.append(True, steps[1:] > _TINY)
    vertices = np.concatenate([[0.0], 0.5 * (s[1:-1:2] + s[2::2]), [s[-1]]])
    return Stretch(Knots(s[keep], p[keep], dp[keep], ddp[keep]), deviation, vertices)


class _Edges(NamedTuple):
    """The edges that the blends leave: begin and end (k, 3), length (k,), and lengths of the blends (k − 1,)."""

    begin: Array
    end: Array
    left: Array
    gaps: Array

    @classmethod
    def of(cls, polyline: Polyline, cut_before: float, cut_after: float, tolerance: float) -> _Edges:
        t = polyline.directions
        turns = angles(t[:-1], t[1:])
        longest, unequal = straight_trims(turns, tolerance), np.where(turns < _GENTLE, _UNEQUAL, 1.0)
        before, after = (np.minimum(longest, 0.5 * edges) for edges in (polyline.edges[:-1], polyline.edges[1:]))
        at_start = np.append(cut_before, np.minimum(after, unequal * before))
        at_end = np.append(np.minimum(before, unequal * after), cut_after)
        left = np.maximum(polyline.edges - at_start - at_end, 0.0)
        begin, end = polyline.points[:-1] + at_start[:, None] * t, polyline.points[1:] - at_end[:, None] * t
        return cls(begin, end, left, blend_length(np.linalg.norm(begin[1:] - end[:-1], axis=-1), turns))


def _bends(polyline: Polyline, edges: _Edges, tolerance: float) -> tuple[Array, float]:
    """Return the curvature vector [1/m] in the middle of edges, (k, 3), and the deviation of the blends [m].

    Where an edge is blended from end to end and turns on the same way at both ends, its points sample a smooth curve,
    whose curvature it takes unless the blends beside it would leave the tolerance.
    """
    bend = _sampled_curvature(polyline, edges)
    deviation = np.zeros(len(edges.gaps))
    look = np.flatnonzero(edges.gaps > _TINY)
    while look.size:
        for block in np.array_split(look, len(look) // _BLOCK + 1):
            deviation[block] = _deviations(polyline, edges, bend, block)
        curved = np.any(bend != 0, axis=-1)
        wrong = look[(deviation[look] > 0.99 * tolerance) & (curved[look] | curved[look + 1])]
        straight = np.unique(np.append(wrong, wrong + 1))
        bend[straight] = 0.0
        look = np.unique(np.append(straight - 1, straight))
        look = look[(look >= 0) & (look < len(deviation)) & (edges.gaps.take(look, mode="clip") > _TINY)]
    return bend, float(deviation.max(initial=0.0))


def _deviations(polyline: Polyline, edges: _Edges, bend: Array, i: Array) -> Array:
    """Return the deviation of the blends at the inner points i + 1 [m], (N,)."""
    start = CurvePoint(edges.end[i], polyline.directions[i], bend[i])
    end = CurvePoint(edges.begin[i + 1], polyline.directions[i + 1], bend[i + 1])
    corner = polyline.points[i + 1]
    arms = (np.stack([p, 0.5 * (p + corner), corner], axis=-2) for p in (start.p, end.p))
    return Blends.between(start, end, edges.gaps[i], _SAMPLES).deviation(*arms)


def _sampled_curvature(polyline: Polyline, edges: _Edges) -> Array:
    """Return the curvature vector [1/m] of edges from the turns at both ends, (k, 3); 0 where they disagree."""
    t = polyline.directions
    turn, bend = np.diff(t, axis=0), np.zeros_like(t)
    mean = turn / np.maximum(edges.gaps, _TINY)[:, None]
    bend[1:-1] = 0.5 * (mean[:-1] + mean[1:])
    bend -= (bend * t).sum(-1, keepdims=True) * t
    gentle = np.linalg.norm(turn, axis=-1) < _GENTLE
    goes_on = np.zeros(len(t), dtype=bool)
    goes_on[1:-1] = (turn[:-1] * turn[1:]).sum(-1) > 0
    goes_on[1:-1] &= gentle[:-1] & gentle[1:] & (edges.left[1:-1] <= _TINY)
    return np.where(goes_on[:, None], bend, 0.0)
