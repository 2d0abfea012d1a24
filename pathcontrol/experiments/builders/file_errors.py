"""The translation of errors of the library into errors of an experiment file."""

from __future__ import annotations

import contextlib
import json
import re
import sysconfig
import traceback
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pathcontrol._advice import reword_advice
from pathcontrol._expect import did_you_mean
from pathcontrol._units import Quantity, list_units
from pathcontrol.errors import ExperimentError, PathControlError

_PACKAGE = Path(__file__).parents[2]
_INSTALLED = {"site-packages", "dist-packages"}
_LISTS = str.maketrans("()", "[]")  # of Python and of TOML


@contextlib.contextmanager
def report_by_key(key: str, fields: Iterable[str] | Mapping[str, str] = ()) -> Iterator[None]:
    """Turn errors inside the block into ExperimentErrors whose message begins with the key path.

    A message that begins with one of the ``fields`` of the section ``key``, as ``K_v = -1.0, expected …``,
    becomes ``controller.K_v = …``; advice to give one of them, as ``unit='mm'``, becomes a line of the file. Where a
    field has another name there than the argument, ``fields`` is a mapping from this to that.
    """
    names = dict(fields) if isinstance(fields, Mapping) else {name: name for name in fields}
    try:
        yield
    except ExperimentError:
        raise
    except (PathControlError, OSError) as error:
        word = re.match(r"\w*", str(error))
        joint = "." if word and word[0] in names else ": "
        message = reword_advice(str(error), lambda name, value: _line(names[name], value) if name in names else None)
        details = error.details_with() if isinstance(error, PathControlError) else {}
        if (name := details.get("argument")) in names:
            details["argument"] = f"{key}.{names[name]}"
        place = find_place(error) if joint == ": " else ""
        raise ExperimentError(f"{key}{joint}{message}{place}", **details) from error


def _line(name: str, value: str) -> str:
    """Return how a key is given in a file."""
    if value in ("True", "False"):
        return f"{name} = {value.lower()}"
    return (
        f"{name} = {json.dumps(value)}"
        if re.fullmatch(r"[^\W\d]\w*", value)
        else f"{name} = {value.translate(_LISTS)}".rstrip()
    )


@contextlib.contextmanager
def report_users_code(key: str, doing: str, fields: Iterable[str] = ()) -> Iterator[None]:
    """Turn whatever code of the user raises into an ExperimentError, as :func:`report_by_key` does with errors."""
    try:
        with report_by_key(key, fields):
            yield
    except PathControlError:
        raise
    except Exception as error:
        word = re.search(r"unexpected keyword argument '(\w+)'", str(error))
        meant = did_you_mean(word[1], fields) if word else ""
        raise ExperimentError(
            f"{key}: {doing} raised {describe_error(error)}{find_place(error)}{meant}", argument=key
        ) from error


def refuse_unit(key: str, value: Any, unit: str) -> None:
    """Refuse a quantity that was given with a ``unit`` of another dimension, as an angle for a sliding joint.

    Raises:
        ExperimentError: it was.
    """
    if isinstance(value, Quantity) and value.unit != unit:
        raise ExperimentError(
            f"{key} was given in {value.unit}, expected {list_units([unit])}: so the joint moves",
            argument=key,
            value=value,
        )


def find_place(error: BaseException) -> str:
    """Return `` (FILE, line N)``, the last line of the user's own files that an exception passed, or ""."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if Path(frame.filename).is_file() and not _is_installed(Path(frame.filename))]
    return f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""


def _is_installed(file: Path) -> bool:
    """Return whether a file is of this package, of Python, or of an installed package."""
    folders = [_PACKAGE, *(Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib"))]
    return any(map(file.is_relative_to, folders)) or not _INSTALLED.isdisjoint(file.parts)


def describe_error(error: BaseException) -> str:
    """Return kind and message of an exception of the user's code."""
    return f"{type(error).__name__}: {error}"
