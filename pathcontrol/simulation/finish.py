"""The end of a run: at rest at the end of an open path, or after a number of laps of a closed one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, check_whole
from pathcontrol._expect import expect_choice
from pathcontrol.control.ending import arrival_parameter
from pathcontrol.errors import InputError
from pathcontrol.tasks.batch.task_batch import map_tasks
from pathcontrol.tasks.task import PathTask

Until = Literal["end", "duration"]

_AT_REST = 1e-2  # rad/s (or m/s), the speed ‖q̇‖ of an arm at rest
_REST = 0.05  # s at rest; a shorter one may be the turning point of an oscillation
_MOST_LAPS = 2.0**62  # that a whole number of 64 bits may be


class Finish(ABC):
    """A rule by which rollouts finish, applied sample after sample; it records when each one did.

    Attributes:
        time: when each rollout was finished [s], NaN while it is not, (N,).
        ends_run: True if the run ends when all rollouts are finished.
    """

    def __init__(self, rollouts: int, ends_run: bool = True) -> None:
        self.time, self.ends_run = np.full(rollouts, np.nan), ends_run

    @abstractmethod
    def finished(self, t: float, s: Array, qd: Array) -> Array | None:
        """Return the times at which rollouts finished, as known at t [s], NaN for others, (N,); None for no news."""

    def __call__(self, t: float, s: Array, qd: Array, lost: NDArray[np.bool_]) -> bool:
        """Return whether the run ends at t [s]: all rollouts are finished, or ``lost`` (N,), having diverged.

        It takes the path parameters s (N,) and the joint velocities q̇ [rad/s], (N, n).
        """
        news = self.finished(t, s, qd)
        if news is None:
            return False
        self.time = np.where(np.isnan(self.time) & ~lost, news, self.time)
        return self.ends_run and not (np.isnan(self.time) & ~lost).any()


class AtEnd(Finish):
    """The rule for open paths: at most 0.1 mrad of the path are left to the plan and the arm has come to rest.

    At rest is an arm of ‖q̇‖ ≤ 0.01 rad/s for 50 ms; it is finished at the beginning of them. The arm may
    rest away from the end of the path: uncompensated friction holds it where K_p M(q) e_p is less.
    """

    def __init__(self, task: PathTask, rollouts: int, ends_run: bool = True) -> None:
        super().__init__(rollouts, ends_run)
        self._arrival = map_tasks(task, arrival_parameter)
        self._since = np.full(rollouts, np.inf)

    def finished(self, t: float, s: Array, qd: Array) -> Array | None:
        arrived = s >= self._arrival
        if not arrived.any():
            self._since[...] = np.inf
            return None
        resting = arrived & (np.linalg.norm(qd, axis=-1) <= _AT_REST)
        self._since = np.where(resting, np.minimum(self._since, t), np.inf)
        return np.where(t - self._since >= _REST * (1 - 1e-9), self._since, np.nan)


class AfterLaps(Finish):
    """The rule for closed paths: s has grown by ``laps`` periods since the start; the arm goes on moving."""

    def __init__(self, task: PathTask, laps: int, rollouts: int, ends_run: bool = True) -> None:
        super().__init__(rollouts, ends_run)
        self._task, self.laps = task, laps
        self._start: Array | None = None

    def finished(self, t: float, s: Array, qd: Array) -> Array | None:
        self._start = s if self._start is None else self._start
        done = count_laps(self._task, self._start, s) >= self.laps
        return np.where(done, t, np.nan) if done.any() else None


def count_laps(task: PathTask, start: Array, s: Array) -> Array:
    """Return how many laps lie between ``start`` and ``s``, negative backwards, integers (*batch,).

    They are 0 where s is not finite, and at most 2⁶² in size, which an arm that diverges may pass.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        laps = np.trunc((s - start) / task.period)
    return np.clip(np.where(np.isfinite(laps), laps, 0.0), -_MOST_LAPS, _MOST_LAPS).astype(np.int64)


def first_and_last(s: Array) -> tuple[Array, Array]:
    """Return the first and the last finite s of each rollout, (N,) each, from (N, time); 0 where there is none."""
    known = np.isfinite(s)
    last = s.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    rows, some = np.arange(len(s)), known.any(1)
    return np.where(some, s[:, 0], 0.0), np.where(some, s[rows, last], 0.0)


def detection_times(finish_time: Array, at_rest: bool) -> Array:
    """Return the times [s] at which it is known that rollouts finished at ``finish_time`` [s], (N,) each.

    They are later where the rule waits for rest, ``at_rest``, as on open paths.
    """
    return finish_time + (_REST * (1 - 1e-9) if at_rest else 0.0)


def make_finish(task: PathTask, laps: int | None, until: Until, rollouts: int) -> Finish | None:
    """Return the rule by which ``rollouts`` of ``task`` finish; None where nothing ends.

    Raises:
        InputError: ``laps`` is no whole number from 1, or the path is not closed.
        UnknownNameError: ``until`` is none of its choices.
    """
    expect_choice("until", until, get_args(Until))
    if laps is not None:
        _check_laps(task, laps)
        return AfterLaps(task, laps, rollouts, until == "end")
    return AtEnd(task, rollouts, until == "end") if np.all(np.isfinite(task.s_end)) else None


def _check_laps(task: PathTask, laps: Any) -> None:
    """Check that ``laps`` is a whole number from 1 and the path is closed."""
    check_whole("laps", laps)
    if not task.closed:
        raise InputError(
            f"laps = {laps}, but {type(task).__name__} is no closed path; leave laps out", argument="laps", value=laps
        )


def detection_ticks(finish: Finish | None, finish_time: Array, period: float) -> NDArray[np.int64]:
    """Return the ticks, of ``period`` [s], at which it is known that rollouts finished at ``finish_time`` [s], (N,)."""
    wait = _REST * (1 - 1e-9) if isinstance(finish, AtEnd) else 0.0
    tick = np.floor((np.nan_to_num(finish_time) + wait) / period) - 1
    for _ in range(3):
        tick = np.where(tick * period - np.nan_to_num(finish_time) >= wait, tick, tick + 1)
    return tick.astype(np.int64)
