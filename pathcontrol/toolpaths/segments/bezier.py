"""Bézier curves, polynomial and rational, of which splines of drawings consist."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BPoly

from pathcontrol._arrays import Array, as_array, check_finite, freeze
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.segments.segment import Segment


@dataclass(frozen=True, eq=False)
class Bezier(Segment):
    """A Bézier curve p(u) = Σ Bᵢ(u) wᵢ pᵢ / Σ Bᵢ(u) wᵢ with Bernstein polynomials Bᵢ of any degree.

    Attributes:
        points: control points pᵢ [m], (degree + 1, 3).
        weights: wᵢ > 0, (degree + 1,), or None for a polynomial curve.
    """

    points: Array
    weights: Array | None = None

    def __post_init__(self) -> None:
        points = check_finite("points", as_array("points", self.points))
        if points.ndim != 2 or points.shape[1:] != (3,) or len(points) < 2:
            raise InputError(
                f"points have shape {points.shape}, expected (degree + 1, 3), degree ≥ 1",
                argument="points",
                value=points,
            )
        if not np.ptp(points, axis=0).any():
            raise InputError(
                f"all control points are the same, {points[0].tolist()}: the curve has no length",
                argument="points",
                value=points,
            )
        object.__setattr__(self, "points", freeze(points))
        if self.weights is not None:
            weights = check_finite("weights", as_array("weights", self.weights))
            if weights.shape != points.shape[:1] or not (weights > 0).all():
                raise InputError(
                    f"weights = {weights.tolist()}, expected {len(points)} weights greater than 0",
                    argument="weights",
                    value=weights,
                )
            object.__setattr__(self, "weights", freeze(weights))

    @classmethod
    def of_each(cls, points: Array) -> list[Bezier]:
        """Make a polynomial curve of each of the valid control points (k, degree + 1, 3), without checks."""
        points, curves = freeze(points), []
        for row in points:
            curve = object.__new__(cls)
            curve.__dict__.update(points=row, weights=None)
            curves.append(curve)
        return curves

    @property
    def first(self) -> Array:
        return self.points[0]

    @property
    def last(self) -> Array:
        return self.points[-1]

    def point(self, u: Array) -> Array:
        value = self._homogeneous[0](np.asarray(u))
        return value[..., :3] / value[..., 3:]

    def derivative(self, u: Array, order: int = 1) -> Array:
        u = np.asarray(u)
        value, first = self._homogeneous[0](u), self._homogeneous[1](u)
        weight = value[..., 3:]
        point = value[..., :3] / weight
        slope = (first[..., :3] - point * first[..., 3:]) / weight
        if order == 1:
            return slope
        second = self._homogeneous[2](u)
        return (second[..., :3] - point * second[..., 3:] - 2 * slope * first[..., 3:]) / weight

    def placed(self, pose: Array) -> Bezier:
        return Bezier(self.points @ pose[:3, :3].T + pose[:3, 3], self.weights)

    def reversed(self) -> Bezier:
        return Bezier(self.points[::-1], None if self.weights is None else self.weights[::-1])

    @cached_property
    def _homogeneous(self) -> list[BPoly]:
        """The polynomial (w p, w), and its two derivatives."""
        weights = np.ones(len(self.points)) if self.weights is None else self.weights
        coefficients = np.concatenate([self.points * weights[:, None], weights[:, None]], axis=1)
        curve = BPoly(coefficients[:, None], [0.0, 1.0])
        if len(coefficients) < 3:  # a second derivative needs a quadratic to differentiate
            return [curve, curve.derivative(), lambda u: np.zeros((*np.shape(u), 4))]
        return [curve, curve.derivative(1), curve.derivative(2)]
