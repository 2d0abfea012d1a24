"""What a run knows: its path, where the caller does not say, and numbers, where its rollouts have not diverged."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.base import PathTask


def known_task(run: Run, task: PathTask | None) -> PathTask:
    """``task``, or else that of the run.

    Raises:
        InputError: neither is known.
    """
    task = run.task if task is None else task
    if task is None:
        raise InputError("the run does not know its path, as it holds data only; give task=…")
    return task


def known_toolpath(run: Run, task: ToolpathTask | None) -> ToolpathTask:
    """``task``, or else that of the run, which is a toolpath.

    Raises:
        InputError: the task is none, or not known.
    """
    found = known_task(run, task)
    if not isinstance(found, ToolpathTask):
        raise InputError(
            f"the run follows a {type(found).__name__}, expected a ToolpathTask; give task=…, or give "
            "it to simulate_sequence(…, task=…)"
        )
    return found


def where_known(function: Callable[..., Array], *arrays: Array) -> Array:
    """``function`` (k,) or (k, n) of arrays (rollout, time, …), one moment a row, where all are numbers; else NaN.

    So no path is asked where it is at a NaN, which a rollout that diverged leaves behind.
    """
    moments = arrays[0].shape[:2]
    known = np.all([np.isfinite(a).reshape(*moments, -1).all(-1) for a in arrays], axis=0)
    if known.all():
        return function(*arrays)
    found = function(*(a[known] for a in arrays)) if known.any() else np.empty(0)
    values = np.full(moments + found.shape[1:], np.nan)
    values[known] = found
    return values
