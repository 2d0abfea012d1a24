"""The smooth curve that a tool follows."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol.arguments import Direction, Length, Point, Points
from pathcontrol.errors import InputError
from pathcontrol.geometry.closest_point import ClosestPoint, Curve
from pathcontrol.geometry.hermite import CurvePoint, hermite_polynomials
from pathcontrol.geometry.periodic import wrap
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.toolpaths.smoothing.corners import TURN_BACK, corners
from pathcontrol.toolpaths.smoothing.knots import smooth_knots


class ToolCurve:
    """A curve p(s) in space [m], twice continuously differentiable, s [m] close to its arc length.

    It is a quintic polynomial between knots where p, p' and p'' are given (Hermite interpolation).

    Args:
        s: knots [m], increasing, (k + 1,).
        p: position at the knots [m], (k + 1, 3).
        dp: dp/ds at the knots, (k + 1, 3).
        ddp: d²p/ds² at the knots [1/m], (k + 1, 3).
        closed: whether the last knot is the first one again.

    Attributes:
        s0: first parameter [m].
        s_end: last parameter [m]; a closed curve goes on with the period ``s_end - s0``.
        closed: whether the curve is closed.
        knots: where p''' may jump [m], (k + 1,).
        vertices: the points [m] that :meth:`polyline` was given, (m, 3); ``None`` for other curves.
    """

    vertices: Array | None = None

    def __init__(self, s: ArrayLike, p: ArrayLike, dp: ArrayLike, ddp: ArrayLike, closed: bool = False) -> None:
        self.knots = freeze(check_finite("s", as_array("s", s)))
        values = np.stack([check_finite(name, as_array(name, v)) for name, v in (("p", p), ("dp", dp), ("ddp", ddp))])
        if self.knots.ndim == 1 and (np.diff(self.knots) <= 0).any():
            i = int(np.argmax(np.diff(self.knots) <= 0))
            raise InputError(
                f"s[{i + 1}] = {self.knots[i + 1]:.17g} m after s[{i}] = {self.knots[i]:.17g} m, expected increasing "
                "knots; a curve much longer than its knots are far apart cannot tell them apart",
                argument="s",
                value=s,
            )
        if values.shape != (3, len(self.knots), 3) or len(self.knots) < 2:
            raise InputError(
                f"s has shape {self.knots.shape}, expected increasing knots and p, dp, ddp of (k + 1, 3)",
                argument="s",
                value=s,
            )
        if closed and not np.allclose(values[:, 0], values[:, -1], rtol=1e-6, atol=1e-9):
            raise InputError(
                "the curve is said to be closed, but its last knot is not its first one again",
                argument="closed",
                value=closed,
            )
        self.s0, self.s_end, self.closed = float(self.knots[0]), float(self.knots[-1]), bool(closed)
        curve = hermite_polynomials(self.knots, values)
        self._curves = [curve, curve.derivative(1), curve.derivative(2)]

    @property
    def length(self) -> float:
        """The length of the domain in s [m], which is that of the curve but for the blends of corners."""
        return self.s_end - self.s0

    def at(self, s: ArrayLike) -> CurvePoint:
        """Return position and derivatives at s (*batch,) [m]; an open curve is not continued beyond its ends."""
        inside = self._within(as_array("s", s))
        return CurvePoint(*(curve(inside) for curve in self._curves))

    def position(self, s: ArrayLike) -> Array:
        """Return p(s) [m], (*batch, 3)."""
        return self._curves[0](self._within(as_array("s", s)))

    def tangent(self, s: ArrayLike) -> Array:
        """Return the unit tangent p'/‖p'‖, (*batch, 3)."""
        dp = self._curves[1](self._within(as_array("s", s)))
        return dp / np.linalg.norm(dp, axis=-1, keepdims=True)

    def nearest(self, x: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Return the parameter of the point of the curve nearest to x (*batch, 3) [m], (*batch,).

        With ``near`` (*batch,), the one reached from there.
        """
        return self._closest_point(x, near)

    def distance(self, x: ArrayLike) -> Array:
        """Return the distance from points x (*batch, 3) to the curve [m], (*batch,)."""
        x = as_array("x", x)
        return np.linalg.norm(self.position(self.nearest(x)) - x, axis=-1)

    @cached_property
    def _closest_point(self) -> ClosestPoint:
        functions = (lambda s, c=c: c(self._within(s)) for c in self._curves)
        return ClosestPoint(Curve(*functions), self.s0, self.s_end, self.closed, self.knots)

    def _within(self, s: Array) -> Array:
        return wrap(s, self.s0, self.length) if self.closed else np.clip(s, self.s0, self.s_end)

    # --- curves given in closed form --------------------------------------------------------------------------

    @classmethod
    def line(cls, start: Point, end: Point) -> ToolCurve:
        """Return the straight line from ``start`` to ``end`` [m], each (3,)."""
        a, b = _vector("start", start), _vector("end", end)
        length = float(np.linalg.norm(b - a))
        if length == 0:
            raise InputError(
                f"start and end are the same point {a.tolist()}; a line needs a length", argument="end", value=end
            )
        direction = (b - a) / length
        return cls([0.0, length], [a, b], [direction, direction], np.zeros((2, 3)))

    @classmethod
    def circle(
        cls,
        center: Point,
        radius: Length,
        normal: Direction = (0.0, 0.0, 1.0),
        start: Direction = (1.0, 0.0, 0.0),
    ) -> ToolCurve:
        """Return a full circle, counterclockwise seen against ``normal``.

        Args:
            center: centre [m], (3,).
            radius: radius [m].
            normal: normal of its plane, (3,), of any length.
            start: direction from the centre in which the circle begins, (3,); its part in the plane is taken.
        """
        c, r, axis, towards = (
            _vector("center", center),
            as_scalar("radius", radius, positive=True),
            *_frame(normal, start),
        )
        pieces = max(16, int(np.ceil(2 * np.pi / (4.6e-5 / r) ** (1 / 6))))  # to 1 nm, see hermite.py
        angle = np.linspace(0.0, 2 * np.pi, pieces + 1)
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        sideways = np.cross(axis, towards)
        outward = cos * towards + sin * sideways
        return cls(r * angle, c + r * outward, cos * sideways - sin * towards, -outward / r, closed=True)

    @classmethod
    def spline(cls, points: Points, closed: bool = False) -> ToolCurve:
        """Return the C² cubic spline through points [m], (m, 3), parametrised by chord length.

        Args:
            points: m ≥ 4 points, or 5 for a closed curve, no two neighbours the same; the first is not repeated.
            closed: whether the curve returns to the first point.
        """
        given = check_finite("points", as_array("points", points))
        least = 5 if closed else 4
        if given.ndim != 2 or given.shape[1:] != (3,) or len(given) < least:
            raise InputError(
                f"points have shape {given.shape}, expected (m, 3) with at least {least} points",
                argument="points",
                value=points,
            )
        ring = np.concatenate([given, given[:1]]) if closed else given
        chords = np.linalg.norm(np.diff(ring, axis=0), axis=-1)
        if (chords == 0).any():
            i = int(np.argmin(chords))
            raise InputError(
                f"points {i} and {(i + 1) % len(given)} are the same, {given[i].tolist()}",
                argument="points",
                value=given[i],
            )
        s = np.concatenate([[0.0], np.cumsum(chords)])
        curve = make_interp_spline(s, ring, k=3, bc_type="periodic" if closed else "natural")
        return cls(s, ring, curve(s, 1), curve(s, 2), closed)

    @classmethod
    def polyline(cls, points: Points, tolerance: Length = 1e-4, closed: bool = False) -> ToolCurve:
        """Return straight edges through points [m], (m, 3), with corners blended; see :func:`smooth`.

        Args:
            points: m ≥ 2 points, no two neighbours the same.
            tolerance: largest distance between the edges and the curve [m].
            closed: whether an edge leads back to the first point, which is not repeated.

        Raises:
            InputError: the edges turn back by more than 150°, where the tool would have to stop.
        """
        given = as_array("points", points)
        edges = Polyline(np.concatenate([given, given[:1]]) if closed else given)
        contour = Contour((edges,), closed=closed)
        sharpest = max(corners(contour), key=lambda corner: corner.turn, default=None)
        if sharpest is not None and sharpest.turn > TURN_BACK:
            raise InputError(
                f"the edges turn back by {np.rad2deg(sharpest.turn):.0f}° at {sharpest.point.tolist()}, expected 150° "
                "at most; end a curve there and begin another",
                argument="points",
                value=sharpest.point,
            )
        curve = cls(*smooth_knots(contour, as_scalar("tolerance", tolerance, positive=True)).knots, closed=closed)
        curve.vertices = freeze(given)
        return curve


def _vector(name: str, value: ArrayLike) -> Array:
    vector = check_finite(name, as_array(name, value))
    if vector.shape != (3,):
        raise InputError(f"{name} has shape {vector.shape}, expected (3,)", argument=name, value=value)
    return vector


def _frame(normal: ArrayLike, start: ArrayLike) -> tuple[Array, Array]:
    """Return the unit normal of a plane and the unit vector in it nearest to ``start``."""
    axis, towards = _vector("normal", normal), _vector("start", start)
    if not np.linalg.norm(axis) > 0:
        raise InputError(f"normal = {axis.tolist()}, expected a vector with a length", argument="normal", value=normal)
    axis = axis / np.linalg.norm(axis)
    towards = towards - (towards @ axis) * axis
    if np.linalg.norm(towards) < 1e-9:
        raise InputError(
            f"start = {np.asarray(start).tolist()} points along the normal; give another direction",
            argument="start",
            value=start,
        )
    return axis, towards / np.linalg.norm(towards)
