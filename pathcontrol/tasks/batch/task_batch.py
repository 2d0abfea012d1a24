"""A batch of tasks, one for each rollout, as the task of a batched simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array, merge_rows
from pathcontrol.errors import InputError
from pathcontrol.tasks.base import PathPoint, refuse_batch
from pathcontrol.tasks.batch.checks import check_same_kind, check_tasks, group_by_identity, summarize
from pathcontrol.tasks.profile import VelocityProfile
from pathcontrol.tasks.task import PathTask


class TaskBatch(PathTask):
    """One task for each of N rollouts: paths and velocity profiles may differ, joints may not.

    A controller takes it as its ``task``, and :func:`simulate` then N initial states, or one for all. Rollout i has the
    same result to the last bit as if it were alone with ``tasks[i]``.

    Its s has shape (*batch, N) and its q_d(s) (*batch, N, n), where i of the N belongs to tasks[i]. ``s0``, ``s_end``
    and ``period`` are numbers where all tasks have the same, else (N,).

    Each different task is evaluated once, for all rollouts that have it, one task after the other.

    Args:
        tasks: the tasks, one for each rollout, all closed or all open.

    Attributes:
        tasks: as given.

    Raises:
        InputError: tasks are for different numbers of joints, not all closed or all open, endless or no single task.
    """

    def __init__(self, tasks: Sequence[PathTask]) -> None:
        self.tasks = check_tasks(tasks)
        for i, task in enumerate(self.tasks):
            refuse_batch(f"tasks[{i}]", task)
        check_same_kind(self.tasks)
        self.s0, self.s_end = (_merge_numbers([getattr(task, name) for task in self.tasks]) for name in ("s0", "s_end"))
        if self.tasks[0].closed:
            self.period = _merge_numbers([task.period for task in self.tasks])
        self._n, self.rollouts = self.tasks[0].n, len(self.tasks)
        self.keep_tool(*self.tasks)

    def __len__(self) -> int:
        return len(self.tasks)

    def __iter__(self) -> Iterator[PathTask]:
        return iter(self.tasks)

    @property
    def n(self) -> int:
        return self._n

    def q_d(self, s: Array) -> Array:
        return self._evaluate("q_d", s, (self._n,))

    def dq_d(self, s: Array) -> Array:
        return self._evaluate("dq_d", s, (self._n,))

    def ddq_d(self, s: Array) -> Array:
        return self._evaluate("ddq_d", s, (self._n,))

    def theta(self, s: Array) -> Array:
        return self._evaluate("theta", s, ())

    def dtheta(self, s: Array) -> Array:
        return self._evaluate("dtheta", s, ())

    def at(self, s: Array) -> PathPoint:
        s = self._check_rollouts("s", s, 1)
        vectors, numbers = np.empty((3, *s.shape, self._n)), np.empty((2, *s.shape))
        for task, rows in self._groups:
            point = task.at(s[..., rows])
            for into, value in zip(vectors, point[:3], strict=True):
                into[..., rows, :] = value
            for into, value in zip(numbers, point[3:], strict=True):
                into[..., rows] = value
        return PathPoint(*vectors, *numbers)

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        q = self._check_rollouts("q", as_array("q", q), 2)
        start = None if near is None else np.broadcast_to(as_array("near", near), q.shape[:-1])
        s = np.empty(q.shape[:-1])
        for task, rows in self._groups:
            s[..., rows] = task.sigma_bar(q[..., rows, :], None if start is None else start[..., rows])
        return s

    @property
    def one_traverse(self) -> tuple[Any, Any]:
        return self.s0, self.s_end if self.period is None else self.s0 + self.period

    @property
    def sampled_interval(self) -> tuple[Any, Any]:
        return self.one_traverse

    def rows(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> PathTask:
        """Return the task of some ``rows``, a mask (N,) or numbers (k,); a single row gives its own task."""
        chosen = np.arange(len(self))[rows]
        if len(chosen) == 1:
            return self.tasks[chosen[0]]
        if np.array_equal(chosen, np.arange(len(self))):
            return self
        return TaskBatch([self.tasks[i] for i in chosen])

    def groups(self) -> list[tuple[PathTask, NDArray[np.intp]]]:
        """Return each different task with the rows (k,) that have it."""
        return list(self._groups)

    def with_profile(self, profile: VelocityProfile) -> TaskBatch:
        return TaskBatch([task.with_profile(profile) for task in self.tasks])

    def reversed(self) -> TaskBatch:
        return TaskBatch([task.reversed() for task in self.tasks])

    def shifted(self, offset: ArrayLike) -> TaskBatch:
        return TaskBatch([task.shifted(offset) for task in self.tasks])

    def scaled(self, factor: ArrayLike, about: ArrayLike | None = None) -> TaskBatch:
        return TaskBatch([task.scaled(factor, about) for task in self.tasks])

    def between(self, s0: float, s_end: float) -> TaskBatch:
        return TaskBatch([task.between(s0, s_end) for task in self.tasks])

    def by_arc_length(self) -> TaskBatch:
        return TaskBatch([task.by_arc_length() for task in self.tasks])

    def arc_length(self, s0: ArrayLike | None = None, s_end: ArrayLike | None = None) -> Array:
        return np.stack([task.arc_length(s0, s_end) for task in self.tasks], axis=-1)

    def __repr__(self) -> str:
        return f"TaskBatch({len(self)} tasks, {', '.join(self.describe()['kinds'])})"

    def describe(self) -> dict[str, Any]:
        """Return the number of tasks, their kinds and common values, and the range of numbers that differ."""
        every = [task.describe() for task, _ in self.groups()]
        kinds = list(dict.fromkeys(one.get("task", "unknown") for one in every))
        count = {"task": "TaskBatch", "tasks": len(self), "different": len(every), "kinds": kinds}
        return count | {name: value for name, value in summarize(every).items() if name != "task"}

    # --- inside ---------------------------------------------------------------------------------------------

    @cached_property
    def _groups(self) -> list[tuple[PathTask, NDArray[np.intp]]]:
        return [(self.tasks[rows[0]], rows) for rows in group_by_identity(self.tasks)]

    def _evaluate(self, method: str, s: Array, shape: tuple[int, ...]) -> Array:
        """Evaluate a method of all tasks at s (*batch, N), with values (*batch, N, *shape)."""
        s = self._check_rollouts("s", s, 1)
        values, whole = np.empty(s.shape + shape), [slice(None)] * len(shape)
        for task, rows in self._groups:
            where: tuple[Any, ...] = (..., rows, *whole)
            values[where] = getattr(task, method)(s[..., rows])
        return values

    def _check_rollouts(self, name: str, values: ArrayLike, axes: int) -> Array:
        """Check that the last ``axes`` of ``values`` begin with the rollouts; a single number is broadcast."""
        array = np.asarray(values, dtype=np.float64)
        if array.ndim == 0:
            return np.broadcast_to(array, len(self))
        if array.ndim < axes or array.shape[-axes] != len(self):
            expected = f"(*batch, {len(self)}{', n' if axes == 2 else ''})"
            raise InputError(
                f"{name} has shape {array.shape}, expected {expected}: there are {len(self)} tasks",
                argument=name,
                value=values,
            )
        return array


def select_rows(task: PathTask, rows: NDArray[np.bool_] | NDArray[np.intp]) -> PathTask:
    """Return the task of some rollouts, a mask (N,) or numbers (k,); a single task serves all of them."""
    return task.rows(rows) if isinstance(task, TaskBatch) else task


def map_tasks(task: PathTask, function: Callable[[PathTask], Any]) -> Any:
    """Apply a function to a task; for a TaskBatch, to each task, stacked as (N,) or (N, m)."""
    if not isinstance(task, TaskBatch):
        return function(task)
    groups = task.groups()
    each = np.array([function(one) for one, _ in groups], dtype=np.float64)
    values = np.empty((len(task), *each.shape[1:]))
    for value, (_, rows) in zip(each, groups, strict=True):
        values[rows] = value
    return values


def _merge_numbers(values: Sequence[Any]) -> Any:
    """Return the number that all values share, or else all of them, (N,)."""
    rows = merge_rows([np.asarray(value, dtype=np.float64) for value in values])
    return float(rows) if rows.ndim == 0 else rows
