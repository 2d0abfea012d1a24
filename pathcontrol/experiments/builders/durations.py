"""How long an experiment is simulated at most."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.tasks.joined.sequence import PathSequence
from pathcontrol.tasks.task import PathTask

_SAMPLES = 4001


def build_duration(experiment: Experiment, task: PathTask) -> tuple[float | Array, int | None]:
    """Longest simulated time [s], one for each path of a sequence, and the laps of a closed path.

    Raises:
        ExperimentError: the path has no end that a duration would follow from, or laps are asked of an open one.
    """
    laps = experiment.laps
    if laps is not None and (not task.closed or laps < 1):
        closed = "" if task.closed else f" of a closed path, but {type(task).__name__} is open; leave it out"
        raise ExperimentError(f"laps = {laps}, expected a whole number from 1{closed}")
    if experiment.duration is not None:
        return float(experiment.duration), laps
    if isinstance(task, PathSequence):
        return np.array([_generous(path) for path in task.paths]), None
    if laps is None and not np.isfinite(task.s_end):
        raise ExperimentError(f"duration: missing; {type(task).__name__} does not end by itself; give it or laps")
    return _generous(task, laps or 1), laps


def _generous(task: PathTask, laps: int = 1) -> float:
    """Twice the time that the path takes by ϑ, and 5 s [s]."""
    s = np.linspace(*task.one_traverse, _SAMPLES)
    return 2.0 * laps * float(np.trapezoid(1 / (task.theta(s) + np.zeros_like(s)), s)) + 5.0
