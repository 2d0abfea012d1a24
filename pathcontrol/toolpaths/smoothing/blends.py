"""The trims of quintic blends: how far before and after a junction they begin and end.

A blend is the quintic that meets the contour a distance d before and after the junction with its tangent and
curvature there. It leaves the contour by less than a tolerance, which bounds d.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import comb

from pathcontrol._arrays import Array
from pathcontrol.geometry.hermite import CurvePoint, bezier_points
from pathcontrol.toolpaths.smoothing.corners import angles

#: position, tangent and curvature vector at arc lengths (*batch,) [m] away from a junction
Arm = Callable[[Array], CurvePoint]

_SMOOTH = 1e-9  # rad; smaller turns are ignored
_MOST_TURN = np.radians(160.0)  # rad, from one end of a blend to the other
_SLOWEST, _FASTEST = 0.5, 2.0  # ‖p'‖ of a blend
_SAMPLES = 65
_MARGIN = 0.99  # share of the tolerance, kept for deviations between samples
_TANGENT = 92.0  # where only the curvature jumps a blend deviates by 1/93 of d² times the jump


def blend_length(chord: Array, turn: Array) -> Array:
    """Return the length [m] of the arc of a circle with this chord [m] and turn [rad], as parameter of a blend."""
    half = 0.5 * np.asarray(turn)
    return np.where(half > 1e-6, chord * half / np.sin(np.maximum(half, 1e-6)), chord)


def straight_trims(turns: Array, tolerance: float) -> Array:
    """Return d [m] for corners between straight edges that turn by ``turns`` [rad], (k,).

    The blend passes the corner at e = d sin(θ/2)(1 − (5/16)θ cot(θ/2)), which is nowhere farther from the edges.
    """
    half = np.maximum(0.5 * turns, 0.5 * _SMOOTH)
    passes = np.sin(half) * (1 - 0.625 * half / np.tan(half))
    return np.where(turns > _SMOOTH, tolerance / passes, 0.0)


class Junction(NamedTuple):
    """A blend at a junction: its trim d [m] and its distance from the contour [m]; zeros for none."""

    trim: float
    deviation: float

    @classmethod
    def of(cls, before: Arm, after: Arm, longest: float, tolerance: float) -> Junction:
        """Return the longest blend with d up to ``longest``, or none where tangent and curvature are continuous."""
        zero = np.array(0.0)
        (_, t_a, k_a), (_, t_b, k_b) = before(zero), after(zero)
        turn, jump = float(angles(t_a, t_b)), float(np.linalg.norm(k_b - k_a))
        # a tenth of a nanometre away from the junction nothing shows
        if turn <= _SMOOTH and jump <= 1e-5 * (1 + np.linalg.norm(k_a) + np.linalg.norm(k_b)):
            return cls(0.0, 0.0)
        d = min(longest, float(straight_trims(np.array(max(turn, 2 * _SMOOTH)), tolerance)))
        d = min(d, float(np.sqrt(_TANGENT * tolerance / max(jump, 1e-12))))
        while (deviation := _deviation(before, after, d)) > _MARGIN * tolerance:
            d *= min(0.9, max(0.3, 0.97 * float(np.sqrt(tolerance / deviation))))
        return cls(d, deviation)


class Blends(NamedTuple):
    """Quintic blends, sampled evenly.

    Attributes:
        points: p [m], (*batch, n, 3).
        speed: ‖p'‖, (*batch, n).
    """

    points: Array
    speed: Array

    @classmethod
    def between(cls, start: CurvePoint, end: CurvePoint, length: Array, samples: int) -> Blends:
        """Return the blends from ``start`` to ``end`` (*batch, 3) over the parameter ``length`` (*batch,) [m]."""
        control = bezier_points(length, np.stack(start, axis=-2), np.stack(end, axis=-2))
        slopes = 5 * np.diff(control, axis=-2) / length[..., None, None]
        return cls(_bernstein(5, samples) @ control, np.linalg.norm(_bernstein(4, samples) @ slopes, axis=-1))

    def deviation(self, before: Array, after: Array) -> Array:
        """Return the Hausdorff distance from arms sampled at (*batch, m, 3) [m], (*batch,); ∞ if ‖p'‖ is far from 1."""
        there = np.minimum(_distance(self.points, before), _distance(self.points, after)).max(-1)
        back = np.maximum(_distance(before, self.points).max(-1), _distance(after, self.points).max(-1))
        even = (self.speed.min(-1) >= _SLOWEST) & (self.speed.max(-1) <= _FASTEST)
        return np.where(even, np.maximum(there, back), np.inf)


def _deviation(before: Arm, after: Arm, d: float) -> float:
    """Return the deviation of the blend over d [m] on either side [m]."""
    ways = np.linspace(0.0, d, _SAMPLES)
    a, b = before(ways), after(ways)
    start, end = CurvePoint(*(value[-1] for value in a)), CurvePoint(*(value[-1] for value in b))
    turn = angles(start.dp, end.dp)
    if turn > _MOST_TURN:
        return np.inf
    length = blend_length(np.asarray(np.linalg.norm(end.p - start.p)), turn)
    return float(Blends.between(start, end, length, _SAMPLES).deviation(a.p, b.p))


def _distance(x: Array, curve: Array) -> Array:
    """Return the distance from x (*batch, n, 3) to a curve sampled at (*batch, m, 3), (*batch, n).

    Through the squares of the distances from the nearest sample and its neighbours goes a parabola; it is exact for
    straight lines.
    """
    square = ((x[..., :, None, :] - curve[..., None, :, :]) ** 2).sum(-1)
    i = np.clip(square.argmin(-1), 1, curve.shape[-2] - 2)[..., None]
    a, b, c = (np.take_along_axis(square, i + step, -1)[..., 0] for step in (-1, 0, 1))
    slope, bend = 0.5 * (c - a), a - 2 * b + c
    t = np.clip(-slope / np.maximum(bend, np.finfo(float).tiny), -1.0, 1.0)
    return np.sqrt(np.maximum(b + t * slope + 0.5 * t**2 * bend, 0.0))


@cache
def _bernstein(degree: int, samples: int) -> Array:
    """Return the Bernstein polynomials of a degree at even parameters, (samples, degree + 1)."""
    u, k = np.linspace(0.0, 1.0, samples)[:, None], np.arange(degree + 1)
    return comb(degree, k) * u**k * (1 - u) ** (degree - k)
