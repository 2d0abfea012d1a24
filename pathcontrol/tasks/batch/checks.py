"""Checks of the tasks of a batch, and the summary of their descriptions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._expect import expect
from pathcontrol.errors import InputError
from pathcontrol.tasks.task import PathTask


def check_tasks(tasks: Any) -> tuple[PathTask, ...]:
    """Check that ``tasks`` is a non-empty iterable of PathTask; return it as a tuple.

    Raises:
        InputError: they are not.
    """
    if isinstance(tasks, PathTask) or not isinstance(tasks, Iterable):
        raise InputError(
            f"tasks = {tasks!r}, expected a list of tasks, one for each rollout", argument="tasks", value=tasks
        )
    found = tuple(tasks)
    if not found:
        raise InputError("tasks is an empty list, expected a task for each rollout", argument="tasks", value=[])
    for i, task in enumerate(found):
        expect(f"tasks[{i}]", task, PathTask)
    return found


def group_by_identity(tasks: Sequence[PathTask]) -> list[NDArray[np.intp]]:
    """Return the rows (k,) of each different task."""
    rows: dict[int, list[int]] = {}
    for i, task in enumerate(tasks):
        rows.setdefault(id(task), []).append(i)
    return [np.array(some) for some in rows.values()]


def check_same_kind(tasks: Sequence[PathTask]) -> None:
    """Check that all tasks have the same number of joints, and that all are closed or all are open.

    Raises:
        InputError: they are not, or one neither ends nor repeats.
    """
    first, n = classify_end(tasks[0]), _joints(tasks, 0)
    for rows in group_by_identity(tasks):
        i, task = rows[0], tasks[rows[0]]
        if _joints(tasks, i) != n:
            raise InputError(
                f"tasks[{i}] is a path of {task.n} joints, tasks[0] of {n}; all rollouts are of one arm, so give each "
                "number of joints a batch of its own",
                argument=f"tasks[{i}]",
                value=task,
            )
        kind = classify_end(task)
        if kind == "endless":
            raise InputError(
                f"tasks[{i}], a {type(task).__name__}, neither ends nor repeats; give it a finite s_end, as "
                "task.between(s0, s_end), or a period",
                argument=f"tasks[{i}]",
                value=task,
            )
        if kind != first:
            raise InputError(
                f"tasks[{i}], a {type(task).__name__}, is {kind}, but tasks[0], a {type(tasks[0]).__name__}, is "
                f"{first}; give each kind a batch of its own, or make a closed path an open one with "
                "task.between(s0, s_end)",
                argument=f"tasks[{i}]",
                value=task,
            )


def summarize(every: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Merge several descriptions: equal values are kept, numbers that differ become shape, min and max."""
    first, merged = every[0], {}
    for name in first:
        values = [one[name] for one in every if name in one]
        if len(values) < len(every):
            continue
        if all(value == values[0] for value in values):
            merged[name] = values[0]
        elif all(isinstance(value, dict) for value in values):
            merged[name] = summarize(values)
        else:
            with suppress(ValueError):  # values that are no numbers, or have several shapes
                array = np.array(values)
                if array.dtype.kind in "iuf":
                    merged[name] = {"shape": list(array.shape), "min": array.min().item(), "max": array.max().item()}
    return merged


def classify_end(task: PathTask) -> str:
    """Return the kind of a path: ``"closed"``, ``"open"``, or ``"endless"``."""
    return "closed" if task.closed else "open" if np.isfinite(task.s_end) else "endless"


def _joints(tasks: Sequence[PathTask], i: int) -> int:
    """Return the number of joints of a task."""
    try:
        return tasks[i].n
    except (TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"tasks[{i}].q_d fails at s0 = {tasks[i].s0}: {error}; try check_task on it",
            argument=f"tasks[{i}]",
            value=tasks[i],
            s=tasks[i].s0,
        ) from error
