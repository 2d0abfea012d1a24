"""Exact conversion of DXF splines to Bézier curves."""

from __future__ import annotations

from math import factorial

import numpy as np
from scipy.interpolate import BSpline, CubicSpline
from scipy.special import comb

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.pieces import Curve, Curves, Lines, Piece

_HIGHEST_DEGREE = 15
_LIGHTEST = 1e-9  # of the largest weight
_SHORTEST_CHORD = 1e-13  # of the length through all fit points, which it is added up to


def b_spline(degree: int, knots: Array, points: Array, weights: Array | None) -> list[Piece]:
    """Return the Bézier curves between the knots of a B-spline.

    Args:
        degree: 1 to 15.
        knots: not decreasing, (n + degree + 1,).
        points: control points, (n, 3).
        weights: of a rational spline, (n,).
    """
    _check(degree, knots, points, weights)
    w = np.ones(len(points)) if weights is None else weights / weights.max()
    spline = BSpline(knots, np.column_stack([points * w[:, None], w]), degree)
    ends = np.unique(knots[degree : len(points) + 1])
    step = np.diff(ends)[:, None]
    powers = np.stack([spline(ends[:-1], nu=k) * step**k / factorial(k) for k in range(degree + 1)])
    pieces = _bernstein(powers)
    if weights is None:
        return [Curves(pieces[..., :3])]
    return [Curve(piece[:, :3] / piece[:, 3:], piece[:, 3]) for piece in pieces]


def interpolate(points: Array, tangents: tuple[Array, Array] | None, closed: bool) -> list[Piece]:
    """Return the cubic spline through fit points (m, 3), by chord length as CAD programs draw it.

    Its ends are straight (second derivative 0), have the given tangents, or go over into each other.
    """
    if not (points != points[:1]).any():
        raise ToolpathError(f"it has {len(points)} fit points, expected at least 2 different ones", value=len(points))
    ring = np.concatenate([points, points[:1]]) if closed else points
    chords = np.linalg.norm(np.diff(ring, axis=0), axis=-1)
    ring, chords = ring[np.append(True, chords > 0)], chords[chords > 0]
    if not (chords.size and chords.min() > _SHORTEST_CHORD * chords.sum()):
        raise ToolpathError(
            f"its fit points are {chords.tolist()[:3]} … apart, on a length of {chords.sum():g}: expected finite "
            "distances larger than rounding"
        )
    if len(ring) == 2 and tangents is None:
        return [Lines(ring)]
    ends: object = "natural"
    if closed:
        ring[-1], ends = ring[0], "periodic"
    elif tangents is not None:
        ends = tuple((1, tangent / np.linalg.norm(tangent)) for tangent in tangents)
    u = np.concatenate([[0.0], np.cumsum(chords)])
    powers = CubicSpline(u, ring, bc_type=ends).c[::-1]
    return [Curves(_bernstein(powers * chords[:, None] ** np.arange(4)[:, None, None]))]


def _bernstein(powers: Array) -> Array:
    """Convert coefficients of 1, u, u², … (degree + 1, pieces, k) to control points (pieces, degree + 1, k)."""
    n = len(powers) - 1
    i, k = np.arange(n + 1)[:, None], np.arange(n + 1)
    return np.einsum("ik,kpc->pic", comb(i, k) / comb(n, k), powers)


def _check(degree: int, knots: Array, points: Array, weights: Array | None) -> None:
    """Check the data of a B-spline."""
    if not 1 <= degree <= _HIGHEST_DEGREE:
        raise ToolpathError(
            f"it has degree {degree}, expected 1 to {_HIGHEST_DEGREE}", value=degree, limit=(1, _HIGHEST_DEGREE)
        )
    if len(points) <= degree or len(knots) != len(points) + degree + 1:
        raise ToolpathError(
            f"it has {len(points)} control points and {len(knots)} knots, expected at least {degree + 1} points and "
            f"{degree + 1} knots more than points",
            value=len(points),
            limit=degree + 1,
        )
    if not (np.isfinite(knots).all() and np.isfinite(points).all()):
        raise ToolpathError("it has a knot or a control point that is not finite")
    if (np.diff(knots) < 0).any() or not knots[degree] < knots[len(points)]:
        raise ToolpathError("its knots decrease, or are all the same")
    if weights is not None and not (
        len(weights) == len(points) and np.isfinite(weights).all() and weights.min() > _LIGHTEST * weights.max()
    ):
        raise ToolpathError(
            f"it has {len(weights)} weights, expected one greater than 0 for each control point",
            value=len(weights),
            limit=len(points),
        )
