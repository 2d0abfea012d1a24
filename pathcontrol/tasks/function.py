"""A path given by any function of the path parameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.errors import InputError
from pathcontrol.geometry.differentiation import Differentiator
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.domain import refuse_two_rates, take_domain
from pathcontrol.tasks.profile import ConstantRate, ConstantSpeed, Path, VelocityProfile
from pathcontrol.tasks.task import PathTask
from pathcontrol.tasks.vectorization import vectorize

_PROBES = (0.11, 0.27, 0.5, 0.68, 0.93)  # of the domain


class FunctionPath(PathTask):
    """A path given by a Python function of s, without a class of its own.

    The function may work on arrays, s (*batch,) to (*batch, n), or on numbers only, s to n values: that is found out
    once, and a function of numbers is called for each s. Derivatives that are not given are computed to about 1e-10.

    Args:
        function: q_d(s) [rad].
        speed: path speed ‖q̇‖ [rad/s]; or give ``theta``.
        theta: ϑ(s) [1/s], a function or a number.
        derivative: q_d'(s).
        second_derivative: q_d''(s).
        theta_derivative: ϑ'(s), for a function ``theta``.
        s0: first path parameter.
        s_end: last path parameter of an open path.
        period: period of q_d and ϑ of a closed path.

    Raises:
        InputError: a function fails or returns a wrong shape, the domain is empty, both or none of speed and theta.
    """

    def __init__(
        self,
        function: Callable[[Any], Any],
        speed: float | None = None,
        *,
        theta: Callable[[Any], Any] | float | None = None,
        derivative: Callable[[Any], Any] | None = None,
        second_derivative: Callable[[Any], Any] | None = None,
        theta_derivative: Callable[[Any], Any] | None = None,
        s0: float = 0.0,
        s_end: float = np.inf,
        period: float | None = None,
    ) -> None:
        take_domain(self, s0, s_end, period)
        refuse_two_rates(speed, theta)
        if theta_derivative and not callable(theta):
            raise InputError(
                "theta_derivative is given without a function theta, expected both or none",
                argument="theta_derivative",
                value=theta_derivative,
            )
        self.function = getattr(function, "__qualname__", type(function).__qualname__)
        probes = np.interp(_PROBES, [0, 1], self.sampled_interval)
        self._q_d = vectorize("function", function, probes, None)
        self._dq_d = vectorize("derivative", derivative, probes, self._q_d.shape) if derivative else None
        self._ddq_d = (
            vectorize("second_derivative", second_derivative, probes, self._q_d.shape) if second_derivative else None
        )
        self._profile: VelocityProfile
        if speed is not None:
            self._profile = ConstantSpeed(speed)
        elif not callable(theta):
            self._profile = ConstantRate(as_scalar("theta", theta, positive=True))
        else:
            rate = vectorize("theta", theta, probes, ())
            slope = vectorize("theta_derivative", theta_derivative, probes, ()) if theta_derivative else None
            self._profile = _FunctionProfile(rate, slope or partial(self._differentiator(rate), order=1))

    @property
    def by_hand(self) -> bool:
        return True

    def q_d(self, s: Array) -> Array:
        return self._q_d(s)

    def dq_d(self, s: Array) -> Array:
        return self._dq_d(s) if self._dq_d else super().dq_d(s)

    def ddq_d(self, s: Array) -> Array:
        if self._ddq_d:
            return self._ddq_d(s)
        return self._slope_derivative(s, 1) if self._dq_d else super().ddq_d(s)

    def theta(self, s: Array) -> Array:
        return self._profile.theta(self, s)

    def dtheta(self, s: Array) -> Array:
        return self._profile.dtheta(self, s)

    def at(self, s: Array) -> PathPoint:
        dq_d, ddq_d = self.dq_d(s), self.ddq_d(s)
        return PathPoint(self.q_d(s), dq_d, ddq_d, *self._profile.at(dq_d, ddq_d, self, s))

    def describe(self) -> dict[str, Any]:
        return super().describe() | self._profile.describe()

    @cached_property
    def _slope_derivative(self) -> Differentiator:
        return self._differentiator(self.dq_d)


@dataclass(frozen=True)
class _FunctionProfile(VelocityProfile):
    """A velocity profile given by ϑ and ϑ' as functions of s."""

    rate: Callable[[Array], Array]
    slope: Callable[[Array], Array]

    def theta(self, path: Path, s: Array) -> Array:
        return self.rate(s)

    def dtheta(self, path: Path, s: Array) -> Array:
        return self.slope(s)

    def describe(self) -> dict[str, Any]:
        return {"profile": "theta(s)"}
