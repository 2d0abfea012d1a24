"""A task class from the user's own Python file."""

from __future__ import annotations

import importlib.util
import inspect
import sys
import traceback
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.keyed import told
from pathcontrol.tasks.task import PathTask

_KEY = "task.type"


def own_class(file: Path, name: str) -> type[PathTask]:
    """The class ``name``, a :class:`PathTask` subclass, of a Python file, which is run once to define it.

    Raises:
        ExperimentError: the file is missing or fails, or has no such class; the message lists those it has.
    """
    if not file.is_file():
        raise ExperimentError(f"{_KEY}: there is no Python file {str(file)!r}; the path is relative to the TOML file")
    module = _run(file, file.read_bytes())
    found = getattr(module, name, None)
    if isinstance(found, type) and issubclass(found, PathTask):
        return found
    tasks = [key for key, value in vars(module).items() if _defined_task(value, module)]
    there = f"its PathTask subclasses are {', '.join(tasks)}" if tasks else "it defines no PathTask subclass"
    if found is None:
        problem = f"there is no {name!r} in {file.name}"
    else:
        problem = f"{name!r} in {file.name} is not a subclass of pathcontrol.PathTask"
    raise ExperimentError(f"{_KEY}: {problem}; {there}")


@lru_cache(maxsize=16)
def _run(file: Path, source: bytes) -> ModuleType:
    """The module of a file with this ``source``, the same one as long as it has it: so tasks are of one class."""
    module_name = f"pathcontrol_task_{file.stem}"
    spec = importlib.util.spec_from_file_location(module_name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module  # dataclasses look their module up there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[module_name]
        raise ExperimentError(f"{_KEY}: {file.name} fails{_line(error, file)} with {told(error)}") from error
    return module


def _line(error: BaseException, file: Path) -> str:
    """`` at line N`` of the user's file, where the traceback passes through it."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(file)]
    return f" at line {lines[-1]}" if lines else ""


def _defined_task(value: object, module: ModuleType) -> bool:
    own = isinstance(value, type) and issubclass(value, PathTask) and value.__module__ == module.__name__
    return own and not inspect.isabstract(value)
