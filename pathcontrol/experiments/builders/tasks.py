"""The checked :class:`PathTask` made of ``[task]``."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.file_errors import report_by_key, report_users_code
from pathcontrol.experiments.builders.making import Place, arguments_of, check_joint_units, make
from pathcontrol.experiments.builders.poses import pose_of
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.experiments.schema.task_sections import ToolpathSection
from pathcontrol.registry import PROFILES, TASKS
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.tasks.task_check import check_task
from pathcontrol.toolpaths.read import read_toolpath

_SAMPLES = 4001


def build_task(section: Any, robot: RobotModel, place: Place) -> PathTask:
    """Return the task for an arm, checked on samples of its domain.

    Raises:
        ExperimentError: it cannot be made, or returns what a task must not.
    """
    if isinstance(section, ToolpathSection):
        return build_toolpath(section, robot, place)
    task: PathTask = make("task", section, TASKS, place, {"robot": robot})
    if section.profile is not None:
        task = task.with_profile(make("task.profile", section.profile, PROFILES, place, {"robot": robot, "path": task}))
    with report_users_code("task", f"checking {type(task).__name__}"):
        check_task(task, robot.n)
    return task


def build_toolpath(section: ToolpathSection, robot: RobotModel, place: Place) -> ToolpathTask:
    """Read the file and follow its contours with the arm.

    Raises:
        ExperimentError: the file cannot be used, or a contour cannot be followed.
    """
    workpiece = pose_of("task.workpiece", section.workpiece.arguments(place.to_radians))
    keys = {name.removeprefix("tool_"): name for name in (*section.reader_options, "feed")}
    with report_by_key("task.file", keys):
        toolpath = read_toolpath(place.folder / section.file, **section.reading)
    arguments = arguments_of("task", section, None, place)
    check_joint_units("task", ToolpathTask, arguments, robot)
    with report_by_key("task", list(type(section).model_fields)):
        return ToolpathTask(robot, arguments.pop("frame"), toolpath, workpiece, **arguments)


def build_duration(experiment: Experiment, task: PathTask) -> tuple[float | Array, int | None]:
    """Return the longest simulated time [s], one for each path of a sequence, and the laps of a closed path.

    Raises:
        ExperimentError: the path has no end that a duration would follow from, or laps are asked of an open one.
    """
    laps = experiment.laps
    if laps is not None and (not task.closed or laps < 1):
        closed = "" if task.closed else f" of a closed path, but {type(task).__name__} is open; leave it out"
        raise ExperimentError(f"laps = {laps}, expected a whole number from 1{closed}", argument="laps", value=laps)
    if experiment.duration is not None:
        return float(experiment.duration), laps
    if isinstance(task, PathSequence):
        return np.array([_generous_duration(path) for path in task.paths]), None
    if laps is None and not np.isfinite(task.s_end):
        raise ExperimentError(
            f"duration: missing; {type(task).__name__} does not end by itself; give it or laps", argument="duration"
        )
    return _generous_duration(task, laps or 1), laps


def _generous_duration(task: PathTask, laps: int = 1) -> float:
    """Return twice the time that the path takes by ϑ, and 5 s more [s]."""
    s = np.linspace(*task.one_traverse, _SAMPLES)
    return 2.0 * laps * float(np.trapezoid(1 / (task.theta(s) + np.zeros_like(s)), s)) + 5.0
