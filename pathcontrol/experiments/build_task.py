"""From ``[task]`` to a checked :class:`PathTask`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.build_profile import build_profile
from pathcontrol.experiments.build_toolpath import build_toolpath
from pathcontrol.experiments.keyed import keyed, users_code
from pathcontrol.experiments.own_class import own_class
from pathcontrol.experiments.task_sections import OwnTask
from pathcontrol.experiments.toolpath_section import ToolpathSection
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.check import check_task
from pathcontrol.tasks.curves import Circle, Ellipse, Line, Lissajous
from pathcontrol.tasks.task import PathTask

_CURVES: dict[str, type[PathTask]] = {
    "circle": Circle,
    "ellipse": Ellipse,
    "lissajous": Lissajous,
    "line": Line,
}


def build_task(section: Any, robot: RobotModel, base_dir: Path, to_radians: Callable[[float], float]) -> PathTask:
    """The task for an arm, checked on samples of its domain.

    Raises:
        ExperimentError: it cannot be made, or returns what a task must not.
    """
    if isinstance(section, ToolpathSection):
        return build_toolpath(section, robot, base_dir, to_radians)
    if isinstance(section, OwnTask):
        file, name = section.place
        with keyed("task.type"):
            made = own_class(base_dir / file, name)
        task = _make("task.parameters", made, section.parameters)
    else:
        task = _make("task", _CURVES[section.type], section.arguments(to_radians))
    with users_code("task", f"checking {type(task).__name__}"):
        if section.profile is not None:
            with keyed("task.profile", type(section.profile).model_fields):
                task = task.with_profile(build_profile(section.profile, task, robot, to_radians))
        check_task(task, robot.n)
    return task


def _make(key: str, made: type[PathTask], arguments: dict[str, Any]) -> PathTask:
    try:
        inspect.signature(made).bind(**arguments)
    except TypeError as error:
        raise ExperimentError(f"{key}: {error}; it is {made.__name__}{inspect.signature(made)}") from error
    with users_code(key, made.__name__, arguments):
        return made(**arguments)
