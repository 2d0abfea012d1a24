"""What a run knows of its path, where the caller does not say."""

from __future__ import annotations

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
