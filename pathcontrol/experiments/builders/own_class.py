"""A class from the user's own Python file, or from a module that is installed."""

from __future__ import annotations

import importlib.util
import inspect
import sys
import traceback
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from pathcontrol._expect import did_you_mean
from pathcontrol.errors import InputError
from pathcontrol.experiments.builders.file_errors import describe_error
from pathcontrol.registry import Kind, load


def find_own_class(folder: Path, source: str, name: str, kind: Kind) -> type:
    """Return the class ``name``, of a ``kind``, of a Python file, which is run once to define it, or of a module.

    Raises:
        InputError: the file is missing or fails, or has no such class; the message lists those it has.
    """
    base = load(kind.base)
    module = _load_file(folder / source) if source.endswith(".py") else _import_module(source)
    found = getattr(module, name, None)
    if isinstance(found, type) and issubclass(found, base):
        return found
    own = [key for key, value in vars(module).items() if _defines(module, value, base)]
    kinds = f"{base.__name__} subclass"
    there = f"its {kinds}es are {', '.join(own)}" if own else f"it defines no {kinds}"
    where = Path(source).name
    if found is None:
        raise InputError(
            f"there is no {name!r} in {where}{did_you_mean(name, own) or ';'} {there}",
            value=name,
            choices=tuple(own),
        )
    raise InputError(
        f"{name!r} in {where} is not a subclass of pathcontrol.{base.__name__}; {there}",
        value=name,
        choices=tuple(own),
    )


def _load_file(file: Path) -> ModuleType:
    if not file.is_file():
        raise InputError(
            f"there is no Python file {str(file)!r}; the path is relative to the TOML file",
            value=str(file),
            file=str(file),
        )
    return _run(file, file.read_bytes())


def _import_module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except (Exception, SystemExit) as error:
        raise InputError(
            f"the module {name!r} cannot be imported: {describe_error(error)}; a file beside the TOML file is named "
            "with its .py",
            value=name,
        ) from error


@lru_cache(maxsize=16)
def _run(file: Path, source: bytes) -> ModuleType:
    """Return the module of a file with this ``source``, the same one as long as the file has it."""
    module_name = f"pathcontrol_file_{file.stem}"
    spec = importlib.util.spec_from_file_location(module_name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module  # dataclasses look their module up there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[module_name]
        raise InputError(
            f"{file.name} fails{_line(error, file)} with {describe_error(error)}", file=str(file)
        ) from error
    return module


def _line(error: BaseException, file: Path) -> str:
    """Return `` at line N`` of the user's file, where the traceback passes through it."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(file)]
    return f" at line {lines[-1]}" if lines else ""


def _defines(module: ModuleType, value: object, base: type) -> bool:
    """Return whether a value is a class that can be made, defined by the module and derived from ``base``."""
    own = isinstance(value, type) and issubclass(value, base) and value.__module__ == module.__name__
    return own and not inspect.isabstract(value)
