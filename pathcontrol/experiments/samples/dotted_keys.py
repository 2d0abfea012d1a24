"""Dotted keys of an experiment file, such as ``start.q[0]``, in which ``[i]`` is the entry i of a list."""

from __future__ import annotations

import re
from itertools import combinations, pairwise
from typing import Any

from pathcontrol.errors import ExperimentError

_KEY = re.compile(r"[^\[\].]+(\[\d+\])*(\.[^\[\].]+(\[\d+\])*)*")
_STEP = re.compile(r"([^\[\].]+)|\[(\d+)\]")


def put(data: dict[str, Any], key: str, value: Any, where: str = "sweep.parameters") -> None:
    """Set the value of a dotted ``key``, in which ``[i]`` is the entry i of a list, in ``data``.

    Raises:
        ExperimentError: there is no such table or entry.
    """
    steps = _steps(key, where)
    inside: Any = data
    for step, after in pairwise(steps):
        if isinstance(step, str) and isinstance(inside, dict) and isinstance(after, str):
            inside = inside.setdefault(step, {})
        else:
            inside = _entry(inside, step, f"{where}: {key}")
    if not isinstance(inside, dict):
        _entry(inside, steps[-1], f"{where}: {key}")
    inside[steps[-1]] = value


def check_keys(keys: list[str], where: str) -> None:
    """Check that no key is a part of what another one sets.

    Raises:
        ExperimentError: one is.
    """
    for one, other in combinations(sorted(keys, key=lambda key: len(_steps(key, where))), 2):
        outer = _steps(one, where)
        if _steps(other, where)[: len(outer)] == outer:
            raise ExperimentError(
                f"{where}: {other!r} is a part of what {one!r} sets, so that one of them would not count; "
                "vary one only",
                argument=other,
            )


def section_of_key(key: str) -> str:
    """Return the section of the file that a dotted key is in."""
    return re.split(r"[.[]", key)[0]


def _steps(key: str, where: str) -> list[str | int]:
    if not _KEY.fullmatch(key):
        raise ExperimentError(
            f"{where}: {key!r}, expected a key of this file, such as 'controller.k' or 'start.q[0]'", argument=key
        )
    return [name or int(index) for name, index in _STEP.findall(key)]


def _entry(inside: Any, step: str | int, key: str) -> Any:
    try:
        return inside[step]
    except (KeyError, IndexError, TypeError) as error:
        listed = isinstance(inside, list) and isinstance(step, str) and step.isdigit()
        remedy = f"an entry of a list is written [{step}]" if listed else "give a value for it, or vary the whole list"
        raise ExperimentError(
            f"{key}: the file has no entry {step!r} on the way there; {remedy}",
            argument=key,
            value=step,
        ) from error
