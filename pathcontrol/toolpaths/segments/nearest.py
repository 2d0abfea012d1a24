"""The nearest point on many Bézier curves, by one search over all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BPoly, PPoly

from pathcontrol._arrays import Array
from pathcontrol.geometry.closest_point import ClosestPoint, Curve
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Segment

_DEGREE = 3  # the degree that lower ones are raised to


def is_cubic(segment: Segment) -> bool:
    """Return whether a segment is a polynomial of degree 3 at most, written as a Bézier curve."""
    return isinstance(segment, Bezier) and segment.weights is None and len(segment.points) <= _DEGREE + 1


class Cubics:
    """Polynomials of degree 3 at most as one curve, p(i + u) = pᵢ(u), which may jump at each i.

    Args:
        segments: k segments that :func:`is_cubic` holds for.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        points = np.array([_raise_degree(segment.points) for segment in segments if isinstance(segment, Bezier)])
        knots = np.arange(len(points) + 1.0)
        p = PPoly.from_bernstein_basis(BPoly(np.moveaxis(points, 1, 0), knots))
        self._curve = Curve(p, p.derivative(), p.derivative(2))
        self._nearest = ClosestPoint(self._curve, 0.0, knots[-1], closed=False, knots=knots, kinks=knots[1:-1])

    def distance(self, x: Array) -> Array:
        """Return the distance from each row of x (N, 3) to the nearest segment [m], (N,); NaN where x is not finite."""
        return np.linalg.norm(self._curve.p(self._nearest(x)) - x, axis=-1)


def _raise_degree(points: Array) -> Array:
    """Return the control points (4, 3) of a curve given by (degree + 1, 3), raised to degree 3."""
    while len(points) <= _DEGREE:
        share = np.arange(1, len(points))[:, None] / len(points)
        inner = share * points[:-1] + (1 - share) * points[1:]
        points = np.concatenate([points[:1], inner, points[-1:]])
    return points
