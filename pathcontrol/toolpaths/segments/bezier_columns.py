"""Boxes, lengths and tangents of many polynomial Bézier curves at once, by columns of control points.

What one curve would work out when it is asked is worked out for all of a contour together, and kept in each of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.special import comb

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Segment

_AT_ONCE = 512  # curves
_HIGHEST_DEGREE = 3  # curves whose lengths are computed together
_FIRST_CELLS, _NARROWEST, _ACCURACY, _TURN = (
    4,
    2.0**-40,
    1e-13,
    0.9,
)  # as in ArcLength, but for the first and the accuracy
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def measure_lengths(segments: Sequence[Segment]) -> None:
    """Compute the lengths of all segments that do not have them yet."""
    for rows, points in _columns(segments, "length", _HIGHEST_DEGREE):
        for row, length in zip(rows, _lengths(points).tolist(), strict=True):
            segments[row].__dict__["length"] = length


def measure_bounds(segments: Sequence[Segment]) -> None:
    """Compute the bounding boxes of all segments that do not have them yet."""
    for rows, points in _columns(segments, "bounds", _HIGHEST_DEGREE):
        for row, low, high in zip(rows, *boxes(points), strict=True):
            segments[row].__dict__["bounds"] = low, high


def end_tangents(segments: Sequence[Segment]) -> tuple[Array, Array]:
    """Return unit tangents at starts and ends of segments, each (k, 3), also where the derivative vanishes."""
    near = np.array([0.0, 1e-6, 1e-4, 1e-2])
    found = np.empty((2, len(segments), 3))
    others = set(range(len(segments)))
    for rows, points in _columns(segments, "", 64):
        others.difference_update(rows)
        steps, degree = np.diff(points, axis=1), points.shape[1] - 1
        for side, u in enumerate((near, 1 - near)):
            found[side, rows] = _unit(degree * np.einsum("ui,kic->kuc", _bernstein(degree - 1, u), steps))
    for row in others:
        for side, u in enumerate((near, 1 - near)):
            found[side, row] = _unit(segments[row].derivative(u)[None])[0]
    return found[0], found[1]


def boxes(points: Array) -> tuple[Array, Array]:
    """Return lower and upper corners, each (k, 3), of boxes around curves of degree 1 to 3, (k, degree + 1, 3)."""
    a, b, c = _hodograph(points)  # a u² + b u + c is a third or so of the derivative
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4 * a * c, 0.0)), b))
        turns = np.nan_to_num(np.stack([q / a, c / q]), nan=0.0, posinf=0.0, neginf=0.0).clip(0.0, 1.0)
    rows = list(np.moveaxis(points, 1, 0))
    while len(rows) > 1:  # de Casteljau's algorithm
        rows = [(1 - turns) * before + turns * after for before, after in pairwise(rows)]
    extremes = [*rows[0], points[:, 0], points[:, -1]]
    return np.minimum.reduce(extremes), np.maximum.reduce(extremes)


def _columns(segments: Sequence[Segment], unless: str, highest: int) -> Iterator[tuple[list[int], Array]]:
    """Yield indices of polynomial curves without the attribute ``unless``, with control points (k, degree + 1, 3)."""
    groups: dict[int, tuple[list[int], list[Array]]] = {}
    for place, segment in enumerate(segments):
        if isinstance(segment, Bezier) and segment.weights is None and unless not in segment.__dict__:
            places, points = groups.setdefault(len(segment.points), ([], []))
            places.append(place)
            points.append(segment.points)
    for size, (places, points) in groups.items():
        for begin in range(0, len(places) if size - 1 <= highest else 0, _AT_ONCE):
            yield places[begin : begin + _AT_ONCE], np.array(points[begin : begin + _AT_ONCE])


def _hodograph(points: Array) -> tuple[Array, Array, Array]:
    """Return the coefficients of the derivative divided by the degree, a u² + b u + c, each (k, 3)."""
    steps = np.diff(points, axis=1)
    zero = np.zeros_like(steps[:, 0])
    if steps.shape[1] == 3:
        return steps[:, 0] - 2 * steps[:, 1] + steps[:, 2], 2 * (steps[:, 1] - steps[:, 0]), steps[:, 0]
    return zero, (steps[:, 1] - steps[:, 0]) if steps.shape[1] == 2 else zero, steps[:, 0]


def _lengths(points: Array) -> Array:
    """Return the arc lengths of curves (k, degree + 1, 3) [m], (k,), by the method of :class:`ArcLength`."""
    powers = np.stack([p.T for p in _hodograph(points)]) * (points.shape[1] - 1)  # (3, 3, k), the highest first
    powers = powers[:, powers.any((0, 2))]  # a drawing lies in a plane
    ends = np.linspace(0.0, 1.0, _FIRST_CELLS + 1)
    curve = np.repeat(np.arange(len(points)), _FIRST_CELLS)
    a, b = (np.tile(side, len(points)) for side in (ends[:-1], ends[1:]))
    total, scale = np.zeros(len(points)), None
    while len(curve):
        middle, of = 0.5 * (a + b), powers[:, :, curve]
        whole, halves = _gauss(of, a, b), _gauss(of, a, middle) + _gauss(of, middle, b)
        scale = np.bincount(curve, halves, len(points)) if scale is None else scale
        coarse = (np.abs(halves - whole) > _ACCURACY * scale[curve]) | _turns(_derivative(of, np.stack([a, b], axis=1)))
        coarse &= b - a > _NARROWEST
        total += np.bincount(curve[~coarse], whole[~coarse], len(points))
        curve = np.repeat(curve[coarse], 2)
        a, b = (np.column_stack(sides)[coarse].ravel() for sides in ((a, middle), (middle, b)))
    return total


def _gauss(powers: Array, a: Array, b: Array) -> Array:
    """Return the length over cells from a to b (k,) [m], (k,)."""
    half = 0.5 * (b - a)[:, None]
    derivative = _derivative(powers, 0.5 * (a + b)[:, None] + half * _NODES)
    return half[:, 0] * (np.sqrt((derivative * derivative).sum(0)) @ _WEIGHTS)


def _turns(ends: Array) -> Array:
    """Return whether the directions at the ends of cells, (c, k, 2), differ too much for quadrature, (k,)."""
    before, after = np.moveaxis(ends / np.maximum(np.sqrt((ends * ends).sum(0)), np.finfo(float).tiny), -1, 0)
    return ((after - before) ** 2).sum(0) > _TURN**2


def _derivative(powers: Array, u: Array) -> Array:
    """Evaluate polynomials with coefficients (3, c, k) at u (k, m), (c, k, m); coordinates come first, for speed."""
    a, b, c = powers[..., None]
    return (a * u + b) * u + c


def _unit(derivatives: Array) -> Array:
    """Return the direction of the first of the derivatives (k, m, 3) that does not vanish, (k, 3); zero if all do."""
    speed = np.linalg.norm(derivatives, axis=-1)
    first = np.argmax(speed > 1e-9 * speed.max(-1, keepdims=True), axis=-1)
    row = np.arange(len(derivatives))
    return derivatives[row, first] / np.maximum(speed[row, first], np.finfo(float).tiny)[:, None]


def _bernstein(degree: int, u: Array) -> Array:
    """Return the Bernstein polynomials at u (*batch,), (*batch, degree + 1)."""
    i = np.arange(degree + 1)
    u = np.asarray(u)[..., None]
    return comb(degree, i) * u**i * (1 - u) ** (degree - i)
