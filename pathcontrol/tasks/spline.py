"""Paths given by splines."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, PPoly

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.geometry.periodic import wrap
from pathcontrol.tasks.curves import JointCurve


class SplinePath(JointCurve):
    """A path given by a spline q_d(s) of at least two continuous derivatives.

    Args:
        spline: a ``scipy.interpolate.BSpline`` of degree 3 or more with values of shape (n,); it begins at its first
            knot and ends at its last.
        speed: path speed ‖q̇‖ [rad/s].
        closed: whether the spline is periodic.

    Attributes:
        deviation: largest distance of a sample from a path made by :meth:`from_samples` [rad]; ``None`` for others.
    """

    deviation: float | None = None

    def __init__(self, spline: BSpline, speed: float, closed: bool = False) -> None:
        super().__init__(speed)
        if spline.k < 3:
            raise InputError(
                f"the spline has degree {spline.k}, expected 3 or more: q_d must be twice differentiable",
                argument="spline",
                value=spline.k,
                limit=3,
            )
        curve = _polynomials(spline)
        self._curves = [curve, curve.derivative(1), curve.derivative(2)]
        self.s0, last = float(curve.x[0]), float(curve.x[-1])
        if closed:
            self.period = last - self.s0
        else:
            self.s_end = last

    @staticmethod
    def from_samples(
        q: ArrayLike, speed: float, tolerance: float, s: ArrayLike | None = None, closed: bool = False
    ) -> SplinePath:
        """Fit a cubic spline with few knots to samples, ‖q_d(s_i) − q_i‖ ≤ ``tolerance``.

        Least squares on knots that are added where the tolerance is exceeded (de Boor, A Practical Guide to Splines,
        ch. XIV). Where the samples are noisier than the tolerance that ends at the spline through every sample, which
        follows the noise: choose a tolerance above the noise. ``deviation`` is what was reached.

        Args:
            q: postures along the path [rad], (m, n), m ≥ 2, or 3 for a closed path.
            speed: path speed ‖q̇‖ [rad/s].
            tolerance: largest distance of a sample from the path at its parameter [rad]; 0 to pass through each.
            s: increasing path parameters, (m,), and for a closed path one more for the return to the first sample. By
                default the length of the polygon through the samples; a posture that repeats the one before is then
                left out.
            closed: whether the path returns to its first sample.

        Raises:
            InputError: wrong shapes, fewer samples than a path needs, parameters that do not increase.
        """
        from pathcontrol.geometry.spline_fit import fit_samples

        spline, samples, parameters = fit_samples(q, s, tolerance, closed)
        path = SplinePath(spline, speed, closed)
        path.deviation = float(np.linalg.norm(path.q_d(parameters) - samples, axis=-1).max())
        return path

    @property
    def knots(self) -> Array:
        """The parameters where the pieces of the spline meet, both ends included, (K,)."""
        return self._curves[0].x

    def q_d(self, s: Array) -> Array:
        return self._curves[0](self._within(s))

    def dq_d(self, s: Array) -> Array:
        return self._curves[1](self._within(s))

    def ddq_d(self, s: Array) -> Array:
        return self._curves[2](self._within(s))

    def _within(self, s: Array) -> Array:
        if self.period is None:
            return np.asarray(s)
        return wrap(np.asarray(s), self.s0, self.period)


def _polynomials(spline: BSpline) -> PPoly:
    """Return the pieces as polynomials; to find that of an s takes hardly longer with more of them."""
    knots = np.unique(spline.t[spline.k : len(spline.t) - spline.k])
    # extrapolate: a periodic spline would round knots into its first lap, and so to the piece before
    taylor = [spline(knots[:-1], order, extrapolate=True) / factorial(order) for order in range(spline.k, -1, -1)]
    return PPoly(np.stack(taylor), knots)
