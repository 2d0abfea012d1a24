"""From an experiment file to a validated :class:`Experiment`."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.schema import Experiment
from pathcontrol.experiments.values import shown


def load_experiment(path: str | Path) -> Experiment:
    """Read and validate an experiment file; nothing is built or computed yet.

    Raises:
        ExperimentError: the file is missing, is not TOML, or says what it must not; the message has one line
            for each error, with the key path, the value, what was expected and the choices.
    """
    path = Path(path)
    data = read_toml(path)
    try:
        return Experiment.model_validate(data)
    except ValidationError as error:
        raise invalid(path, map(finding, error.errors(include_url=False))) from None


def invalid(path: str | Path, findings: Iterable[str]) -> ExperimentError:
    """The error that lists what is wrong in the file ``path``."""
    lines = "\n".join(findings).replace("\n", "\n  ")
    return ExperimentError(f"{str(path)!r} is not a valid experiment:\n  {lines}")


def read_toml(path: str | Path) -> dict[str, Any]:
    """What a TOML file says.

    Raises:
        ExperimentError: the file is missing, or is not TOML.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError as error:
        raise ExperimentError(
            f"there is no experiment file {str(path)!r}; `pathcontrol run --example` prints one to start from"
        ) from error
    except UnicodeDecodeError as error:
        raise invalid(path, [f"it is not a text file in UTF-8: {error}"]) from error
    except (OSError, ValueError, RecursionError) as error:  # integers of thousands of digits are a ValueError
        raise invalid(path, [f"it cannot be read as TOML: {error}"]) from error


def finding(error: Any) -> str:
    """One line: the key path, and what is wrong with it."""
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".")
    if error["type"] == "explained":
        return key + error["ctx"]["text"]
    return f"{key} = {shown(error['input'])}, expected {error['msg']}"
