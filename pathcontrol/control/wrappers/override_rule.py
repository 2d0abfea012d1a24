"""The operator's input: how fast the plan is to go along its path, and which way."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.speed_rule import Moment, Speed, SpeedRule, check_rows
from pathcontrol.errors import InputError

#: u of the speed: a number, one for each rollout (N,), steps [[t, u], …], or a function of time [s]
Override = ArrayLike | Callable[[float], ArrayLike]

MOST = 2.0  # largest |u|
_SMOOTHING = 0.02  # s, time constant T of the rate of w
_ARRIVED = 1e-9  # distance of w from u, and from there in a time T, at which w is u


class GivenSpeed:
    """A speed that a function of time gives, checked whenever it is asked for."""

    def __init__(self, function: Callable[[float], ArrayLike]) -> None:
        self.function = function

    def __call__(self, t: float) -> Array:
        return _check_range(f"override at t = {t:g} s", self.function(t))


class FixedSpeed:
    """A speed that does not change: u, a number or (N,)."""

    def __init__(self, factor: Array) -> None:
        self.factor = freeze(factor)

    def __call__(self, t: float) -> Array:
        return self.factor


class SpeedSteps:
    """A speed that changes in steps: u(t) is that of the last step, and 1 before the first.

    Args:
        steps: times [s], increasing, and factors u, (m, 2).
    """

    def __init__(self, steps: ArrayLike) -> None:
        table = freeze(check_finite("override", as_array("override", steps)))
        if table.ndim != 2 or table.shape[1] != 2 or not len(table):
            raise InputError(
                f"override has shape {table.shape}, expected a number, (N,), or steps [[t, u], …], (m, 2)",
                argument="override",
                value=steps,
            )
        if (np.diff(table[:, 0]) <= 0).any():
            raise InputError(
                f"override has steps at {table[:, 0].tolist()} s, expected increasing times",
                argument="override",
                value=table[:, 0],
            )
        self.times, self.factors = table.T

    def __call__(self, t: ArrayLike) -> Array:
        i = np.searchsorted(self.times, t, side="right")
        return np.where(i > 0, self.factors[i - 1], 1.0)


@dataclass
class _Buttons:
    """The state of an operator's buttons, and the override u as it was given and as a function of time."""

    value: Callable[[float], Array]
    given: Any
    held: bool = False
    back: bool = False


class OverrideRule(SpeedRule):
    """The factor w follows u(t) within a bound of its rate, which has no jumps either.

    ẇ = v and Tv̇ = clip((u − w)/4T, ±a) − v with T = 20 ms: v changes with the time constant T between the bounds ±a,
    and w comes to u with both poles at −1/2T. The state is (w, v).

    Args:
        override: u, from −2 to 2.
        acceleration: largest |ẇ| [1/s].
    """

    size = 2
    relative = True

    def __init__(self, override: Override = 1.0, acceleration: float = 10.0) -> None:
        self.acceleration = as_scalar("acceleration", acceleration, positive=True)
        self._buttons = _Buttons(_make_function(override), _as_given(override))
        self._stopped = False

    def apart(self) -> Self:
        """Return this rule with the same buttons, which can be stopped beside them."""
        return copy(self)

    def stop(self) -> None:
        """Let the plan come to rest, whatever the buttons say, until :meth:`go`."""
        self._stopped = True

    def go(self) -> None:
        """Let the plan do what the buttons say."""
        self._stopped = False

    def hold(self) -> None:
        """Let the plan come to rest, whatever :meth:`override` says."""
        self._buttons.held = True

    def resume(self) -> None:
        """Let the plan go forward at the override."""
        self._buttons.held, self._buttons.back = False, False

    def reverse(self) -> None:
        """Let the plan go back at the override."""
        self._buttons.held, self._buttons.back = False, True

    def override(self, value: Override) -> None:
        """Set how fast the plan goes when it is not held; a number is not below 0, as :meth:`reverse` goes back."""
        if not callable(value) and np.ndim(value) < 2 and np.any(as_array("override", value) < 0):
            raise InputError(
                f"override = {value}, expected 0 to {MOST:g}; reverse() goes back",
                argument="override",
                value=value,
                limit=(0.0, MOST),
            )
        self._buttons.value, self._buttons.given = _make_function(value), _as_given(value)

    def value(self, t: float) -> Array:
        """Return u at time t [s], a number or (N,)."""
        if self._rests:
            return np.zeros(())
        u = self._buttons.value(t)
        return -u if self._buttons.back else u

    @property
    def _rests(self) -> bool:
        """True where the plan is to rest whatever the override is."""
        return self._stopped or self._buttons.held

    def values(self, times: Array, rollouts: int) -> Array:
        """Return u at ``times`` [s], (m, N); fewer rows where u is out of range at one of them but the first.

        Raises:
            InputError: it is out of range at the first, or has as many values as there are neither rollouts nor one.
        """
        given = self._buttons.value
        if self._rests or isinstance(given, FixedSpeed):
            return np.broadcast_to(self.value(0.0), (len(times), rollouts))
        if isinstance(given, SpeedSteps):
            steps = given(times)[:, None]
            return np.broadcast_to(-steps if self._buttons.back else steps, (len(times), rollouts))
        u = np.empty((len(times), rollouts))
        for row, t in enumerate(times):
            try:
                u[row] = self._value_of_rollouts(float(t), rollouts)
            except Exception:  # of the user's function, which the run may never come to
                if row == 0:
                    raise
                return u[:row]
        return u

    def _value_of_rollouts(self, t: float, rollouts: int) -> Array:
        """Return u at t [s], a number or (N,); check that there are as many values as rollouts."""
        u = self.value(t)
        if u.ndim and u.size != rollouts:
            check_rows(f"override at t = {t:g} s", u.size, rollouts)
        return u

    @property
    def is_known(self) -> bool:
        """True where u is known for all times, and is no function of the user's."""
        return self._rests or not isinstance(self._buttons.value, GivenSpeed)

    @property
    def factors(self) -> Array | None:
        """The factors of several rollouts that do not change, (N,); None where u is something else."""
        given = self._buttons.value
        fixed = given.factor if isinstance(given, FixedSpeed) else np.ones(())
        return fixed if fixed.ndim else None

    def count_rows(self) -> int:
        return self._buttons.value(0.0).size

    def start(self, law: Controller, q: Array, qd: Array, s: Array) -> Array:
        u = self.value(0.0)
        check_rows("override", u.size, s.size)
        u = np.broadcast_to(u, np.broadcast_shapes(s.shape, u.shape))
        return np.stack([u, np.zeros_like(u)], axis=-1)

    def rate(self, moment: Moment, asked: Speed, x: Array) -> Array:
        return x[..., 1]

    def memory_rate(self, moment: Moment, asked: Speed, tau: Array, x: Array) -> Array:
        u = self._value_of_rollouts(moment.t, x[..., 0].size)
        wanted = (asked.factor * u - x[..., 0]) / (4 * _SMOOTHING)
        wanted = np.minimum(np.maximum(wanted, -self.acceleration), self.acceleration)
        return ((wanted - x[..., 1]) / _SMOOTHING)[..., None]

    def advance(self, x: Array, xdot: Array, period: float) -> Array:
        """Return the state one ``period`` [s] after x: exact where u stays, and never beyond u for long periods.

        Within 1e-9 of u at rest w is u, so that a plan that is held has a state that no longer changes.
        """
        v, change = x[..., 1], xdot[..., 1]
        if not (v.any() or change.any()):  # w stays
            return x + 0.0
        wanted = v + _SMOOTHING * change
        bounded = np.abs(wanted) >= self.acceleration * (1 - 1e-12)
        gap = 4 * _SMOOTHING * wanted
        arrived = ~bounded & (np.maximum(np.abs(gap), _SMOOTHING * np.abs(v)) < _ARRIVED)
        new = np.empty(x.shape)
        if arrived.all():  # the common case
            new[..., 0], new[..., 1] = x[..., 0] + gap, 0.0
            return new
        ramp, approach = _advance_ramp(v, wanted, period), _advance_approach(v, wanted, period)
        step, v = (np.where(bounded, one, other) for one, other in zip(ramp, approach, strict=True))
        new[..., 0], new[..., 1] = x[..., 0] + np.where(arrived, gap, step), np.where(arrived, 0.0, v)
        return new

    def describe(self) -> dict[str, Any]:
        buttons = self._buttons
        given = getattr(buttons.given, "__name__", repr(buttons.given)) if callable(buttons.given) else buttons.given
        said = {"override": given, "acceleration": self.acceleration}
        return said | ({"held": True} if buttons.held else {"reversed": True} if buttons.back else {})


def _advance_ramp(v: Array, wanted: Array, period: float) -> tuple[Array, Array]:
    """Return the change of w and the new v where v comes to the bound ``wanted`` with the time constant T."""
    decay, time = np.exp(-period / _SMOOTHING), min(period, 4 * _SMOOTHING)
    return wanted * time + (v - wanted) * _SMOOTHING * (1 - decay), wanted + (v - wanted) * decay


def _advance_approach(v: Array, wanted: Array, period: float) -> tuple[Array, Array]:
    """Return the change of w and the new v where w comes to u = w + 4T ``wanted``: (A + Bt)exp(−t/2T) from u."""
    pole = 0.5 / _SMOOTHING
    decay, gap = np.exp(-pole * period), -4 * _SMOOTHING * wanted
    slope = v + pole * gap
    return decay * (gap + slope * period) - gap, decay * (v - pole * period * slope)


def _as_given(override: Override) -> Any:
    """Return an override as it is described: a function, or numbers."""
    return override if callable(override) else np.asarray(override).tolist()


def _make_function(override: Override) -> Callable[[float], Array]:
    """Return u as a function of time that gives nothing out of range."""
    if callable(override):
        return GivenSpeed(override)
    array = check_finite("override", as_array("override", override))
    if array.ndim > 1:
        steps = SpeedSteps(array)
        _check_range("override", steps.factors)
        return steps
    return FixedSpeed(_check_range("override", array))


def check_one_speed(value: Override, t: float) -> None:
    """Check that an override is for one arm, one that is a function at the time t [s].

    Raises:
        InputError: it has factors of several rollouts, or is out of range.
    """
    u = _make_function(value)(t)
    if u.size != 1:
        raise InputError(
            f"override = {u.tolist()}, expected one factor, as it is for one arm; a number, steps [[t, u], …], or a "
            "function of time",
            argument="override",
            value=u,
        )


def _check_range(name: str, u: ArrayLike) -> Array:
    """Return u as an array, (), or (N,); check its range."""
    array = as_array(name, u)
    if array.ndim > 1 or not array.size or not (np.abs(array) <= MOST).all():  # NaN is refused too
        raise InputError(
            f"{name} = {array.tolist()}, expected factors of the speed from {-MOST:g} to {MOST:g}, one for all "
            "rollouts or one for each: 1 is the profile itself, 0 holds, and less goes back",
            argument=name,
            value=u,
            limit=(-MOST, MOST),
        )
    return array
