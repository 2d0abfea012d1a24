"""The interface of a rule for the speed along a path, of which wrapped laws have one or several."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.errors import InputError


class Speed(NamedTuple):
    """A factor w of the speed along a path and its rate ẇ [1/s], (*batch,) each."""

    factor: Array
    rate: Array


class Moment(NamedTuple):
    """The state of affairs at one moment, from which rules choose the rate of their factors.

    Attributes:
        t: time [s].
        q: joint positions [rad], (*batch, n).
        qd: joint velocities [rad/s], (*batch, n).
        law: the law that is wrapped, at the factor w in use.
        out: its output with ẇ = 0.
        theta: ϑ(s) [1/s], (*batch,), where the plan goes at wϑ; 0 where it is braked at an end of its path.
        gradient: ∂τ/∂ẇ [N m s], (*batch, n), M(q)q_d'ϑ but for laws that say otherwise
            (:meth:`Controller.speed_gradient`): the torque demand is ``out.tau`` + ẇ ``gradient``.
        response: ∂ṡ/∂ẇ, (*batch,).
    """

    t: float
    q: Array
    qd: Array
    law: Controller
    out: ControlOutput
    theta: Array
    gradient: Array
    response: Array


def check_rows(name: str, rows: int, rollouts: int) -> None:
    """Check that a setting has a row for each of the rollouts, or one for all.

    Raises:
        InputError: it has not; the error says its ``name``.
    """
    if rows not in (1, rollouts):
        raise InputError(
            f"{name} has {rows} values for {rollouts} rollouts, expected as many, or one for all; give as many initial "
            "states, or one",
            argument=name.split()[0],
            value=rows,
            limit=rollouts,
        )


class SpeedRule(ABC):
    """A rule that makes of the speed that is asked for the speed that is taken.

    Its state x, (*batch, :attr:`size`), begins with the factor w that it takes; what follows is a memory of its own.
    The factor has no jumps: a rule chooses the rate of it.

    Attributes:
        size: length of the state.
        last: whether the rule comes after all others, because it knows what the motors can do.
        relative: whether the factor that :meth:`start` gives is of the speed that is asked for.
    """

    size: int = 1
    last: bool = False
    relative: bool = False

    @abstractmethod
    def start(self, law: Controller, q: Array, qd: Array, s: Array) -> Array:
        """Return the state x, (*batch, size), for an arm that starts at (q, q̇), (*batch, n), and a plan at s."""

    @abstractmethod
    def rate(self, moment: Moment, asked: Speed, x: Array) -> Array:
        """Return ẇ [1/s], (*batch,), where another rule, or the profile itself, asks for a speed."""

    def count_rows(self) -> int:
        """Return for how many rollouts the settings have a row, 1 for settings that are for all."""
        return 1

    def memory_rate(self, moment: Moment, asked: Speed, tau: Array, x: Array) -> Array:
        """Return the rate of the rest of the state, (*batch, size − 1), for the torque demand ``tau`` (*batch, n)."""
        return np.zeros((*x.shape[:-1], self.size - 1))

    def advance(self, x: Array, xdot: Array, period: float) -> Array:
        """Return the state one control ``period`` [s] after x."""
        return np.asarray(x + period * xdot)

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return the settings, for the configuration of a run."""
