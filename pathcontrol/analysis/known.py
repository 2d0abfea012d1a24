"""What a run knows: its path, where the caller does not say, and numbers, where its rollouts have not diverged."""

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
from pathcontrol.tasks.joined.sequence import PathSequence
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask


def known_task(run: Run, task: PathTask | None) -> PathTask:
    """``task``, or else that of the run.

    Raises:
        InputError: neither is known.
    """
    expect("run", run, Run)
    task = run.task if task is None else task
    if task is None:
        raise InputError("the run does not know its path, as it holds data only; give task=…")
    expect("task", task, PathTask)
    joints = len(run.array("joint"))
    if task.n != joints:
        raise InputError(f"the task has {task.n} joints, the run {joints}; expected as many")
    if isinstance(task, PathSequence):
        check_sequence(run.data, task)
    return task


def known_toolpath(run: Run, task: ToolpathTask | None) -> ToolpathTask:
    """``task``, or else that of the run, which is a toolpath.

    Raises:
        InputError: the task is none, or not known.
    """
    found = known_task(run, task)
    toolpath = as_toolpath(found)
    if toolpath is None:
        raise InputError(
            f"the run follows a {type(found).__name__}, expected a ToolpathTask; give task=…, or give "
            "it to simulate_sequence(…, task=…)"
        )
    return toolpath


def of_rollouts(function: Callable[[Run, PathTask], Array], run: Run, task: PathTask | None) -> Array:
    """Values (rollout, …) that a ``function`` gives of a run and the one task of all its rollouts, of each by its own.

    Raises:
        InputError: no task is known, or it is a batch for another number of rollouts.
    """
    values, rows = [], []
    for part, own, some in by_task(run, known_task(run, task)):
        values.append(function(part, own))
        rows.append(some)
    return np.concatenate(values)[np.argsort(np.concatenate(rows))]


def by_task(run: Run, task: PathTask) -> Iterator[tuple[Run, PathTask, NDArray[np.intp]]]:
    """The rollouts that have a task in common, as a run with its task, and their rows.

    Raises:
        InputError: ``task`` is a batch for another number of rollouts.
    """
    if not isinstance(task, TaskBatch):
        yield run, task, np.arange(run.rollouts)
        return
    if len(task) != run.rollouts:
        raise InputError(f"the TaskBatch has {len(task)} tasks, the run {run.rollouts} rollouts; expected as many")
    for own, rows in task.groups():
        yield run.with_data(run.data.isel(rollout=rows)), own, rows


def where_known(function: Callable[..., Array], *arrays: Array, shape: tuple[int, ...] = ()) -> Array:
    """``function`` (k, *shape) of arrays (rollout, time, …), one moment a row, where all are numbers; else NaN.

    So no path is asked where it is at a NaN, which a rollout that diverged leaves behind. Numbers with squares that are
    not finite count as none.
    """
    moments = arrays[0].shape[:2]
    known = np.all([(np.abs(a) < FARTHEST).reshape(*moments, -1).all(-1) for a in arrays], axis=0)
    if known.all():
        return function(*arrays)
    values = np.full(moments + shape, np.nan)
    if known.any():
        values[known] = function(*(a[known] for a in arrays))
    return values
