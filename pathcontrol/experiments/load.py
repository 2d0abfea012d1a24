"""The loading of an experiment file as a validated :class:`Experiment`."""

from __future__ import annotations

import re
import stat
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from pathcontrol._files import as_path
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.experiments.schema.validators import show_value

_LONGEST = 2_000_000  # bytes
_DEEPEST = 100  # parts of a key
_MOST_LISTED = 20  # findings
_LONGEST_KEY = 200


def load_experiment(path: str | Path) -> Experiment:
    """Read and validate an experiment file; nothing is built or computed yet.

    Raises:
        ExperimentError: the file is missing, is not TOML, or says what it must not; the message has one line
            for each error, with the key path, the value, what was expected and the choices.
    """
    path = as_path("path", path)
    data = read_toml(path)
    try:
        return Experiment.model_validate(data)
    except ValidationError as error:
        found = error.errors(include_url=False)
        details = {"argument": _key_of(found[0]), "value": found[0]["input"]} if len(found) == 1 else {}
        raise make_file_error(path, map(describe_finding, found), details) from None


def make_file_error(
    path: str | Path, findings: Iterable[str], details: Mapping[str, Any] = MappingProxyType({})
) -> ExperimentError:
    """Return the error that lists what is wrong in the file ``path``, with ``details`` beside the message."""
    listed = tuple(findings)
    more = ["and more"] if len(listed) > _MOST_LISTED else []
    lines = "\n".join([*listed[:_MOST_LISTED], *more]).replace("\n", "\n  ")
    message = f"{str(path)!r} is not a valid experiment:\n  {lines}"
    return ExperimentError(message, **{"file": str(path), **details, "findings": listed})


def make_build_error(path: str | Path, error: ExperimentError) -> ExperimentError:
    """Return the error of what the file ``path`` describes, which could not be made, with what stands beside it."""
    return make_file_error(path, [str(error)], error.details_with())


def _make_text_error(path: str | Path, finding: str) -> ExperimentError:
    """Return the error of the text of a file, which may say the line."""
    line = re.search(r"\bline (\d+)", finding)
    return make_file_error(path, [finding], {"line": int(line[1])} if line else {})


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        ExperimentError: the file is missing, or is not TOML.
    """
    text = read_text(path)
    _refuse_deep_keys(path, text)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # integers of thousands of digits are a ValueError
        raise _make_text_error(path, f"it cannot be read as TOML: {error}") from error


def read_text(path: str | Path) -> str:
    """Return the text of an experiment file, of which no more is read than an experiment can be long.

    Raises:
        ExperimentError: the file is missing, is no regular file, is too long or is no text in UTF-8.
    """
    path = as_path("path", path)
    try:
        data = _read(path)
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError as error:
        raise ExperimentError(
            f"there is no experiment file {str(path)!r}; `pathcontrol run --example` prints one to start from",
            file=str(path),
        ) from error
    except UnicodeDecodeError as error:
        line, byte = data[: error.start].count(b"\n") + 1, data[error.start]
        raise _make_text_error(
            path, f"line {line} has the byte 0x{byte:02x}, expected text in UTF-8; save it so"
        ) from error
    except ExperimentError:
        raise
    except (OSError, ValueError) as error:  # a null character in the name is a ValueError
        raise make_file_error(path, [f"it cannot be read: {error}"]) from error


def _refuse_deep_keys(path: str | Path, text: str) -> None:
    """Refuse keys of very many parts, ``a.a.a…``: the time to parse one grows with their square."""
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > _DEEPEST and max(part.count(".") for part in re.split(r"[=,\[\]{}]", line)) > _DEEPEST:
            raise _make_text_error(path, f"line {number} has a key of more than {_DEEPEST} parts, expected a few")


def _read(path: Path) -> bytes:
    """Return the bytes of a regular file; of a pipe or a device nothing is read, as it may never end."""
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a pipe, a socket or a device"
        raise make_file_error(path, [f"it is {kind}, expected a file"])
    with path.open("rb") as file:
        data = file.read(_LONGEST + 1)
    if len(data) > _LONGEST:
        raise make_file_error(path, [f"it is longer than {_LONGEST // 1_000_000} MB, expected an experiment file"])
    return data


def _key_of(error: Any) -> str:
    """Return the key path that an error of a validation is about."""
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".")
    return key if len(key) <= _LONGEST_KEY else f"{key[:_LONGEST_KEY]}…"


def describe_finding(error: Any) -> str:
    """Return one line of the message: the key path, and what is wrong with it."""
    key = _key_of(error)
    if error["type"] == "explained":
        return key + error["ctx"]["text"]
    return f"{key} = {show_value(error['input'])}, expected {error['msg']}"
