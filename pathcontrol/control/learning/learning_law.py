"""A law that adds to its torque what it has learned along its closed path."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, join_columns
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.control.learning.learned_table import LearnedTable
from pathcontrol.control.observer import CUTOFF, MomentumObserver
from pathcontrol.errors import InputError

_SAME_SPEED = 0.1  # from the profile's own speed, in its factor w, up to which a lap is learned from
_RESTING = 1e-9  # rad/s or m/s, rounding in the velocity of a joint that rests
_TURNED = 0.1  # −w from which on a plan that goes back has none of the learned torque


class LearningLaw(Controller):
    """The law inside :class:`Learned`: one that watches, with a table of torques.

    Its state z is that of the law inside, which begins with s and the memory of the observer, and after it the memory
    of the table.

    Args:
        law: the law that is helped.
        table: the table.

    Attributes:
        base: that law, watching.
        table: the table, as given.
    """

    observer: MomentumObserver

    def __init__(self, law: Controller, table: LearnedTable) -> None:
        self._given, self.table, self.base = law, table, law.watching()
        self.robot, self.task, self.friction, self.start_at = law.robot, law.task, law.friction, law.start_at
        self.ending, self._viscous, self.gains = law.ending, law._viscous, law.gains
        for name in law.gains:
            setattr(self, name, getattr(law, name))
        self.observer_hz = law.observer_hz
        self._take_observer()

    def start(self, q: ArrayLike, qd: ArrayLike) -> Array:
        z = self.base.start(q, qd)
        return join_columns([z, self.table.start(self._count_laps(z[..., 0]))])

    def recollect(self, z: Array, before: Array) -> Array:
        own, memory = self.split(z)
        return np.concatenate([own, self.table.recollect(memory, self.split(before)[1])], axis=-1)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        """Return the output of the law inside with τ̂(s) added, at the s of the middle of the period to come."""
        own, memory = self.split(z)
        out = self.base.law(t, q, qd, own)
        middle = out.s + 0.5 * self.observer.elapsed(t, self._observer_memory(own)) * out.sdot
        learned = self._fade()[..., None] * self.table.read(memory, self._count_laps(middle))
        zdot = join_columns([out.zdot, np.zeros_like(memory)])
        return out._replace(tau=out.tau + learned, zdot=zdot)

    def advance(self, z: Array, out: ControlOutput, period: float) -> Array:
        """Return the state after a period, in which what was missing before the tick is written into the table."""
        own, memory = self.split(z)
        seen = out.observation
        if seen is None:
            raise InputError(f"{type(self.base).__name__}.law does not watch; see Controller.compensate")
        h = self.observer.elapsed(seen.t, self._observer_memory(own))
        s = out.s - 0.5 * h * out.sdot
        time = np.where(out.regular & (np.abs(self._factor(s) - 1.0) <= _SAME_SPEED), h, 0.0)
        laps = self._count_laps(s)
        rests = np.abs(self.base.point(out.s).velocity - out.e_v) < _RESTING
        missing = np.where(rests, self.table.read(memory, laps), self._missing_torque(own, out, s))
        memory = self.table.write(memory, laps, missing, time, seen.t)
        inside = out._replace(zdot=out.zdot[..., : own.shape[-1]])
        return np.concatenate([self.base.advance(own, inside, period), memory], axis=-1)

    def rate(self, out: ControlOutput) -> Array:
        raise InputError(
            "a law learns from tick to tick, and not in continuous time; give loop=SampledLoop(...)", argument="loop"
        )

    def outcome(self, z: Array) -> dict[str, Array]:
        memory = self.table.split(self.split(z)[1])
        time = np.where(memory.forgotten > 0, memory.time, np.nan)
        return {"forgotten": memory.forgotten.astype(np.int64), "forgotten_time": time}

    def at_speed(self, factor: Array) -> Self:
        law = super().at_speed(factor)
        law.base = self.base.at_speed(factor)
        return law

    def watching(self, observer_hz: ArrayLike = CUTOFF) -> Self:
        """Return this law with the corner frequency of the observer inside, unless the law that is helped has one."""
        law = copy(self)
        law.base = self._given.watching(observer_hz)
        law._take_observer()
        return law

    def speed_response(self, s: Array, theta: Array) -> Array:
        return self.base.speed_response(s, theta)

    def speed_gradient(self, q: Array, qd: Array, s: Array, velocity: Array) -> tuple[Array, Array]:
        return self.base.speed_gradient(q, qd, s, velocity)

    def describe(self) -> dict[str, Any]:
        return self._given.describe()

    def split(self, z: Array) -> tuple[Array, Array]:
        """Return the state of the law inside and the memory of the table, (*batch, …) each."""
        return z[..., : -self.table.size], z[..., -self.table.size :]

    def _take_observer(self) -> None:
        """Take the observer of the law inside as this law's own."""
        if self.base.observer is None:
            raise InputError(f"{type(self.base).__name__}.watching gives no observer; see Controller.watching")
        self.observer = self.base.observer

    def _missing_torque(self, own: Array, out: ControlOutput, s: Array) -> Array:
        """Return the torque that model and law lacked since the tick before [N m], (*batch, n): −d − f̂(q̇).

        The middle of that time was at ``s`` (*batch,). Of a law that compensates what it observes it is r − d.
        """
        assert out.observation is not None
        lacks = -self.observer.mean_torque(out.observation, self._observer_memory(own))
        if self.friction == "observed":
            return lacks + out.observation.torque
        desired = self.base.point(s).velocity
        return np.asarray(lacks - self.base.friction_torque(desired - out.e_v, desired))

    def _observer_memory(self, own: Array) -> Array:
        """Return the memory of the observer in the state of the law inside."""
        return own[..., 1 : 1 + self.observer.size]

    def _count_laps(self, s: Array) -> Array:
        """Return s counted in laps from s0, (*batch,)."""
        period: Any = self.task.period
        return np.asarray((s - self.task.s0) / period)

    def _factor(self, s: Array) -> Array:
        """Return the factor w of the speed, (*batch,)."""
        return np.ones(s.shape) if self.speed is None else self.speed

    def _fade(self) -> Array:
        """Return the share of the learned torque that is added: 1, and to 0 for a plan that goes back."""
        return np.ones(()) if self.speed is None else np.clip(1.0 + self.speed / _TURNED, 0.0, 1.0)
