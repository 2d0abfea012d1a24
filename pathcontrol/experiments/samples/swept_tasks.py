"""The tasks of the samples of a sweep, and which of them are simulated together."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.making import Place
from pathcontrol.experiments.builders.tasks import build_duration, build_task
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.batch.checks import classify_end
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask


class SweptTask(NamedTuple):
    """The task of a sample, the longest time [s] that it is followed, and how many times."""

    task: PathTask
    duration: float
    laps: int | None


def build_tasks(experiments: Sequence[Experiment], model: RobotModel, base_dir: Path) -> list[SweptTask]:
    """Return the task of each of some samples for one arm; samples that say the same have the same one.

    Raises:
        ExperimentError: a task cannot be made, is a sequence, or returns what a task must not.
    """
    made: dict[str, SweptTask] = {}
    found = []
    for experiment in experiments:
        key = experiment.task.model_dump_json()
        if key not in made:
            task = build_task(experiment.task, model, Place(base_dir, experiment.to_radians))
            refuse_sequence(task)
            duration, laps = build_duration(experiment, task)
            made[key] = SweptTask(task, float(duration), laps)
        found.append(made[key])
    return found


def refuse_sequence(task: PathTask) -> None:
    """Refuse a sequence of paths, as a sweep is of single tasks."""
    if isinstance(task, PathSequence):
        raise ExperimentError("task: a sequence of paths cannot be swept; sweep one of its paths", argument="task")


def group_rows(tasks: Sequence[SweptTask]) -> list[NDArray[np.intp]]:
    """Return the rows of each batch: all closed or all open, of one duration; an endless path is for itself."""
    groups: dict[Hashable, list[int]] = {}
    for row, (task, duration, _) in enumerate(tasks):
        kind = classify_end(task)
        groups.setdefault((id(task) if kind == "endless" else kind, duration), []).append(row)
    return [np.array(rows) for rows in groups.values()]


def join_tasks(tasks: Sequence[SweptTask]) -> PathTask:
    """Return the task of all rollouts, or a batch of them."""
    first = tasks[0].task
    return first if all(one.task is first for one in tasks) else TaskBatch([one.task for one in tasks])
