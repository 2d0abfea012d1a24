"""Ramps from the ends of a path to the speed of a profile, where they meet it or each other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from pathcontrol._arrays import Array
from pathcontrol.profiles.jerk.s_curve import Approach, SCurve

Curve = SCurve | Approach


class Ramp(NamedTuple):
    """A curve of speed over distance that holds up to the distance ``until``, where a profile takes over."""

    curve: Curve
    until: float

    def speed(self, distance: Array) -> tuple[Array, Array]:
        """Return v and dv/dd at a ``distance`` d (*batch,) from the end of the path; ``inf`` and 0 beyond ``until``."""
        over = distance >= self.until
        if over.all():  # true nearly all along a path
            return np.full_like(distance, np.inf), np.zeros_like(distance)
        v, slope = self.curve.speed(distance)
        return np.where(over, np.inf, v), np.where(over, 0.0, slope)

    def distance_at(self, speed: float) -> float:
        """Return the distance at which the curve reaches a ``speed``; 0 where it never does."""
        most = float(self.curve.length)
        if not float(self.curve.speed(np.asarray(most))[0]) > speed:
            return 0.0
        return float(brentq(lambda d: float(self.curve.speed(np.asarray(d))[0]) - speed, 0.0, most, xtol=1e-15))


class Course(NamedTuple):
    """A profile between two ramps: speed v(s) and distance σ(s) covered, at increasing parameters ``s`` (m,)."""

    s: Array
    speed: Callable[[Array], Array]
    distance: Callable[[Array], Array]

    def ramps(self, rise: Callable[[Any], Curve], fall: Callable[[Any], Curve]) -> tuple[Ramp, Ramp]:
        """Return the first and the last ramp, up to the profile's speed, or on a short path up to where they meet."""
        total = self.distance(self.s[-1])
        first = self._meeting_speed(self.s, self.distance, rise)
        last = self._meeting_speed(self.s[::-1], lambda s: total - self.distance(s), fall)
        highest = np.inf
        if rise(first).length + fall(last).length > total:
            highest = _find_root(lambda v: rise(v).length + fall(v).length - total)
        return _ramp(rise, first, highest), _ramp(fall, last, highest)

    def _meeting_speed(self, s: Array, distance: Callable[[Array], Array], curve: Callable[[Any], Curve]) -> float:
        """Return the profile's speed where a ramp up to it first fits into the distance; ``inf`` if nowhere."""

        def spare(s: Array) -> Array:
            return distance(s) - curve(self.speed(s)).length

        fits = spare(s) >= 0
        first = int(np.argmax(fits))
        if not fits[first]:
            return np.inf
        return float(self.speed(np.asarray(brentq(spare, s[first - 1], s[first]) if first else s[0])))


def _ramp(curve: Callable[[Any], Curve], speed: float, highest: float) -> Ramp:
    """Return the ramp to a speed, or to the highest that is reached."""
    met = curve(np.asarray(min(speed, highest)))
    return Ramp(met, float(met.length) if speed <= highest else np.inf)


def _find_root(function: Callable[[Any], Array]) -> float:
    """Return the root of an increasing function of a speed."""
    most = 1.0
    while function(np.asarray(most)) < 0:
        most *= 2
    return brentq(function, 1e-12 * most, most)
