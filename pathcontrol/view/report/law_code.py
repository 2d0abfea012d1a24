"""The Python code of a run's law, and of the wrappers around it, from its description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pathcontrol.arguments import parameters_of
from pathcontrol.registry import LAWS
from pathcontrol.view.report.code import Code, call, class_code

_NOT_ARGUMENTS = ("controller", "robot", "task")
_CHANGES = ("override",)  # arguments that may be functions, of which the description has the name


def law_code(described: Mapping[str, Any], path: str) -> Code | None:
    """Return the code that makes a law along the path called ``path``, with all that wraps it.

    ``None`` where the description does not say enough, as of a function that is an override.
    """
    wrappers = described.get("wrappers", [])
    law = described.get("law") if wrappers else described
    if not isinstance(law, Mapping) or not _are_wrappers(wrappers) or not all(name.isidentifier() for name in law):
        return None
    found = class_code(LAWS, law.get("controller"), law)
    if found is None:
        return None
    text = call(found[0], ["saved.model", path], {key: law[key] for key in law if key not in _NOT_ARGUMENTS})
    for one in reversed(wrappers):
        text = call(f"pc.{one['wrapper']}", [text], {key: one[key] for key in one if key != "wrapper"})
    return Code(text, found[1:])


def _are_wrappers(wrappers: Any) -> bool:
    """Return whether each wrapper is one of the library with arguments of its own."""
    if not isinstance(wrappers, Sequence) or not all(isinstance(one, Mapping) for one in wrappers):
        return False
    return all(_is_wrapper(one) for one in wrappers)


def _is_wrapper(one: Mapping[str, Any]) -> bool:
    """Return whether one wrapper can be made from what is said of it."""
    name = one.get("wrapper")
    if not isinstance(name, str) or not LAWS.has(name):
        return False
    arguments = parameters_of(LAWS.find(name)).keys() - {"law"}
    return one.keys() - {"wrapper"} <= arguments and not any(isinstance(one.get(key), str) for key in _CHANGES)
