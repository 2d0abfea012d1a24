"""Which of many tasks can be evaluated together: what is stacked has been seen to give the bits of each one alone."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, as_slice
from pathcontrol.tasks.base import PathTask
from pathcontrol.tasks.stacking import skeleton, stacked

_GOLDEN = (5**0.5 - 1) / 2
_TRIED = 16  # parameters of each task
_AWAY = np.array([1e-3, 0.3])  # rad from the path, where projections are tried

#: what is asked of a task at s (*batch, k)
_Question = Callable[[PathTask, Array], Sequence[Array]]


class Part:
    """Rows that are evaluated together.

    Args:
        task: takes s (*batch, k), one for each of the rows: the task that all of them have, or all tasks stacked.
        rows: k rows.
        own: the task of each row, where they are stacked.
    """

    def __init__(self, task: PathTask, rows: NDArray[np.intp], own: Sequence[PathTask] = ()) -> None:
        self.task, self.rows, self._own = task, as_slice(rows), own

    def sigma_bar(self, q: Array, near: Array | None) -> Array:
        """σ̄ (*batch, k) of each row's task at q (*batch, k, n), from ``near`` (*batch, k) where it is given."""
        if self._projects:
            return self.task.sigma_bar(q, near)
        starts = [None if near is None else near[..., [i]] for i in range(len(self._own))]
        found = [task.sigma_bar(q[..., [i], :], starts[i]) for i, task in enumerate(self._own)]
        return np.concatenate(found, axis=-1)

    @cached_property
    def _projects(self) -> bool:
        """Whether the projection of the stack is that of each task; tried when it is first asked for."""
        return not self._own or _agrees(self.task, self._own, _parameters(self._own)[0], _projections)


def together(tasks: Sequence[PathTask]) -> list[Part]:
    """The parts of a batch, with as many rows in each as can be."""
    parts = []
    for rows in _grouped(_skeleton(task) for task in tasks):
        own = [tasks[i] for i in rows]
        stack = _stack(own)
        parts += one_by_one(own, rows) if stack is None else [Part(stack, rows, own)]
    return parts


def one_by_one(tasks: Sequence[PathTask], rows: NDArray[np.intp] | None = None) -> list[Part]:
    """A part for each different task, which has the ``rows`` (k,) that say so; by default all."""
    rows = np.arange(len(tasks)) if rows is None else rows
    return [Part(tasks[some[0]], rows[some]) for some in by_identity(tasks)]


def by_identity(tasks: Sequence[PathTask]) -> list[NDArray[np.intp]]:
    """The rows of each different task."""
    return _grouped(id(task) for task in tasks)


def _grouped(keys: Iterable[Hashable]) -> list[NDArray[np.intp]]:
    groups: dict[Hashable, list[int]] = {}
    for i, key in enumerate(keys):
        groups.setdefault(key, []).append(i)
    return [np.array(rows) for rows in groups.values()]


def _skeleton(task: PathTask) -> Hashable:
    try:
        return skeleton(task)
    except RecursionError:  # it holds itself
        return id(task)


def _stack(tasks: Sequence[PathTask]) -> PathTask | None:
    """Different tasks stacked, None if each is better asked alone."""
    if all(task is tasks[0] for task in tasks):
        return None
    try:
        stack, s = stacked(tasks), _parameters(tasks)
    except Exception:  # a class of the user's may do anything
        return None
    alike = all(_agrees(stack, tasks, tried, _values) for tried in (s[0], s[1], s))
    return stack if alike else None


def _parameters(tasks: Sequence[PathTask]) -> Array:
    """Irregular parameters inside every task, (tried, N), ends included; of closed ones laps before and after too."""
    lower, upper = np.array([task.one_traverse for task in tasks]).T
    share = np.modf(_GOLDEN * np.arange(1, _TRIED * len(tasks) + 1))[0].reshape(_TRIED, -1)
    share = 3 * share - 1 if tasks[0].closed else np.clip(1.2 * share - 0.1, 0.0, 1.0)
    return lower + share * (upper - lower)


def _agrees(stack: PathTask, tasks: Sequence[PathTask], s: Array, ask: _Question) -> bool:
    """Whether the stack answers at s (*batch, N) to the last bit as each task at its s (*batch, 1)."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            answers = ask(stack, s)
            alone = [ask(task, s[..., [i]]) for i, task in enumerate(tasks)]
            joined = [np.concatenate(rows, axis=s.ndim - 1) for rows in zip(*alone, strict=True)]
    except Exception:  # what works with its numbers need not work with arrays in their place
        return False
    return all(np.array_equal(a, b) for a, b in zip(answers, joined, strict=True))


def _values(task: PathTask, s: Array) -> list[Array]:
    zero = np.zeros_like(s)  # ϑ may be a plain number
    return [task.q_d(s), task.dq_d(s), task.ddq_d(s), task.theta(s) + zero, task.dtheta(s) + zero, *task.at(s)]


def _projections(task: PathTask, s: Array) -> list[Any]:
    """Of postures near to the path and away from it, at s (k,)."""
    point, near = task.at(s), s + 0.01
    aside = np.cos(3.0 * s)[:, None] * point.dq_d[:, ::-1]
    close, far = (point.q_d + away * aside for away in _AWAY)
    return [task.sigma_bar(far), *(task.sigma_bar(q, near) for q in (close, far))]
