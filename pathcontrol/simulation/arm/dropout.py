"""Control ticks that are missed, and measurements that do not come."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array, check_whole, freeze
from pathcontrol._expect import expect_choice
from pathcontrol.arguments import Form
from pathcontrol.errors import InputError
from pathcontrol.simulation.arm.disturbance import (
    Begin,
    Disturbance,
    Span,
    TimedDisturbance,
    check_rollouts,
    list_terms,
)

Lost = Literal["ticks", "measurements"]
Fallback = Literal["hold", "zero"]
_Marks = NDArray[np.bool_]  # (ticks, N)

_CHUNK = 256  # ticks whose random numbers are drawn together


class Dropout(TimedDisturbance):
    """Control ticks that are missed for a while, or measurements that do not come.

    At a tick that is missed the law does not run: its state stays, also the clock of motion control, which is the state
    of its plan; its last torque stays, or none acts. The run has there what the law said last, and ``regular`` False.
    Without measurements the law runs as ever and sees the last ones that came, so its plan goes on. Sensors and their
    filters go on in both cases: the first measurement that comes is right. A tick counts where the time covers the
    middle of the period that it begins. Continuous time does not know it.

    Args:
        start: when it begins [s], or for each rollout, (N,).
        duration: how long it lasts [s], or for each rollout, (N,).
        what: ``"ticks"`` are missed, or ``"measurements"`` do not come.
        fallback: at ticks that are missed ``"hold"`` the last torque, or ``"zero"``.
        probability: of each tick in that time to be lost, by itself, above 0 and up to 1, or for each rollout, (N,).
        seed: of these chances, a whole number from 0; rollout i has the same ones alone and among others.

    Raises:
        InputError: a probability is not in (0, 1], or a time is no number.
        UnknownNameError: ``what`` or ``fallback`` is something else.
    """

    def __init__(
        self,
        start: Begin = 0.0,
        duration: Span = np.inf,
        what: Lost = "ticks",
        fallback: Fallback = "hold",
        probability: Annotated[ArrayLike, Form.POSITIVE] = 1.0,
        seed: int = 0,
    ) -> None:
        super().__init__(start, duration)
        expect_choice("what", what, get_args(Lost))
        expect_choice("fallback", fallback, get_args(Fallback))
        chance = as_array("probability", probability)
        if chance.ndim > 1 or not ((chance > 0) & (chance <= 1)).all():
            raise InputError(
                f"probability = {chance.tolist()}, expected numbers above 0 and up to 1, one or (N,)",
                argument="probability",
                value=chance,
                limit=(0.0, 1.0),
            )
        self.what, self.fallback, self.probability = what, fallback, freeze(chance)
        self.seed = check_whole("seed", seed, 0)
        check_rollouts(start=self.start.shape, duration=self.duration.shape, probability=chance.shape)

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        """Return zeros: it pushes nothing."""
        rows = np.broadcast_shapes(np.shape(self.share(t))[:1], self.probability.shape)
        return np.zeros((*rows, q.shape[-1]))

    def acts(self, times: Array) -> _Marks:
        """Return when it may lose something, at times [s] (k,), as (k, N) or (k, 1)."""
        since = times[:, None] - np.atleast_1d(self.start)
        return (since >= 0) & (since < self.duration)


class Dropouts:
    """The ticks and measurements that are lost to the rollouts of a simulation.

    Args:
        disturbance: what may hold dropouts.
        period: of the loop [s].
        first: number of the first rollout.
        rollouts: how many there are.

    Attributes:
        any: whether there are any dropouts.
    """

    def __init__(self, disturbance: Disturbance | None, period: float, first: int, rollouts: int) -> None:
        self._terms = [term for term in list_terms(disturbance) if isinstance(term, Dropout)]
        self._period, self._first, self._rollouts = period, first, rollouts
        self._drawn: dict[tuple[int, int], Array] = {}
        self.any = bool(self._terms)

    def missed(self, ticks: NDArray[np.intp]) -> _Marks:
        """Return which rollouts miss some ticks (k,), counted from the start, (k, N)."""
        return self._find(ticks, lambda term: term.what == "ticks")

    def silent(self, ticks: NDArray[np.intp]) -> _Marks:
        """Return which rollouts have no torque at some ticks (k,) that they miss, (k, N)."""
        return self._find(ticks, lambda term: term.what == "ticks" and term.fallback == "zero")

    def stale(self, ticks: NDArray[np.intp]) -> _Marks:
        """Return to which rollouts no measurement comes at some ticks (k,), (k, N)."""
        return self._find(ticks, lambda term: term.what == "measurements")

    def _find(self, ticks: NDArray[np.intp], which: Callable[[Dropout], bool]) -> _Marks:
        """Return what some dropouts lose, (k, N)."""
        marks = np.zeros((len(ticks), self._rollouts), dtype=bool)
        for number, term in enumerate(self._terms):
            if not which(term) or not (acts := term.acts((ticks + 0.5) * self._period)).any():
                continue
            marks |= acts if (term.probability == 1).all() else acts & (self._draw(number, ticks) < term.probability)
        return marks

    def _draw(self, number: int, ticks: NDArray[np.intp]) -> Array:
        """Return random numbers from 0 to 1 for a dropout at some ticks (k,), (k, N)."""
        chunks = ticks // _CHUNK
        drawn = np.empty((len(ticks), self._rollouts))
        for chunk in np.unique(chunks).tolist():
            rows = chunks == chunk
            drawn[rows] = self._chunk(number, chunk)[ticks[rows] - chunk * _CHUNK]
        return drawn

    def _chunk(self, number: int, chunk: int) -> Array:
        """Return the random numbers of a dropout in a chunk of ticks, (ticks, N); the last one is kept."""
        if (number, chunk) not in self._drawn:
            self._drawn = {key: kept for key, kept in self._drawn.items() if key[0] != number}
            seed, ids = self._terms[number].seed, range(self._first, self._first + self._rollouts)
            streams = (np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(i, chunk))) for i in ids)
            self._drawn[number, chunk] = np.stack([stream.random(_CHUNK) for stream in streams], axis=1)
        return self._drawn[number, chunk]
