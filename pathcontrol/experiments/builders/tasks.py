"""From ``[task]`` to a checked :class:`PathTask`."""

from __future__ import annotations

from typing import Any

from pathcontrol.experiments.builders.build_toolpath import build_toolpath
from pathcontrol.experiments.builders.file_errors import users_code
from pathcontrol.experiments.builders.making import Place, make
from pathcontrol.experiments.schema.toolpath_section import ToolpathSection
from pathcontrol.registry import PROFILES, TASKS
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.check import check_task
from pathcontrol.tasks.task import PathTask


def build_task(section: Any, robot: RobotModel, place: Place) -> PathTask:
    """The task for an arm, checked on samples of its domain.

    Raises:
        ExperimentError: it cannot be made, or returns what a task must not.
    """
    if isinstance(section, ToolpathSection):
        return build_toolpath(section, robot, place)
    task: PathTask = make("task", section, TASKS, place, {"robot": robot})
    if section.profile is not None:
        task = task.with_profile(make("task.profile", section.profile, PROFILES, place, {"robot": robot, "path": task}))
    with users_code("task", f"checking {type(task).__name__}"):
        check_task(task, robot.n)
    return task
