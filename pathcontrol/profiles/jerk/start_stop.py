"""Smooth start and stop: jerk-limited ends around another velocity profile."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.arguments import Form, Unit
from pathcontrol.errors import TaskError
from pathcontrol.profiles.jerk.s_curve import Approach, SCurve
from pathcontrol.profiles.limited.grid import edges
from pathcontrol.profiles.motion import JointMotion, Motion, growth
from pathcontrol.tasks.profile import Path, VelocityProfile

_CELLS = 2000
_FIRST_INSTANT = 0.01  # s
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
Curve = SCurve | Approach


class SmoothStartStop(VelocityProfile):
    """A profile on an open path whose start and stop have limited acceleration and jerk, another in between.

    The speed v = ‖p'‖ϑ of the joints, or of a tool, rises by an S-curve, from ``start_speed`` at s0 to the speed of the
    other profile where it meets it, and falls likewise at the end; between the two ϑ is that of the other profile, if
    the path is long enough to reach it, and never larger. Where the other profile keeps v constant, v̇ is continuous and
    |v̇| and |v̈| are within the limits; elsewhere v̇ jumps by what the other profile has where it is met or is slower.

    The fall ends exponentially, v = d/T for a distance d left with T = 0.1 s, down to the speed that the jerk builds up
    in 10 ms, which is kept: never 0, where the motion plan ṡ = ϑ(s) would stop. At s_end − Tϑ(s_end) the controllers
    take over and bring the plan to rest on the same exponential; they hold the arm at s_end, where ``simulate`` reports
    it as finished.

    Args:
        path: the path that the profile is for; it has an end.
        profile: the profile between start and stop.
        acceleration: |v̇| ≤ ``acceleration`` [rad/s² or m/s²].
        jerk: |v̈| ≤ ``jerk`` [rad/s³ or m/s³].
        motion: whose speed v is, the joints' or a tool's.
        start_speed: v at the start, at most; by default what the jerk builds up in 10 ms. Laws that see only where the
            arm is, as ``Projection``, need more where dry friction that they do not compensate holds it at first.

    Raises:
        TaskError: the path is closed or has no end.
        InputError: a limit is not positive.
    """

    def __init__(
        self,
        path: Path,
        profile: VelocityProfile,
        acceleration: Annotated[float, Form.POSITIVE, Unit("rad/s^2", tool="m/s^2")],
        jerk: Annotated[float, Form.POSITIVE, Unit("rad/s^3", tool="m/s^3")],
        motion: Motion | None = None,
        start_speed: Annotated[float, Form.POSITIVE, Unit("rad/s", tool="m/s")] | None = None,
    ) -> None:
        _check_open(path)
        self.profile, self.motion = profile, JointMotion() if motion is None else motion
        self.acceleration = as_scalar("acceleration", acceleration, positive=True)
        self.jerk = as_scalar("jerk", jerk, positive=True)
        self._least = 0.5 * self.jerk * _FIRST_INSTANT**2
        self.start_speed = self._least if start_speed is None else as_scalar("start_speed", start_speed, positive=True)
        s = edges(path, _CELLS)
        self._distance = distance(path, self.motion, s)
        course = Course(s, lambda s: profile.theta(path, s) * self.motion.stretch(path, s)[0], self._distance)
        self._start, self._stop = course.ramps(
            lambda v: SCurve(self.start_speed, v, self.acceleration, self.jerk),
            lambda v: Approach(v, self.acceleration, self.jerk),
        )

    def theta(self, path: Path, s: Array) -> Array:
        return self.at(path.dq_d(s), path.ddq_d(s), path, s)[0]

    def dtheta(self, path: Path, s: Array) -> Array:
        return self.at(path.dq_d(s), path.ddq_d(s), path, s)[1]

    def at(self, dq_d: Array, ddq_d: Array, path: Path, s: Array) -> tuple[Array, Array]:
        dp, ddp = self.motion.of(path.q_d(s), dq_d, ddq_d)
        stretch, relative_growth = np.linalg.norm(dp, axis=-1), growth(dp, ddp)
        theta, dtheta = self.profile.at(dq_d, ddq_d, path, s)
        for v, slope in self._ramp_speeds(np.clip(s, path.s0, path.s_end)):
            slower = v < stretch * theta
            theta = np.where(slower, v / stretch, theta)
            dtheta = np.where(slower, slope - theta * relative_growth, dtheta)
        return theta, dtheta

    def knots(self, path: Path) -> Array | None:
        """Return the parameters where the ramps meet the profile, and that profile's own knots."""
        total = float(self._distance(self._distance.x[-1]))
        ends = [self._start.until, total - self._stop.until, total - self._stop.distance_at(self._least)]
        met = np.array(ends)
        inside = np.sort(met[(met > 0) & (met < total)])
        meetings = np.array([float(self._distance.solve(d, extrapolate=False)[0]) for d in inside])
        inner = self.profile.knots(path)
        return meetings if inner is None else np.union1d(meetings, inner)

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"motion": str(self.motion), "around": self.profile.describe()}

    def _ramp_speeds(self, s: Array) -> Iterator[tuple[Array, Array]]:
        """Yield v and dv/dσ of start and stop after the distance σ(s)."""
        covered = self._distance(s)
        yield self._start.speed(covered)
        v, slope = self._stop.speed(self._distance(self._distance.x[-1]) - covered)
        yield np.maximum(v, self._least), np.where(v < self._least, 0.0, -slope)


def _check_open(path: Path) -> None:
    """Check that a path has two ends."""
    if path.period is not None or not np.isfinite(path.s_end):
        raise TaskError(
            f"{type(path).__name__} has period = {path.period} and s_end = {path.s_end}: only an open path with a "
            "finite s_end has a start and a stop",
            value=path.s_end,
        )


def distance(path: Path, motion: Motion, s: Array) -> CubicHermiteSpline:
    """Return ∫‖p'‖ds from s[0], of a motion p(s), as a cubic spline through its values at the increasing s (m,).

    Four Gauss points a cell; value and slope are right at every knot, to the 8th and the machine's order, and the value
    between them to the 4th.
    """
    half = 0.5 * np.diff(s)[:, None]
    inside = s[:-1, None] + half * (1 + _NODES)
    cells = (motion.stretch(path, inside)[0] * half) @ _WEIGHTS
    return CubicHermiteSpline(s, np.append(0.0, np.cumsum(cells)), motion.stretch(path, s)[0])


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
