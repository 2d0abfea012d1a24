"""The checked :class:`PathTask` made of ``[task]``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import did_you_mean
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import ExperimentError, InputError
from pathcontrol.experiments.builders.file_errors import report_by_key, report_users_code
from pathcontrol.experiments.builders.making import Place, arguments_of, check_joint_units, make
from pathcontrol.experiments.builders.poses import pose_of
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.experiments.schema.task_sections import ToolpathSection
from pathcontrol.registry import PROFILES, TASKS
from pathcontrol.robot.extent import FAR, extent
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.tasks.task_check import check_task
from pathcontrol.toolpaths.contour import Toolpath
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
        _check_drawing(place.folder, section.file)
        toolpath = read_toolpath(place.folder / section.file, **section.reading)
    arguments = arguments_of("task", section, None, place)
    check_joint_units("task", ToolpathTask, arguments, robot)
    with report_by_key("task", list(type(section).model_fields)):
        _check_place(section, robot, arguments["frame"], toolpath.placed(workpiece))
        return ToolpathTask(robot, arguments.pop("frame"), toolpath, workpiece, **arguments)


def _check_drawing(folder: Path, file: str) -> None:
    """Check that a drawing exists.

    Raises:
        InputError: it does not; the message names a file there with nearly the same name.
    """
    path = folder / file
    if not path.exists():
        there = [other.name for other in path.parent.iterdir() if other.is_file()] if path.parent.is_dir() else []
        raise InputError(
            f"there is no file {file!r} in {str(folder.resolve())!r}, the folder of the experiment file"
            f"{did_you_mean(path.name, there)}",
            file=str(path),
        )


def _check_place(section: ToolpathSection, robot: RobotModel, frame: str, placed: Toolpath) -> None:
    """Refuse a place of the workpiece from which all of the drawing is far beyond the arm: it is in millimetres.

    Raises:
        ExperimentError: it is.
    """
    lower, upper = placed.bounds
    away, reach = float(np.linalg.norm(np.maximum(np.maximum(lower, -upper), 0.0))), extent(robot, frame).reach
    if section.workpiece.position is not None and away > FAR * reach > 0:
        raise ExperimentError(
            f"task.workpiece.position = {section.workpiece.position} has the drawing {away:.4g} m from the base, but "
            f"{frame!r} of {robot.name} reaches some {reach:.2g} m; did you mean millimetres? Then give "
            f"'{section.workpiece.position[0]:g} mm' and so on",
            argument="task.workpiece.position",
            value=section.workpiece.position,
        )


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
        path = "a closed path" if task.closed else f"this {type(task).__name__}"
        raise ExperimentError(
            f"duration: missing; {path} does not end; give duration{' or laps' * task.closed}", argument="duration"
        )
    return _generous_duration(task, laps or 1), laps


def _generous_duration(task: PathTask, laps: int = 1) -> float:
    """Return twice the time that the path takes by ϑ, and 5 s more [s]."""
    s = np.linspace(*task.one_traverse, _SAMPLES)
    return 2.0 * laps * float(np.trapezoid(1 / (task.theta(s) + np.zeros_like(s)), s)) + 5.0
