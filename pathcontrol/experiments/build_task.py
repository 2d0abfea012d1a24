"""From ``[task]`` to a checked :class:`PathTask`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.keyed import keyed, users_code
from pathcontrol.experiments.own_class import own_class
from pathcontrol.experiments.task_sections import OwnTask, Profile, SpeedProfile, TaskSection
from pathcontrol.tasks.base import PathTask
from pathcontrol.tasks.check import check_task
from pathcontrol.tasks.curves import Circle, Ellipse, Line, Lissajous
from pathcontrol.tasks.profile import ConstantRate, ConstantSpeed, VelocityProfile

_CURVES: dict[str, type[PathTask]] = {
    "circle": Circle,
    "ellipse": Ellipse,
    "lissajous": Lissajous,
    "line": Line,
}


def build_task(section: Any, n: int, base_dir: Path, to_radians: Callable[[float], float]) -> PathTask:
    """The task for an arm of ``n`` joints, checked on samples of its domain.

    Raises:
        ExperimentError: it cannot be made, or returns what a task must not.
    """
    if isinstance(section, OwnTask):
        file, name = section.place
        with keyed("task.type"):
            made = own_class(base_dir / file, name)
        task = _make("task.parameters", made, section.parameters)
    else:
        task = _make("task", _CURVES[section.type], section.arguments(to_radians))
    with users_code("task", f"checking {type(task).__name__}"):
        task = _with_profile(task, section, to_radians)
        check_task(task, n)
    return task


def _make(key: str, made: type[PathTask], arguments: dict[str, Any]) -> PathTask:
    try:
        inspect.signature(made).bind(**arguments)
    except TypeError as error:
        raise ExperimentError(f"{key}: {error}; it is {made.__name__}{inspect.signature(made)}") from error
    with users_code(key, made.__name__, arguments):
        return made(**arguments)


def _with_profile(task: PathTask, section: TaskSection, to_radians: Callable[[float], float]) -> PathTask:
    return task if section.profile is None else task.with_profile(_profile(section.profile, to_radians))


def _profile(section: Profile, to_radians: Callable[[float], float]) -> VelocityProfile:
    arguments = section.arguments(to_radians)
    return ConstantSpeed(**arguments) if isinstance(section, SpeedProfile) else ConstantRate(**arguments)
