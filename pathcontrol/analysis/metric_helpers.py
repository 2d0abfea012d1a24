"""Helpers of metrics: find the task of a run, apply a function per task, leave out what is not finite, and reduce."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.cartesian.recognition import as_toolpath
from pathcontrol.errors import InputError
from pathcontrol.geometry.closest_point.cells import FARTHEST
from pathcontrol.simulation.context import check_sequence
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask


def resolve_task(run: Run, task: PathTask | None) -> PathTask:
    """Return ``task``, or the run's own one by default, after checking that it fits.

    Raises:
        InputError: neither is known.
    """
    expect("run", run, Run)
    task = run.task if task is None else task
    if task is None:
        raise InputError("the run does not know its path, as it holds data only; give task=…", argument="task")
    expect("task", task, PathTask)
    joints = len(run.array("joint"))
    if task.n != joints:
        raise InputError(
            f"the task has {task.n} joints, the run {joints}; expected as many",
            argument="task",
            value=task.n,
            limit=joints,
        )
    check_sequence(run, task)
    return task


def is_along(own: PathTask | None, path: PathTask, s: Array) -> bool:
    """Return whether s (k,) of a run along its ``own`` path, where that is known, means the same along ``path``."""
    if own is None or own is path or isinstance(own, TaskBatch) or isinstance(path, TaskBatch):
        return True
    few = s[:: max(len(s) // 16, 1)]
    return bool(np.allclose(own.q_d(few), path.q_d(few), rtol=0.0, atol=1e-9))


def resolve_toolpath(run: Run, task: ToolpathTask | None) -> ToolpathTask:
    """Return ``task``, or the run's own one by default, which must be a toolpath.

    Raises:
        InputError: the task is none, or not known.
    """
    found = resolve_task(run, task)
    toolpath = as_toolpath(found)
    if toolpath is None:
        raise InputError(
            f"the run follows a {type(found).__name__}, expected a ToolpathTask; give task=…, or give "
            "it to simulate_sequence(…, task=…)",
            argument="task",
            value=found,
        )
    return toolpath


def apply_by_task(function: Callable[[Run, PathTask], Array], run: Run, task: PathTask | None) -> Array:
    """Apply a function of a run and a single task to the rollouts, with the task of each, (rollout, …).

    Raises:
        InputError: no task is known, or it is a batch for another number of rollouts.
    """
    values, rows = [], []
    for part, own, some in split_by_task(run, resolve_task(run, task)):
        values.append(function(part, own))
        rows.append(some)
    return np.concatenate(values)[np.argsort(np.concatenate(rows))]


def split_by_task(run: Run, task: PathTask) -> Iterator[tuple[Run, PathTask, NDArray[np.intp]]]:
    """Yield the rollouts that share a task, as a run with its task, and their rows.

    Raises:
        InputError: ``task`` is a batch for another number of rollouts.
    """
    if not isinstance(task, TaskBatch):
        yield run, task, np.arange(run.rollouts)
        return
    if len(task) != run.rollouts:
        raise InputError(
            f"the TaskBatch has {len(task)} tasks, the run {run.rollouts} rollouts; expected as many",
            argument="task",
            value=len(task),
            limit=run.rollouts,
        )
    for own, rows in task.groups():
        yield run.with_data(run.data.isel(rollout=rows)), own, rows


def apply_where_finite(function: Callable[..., Array], *arrays: Array, shape: tuple[int, ...] = ()) -> Array:
    """Apply ``function`` to the samples of arrays (rollout, time, …) that are finite; others are NaN.

    The function maps one moment a row to (k, *shape). So no path is evaluated at a NaN of a rollout that diverged.
    Numbers whose squares are not finite count as not finite.
    """
    moments = arrays[0].shape[:2]
    known = np.all([(np.abs(a) < FARTHEST).all(tuple(range(2, a.ndim))) for a in arrays], axis=0)
    if known.all():
        return function(*arrays)
    values = np.full(moments + shape, np.nan)
    if known.any():
        values[known] = function(*(a[known] for a in arrays))
    return values


def root_mean_square(values: Array) -> float:
    """Return the root mean square of all values."""
    return float(np.sqrt(np.mean(values**2)))
