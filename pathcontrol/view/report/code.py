"""Calls and values as Python code."""

from __future__ import annotations

import json
import sys
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

from pathcontrol.arguments import parameters_of
from pathcontrol.registry import Kind, load

_LONGEST_LINE = 100
_NOT_IMPORTED = ("__main__", "pathcontrol_file_")  # modules that a script cannot import


class Code(NamedTuple):
    """An expression, and the import lines that it needs."""

    text: str
    imports: tuple[str, ...] = ()


class Name(str):
    """An expression that stands in a script as it is: the name of a variable, or a call."""


def call(function: str, positional: Sequence[str], named: Mapping[str, Any]) -> str:
    """Return a call, on one line if it is short."""
    arguments = [*positional, *(f"{key}={_literal(value)}" for key, value in named.items())]
    line = f"{function}({', '.join(arguments)})"
    if len(line) <= _LONGEST_LINE:
        return line
    return f"{function}(\n" + "".join(f"    {argument},\n" for argument in arguments) + ")"


def _literal(value: Any) -> str:
    """Return a value as Python code, texts between double quotes."""
    if isinstance(value, Name):
        return value
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def class_code(kind: Kind, name: Any, described: Collection[str]) -> tuple[str, str] | None:
    """Return the name of a class of a ``kind`` in a script, and its import line, empty for the library's.

    ``None`` where nobody knows: a class of the user that is not in a module that can be imported, one without
    parameters that would say what it is, or one with some that are not ``described``. Those of the base of the kind
    that are ``None`` by default are described where they are something else.
    """
    if not isinstance(name, str) or kind.has(name):
        return (f"pc.{name}", "") if isinstance(name, str) else None
    own = kind.defined().get(name)
    module = sys.modules.get("" if own is None else own.__module__)
    if own is None or getattr(module, name, None) is not own or own.__module__.startswith(_NOT_IMPORTED):
        return None
    parameters = parameters_of(own).keys() - set(kind.given)
    of_base = {key for key, one in parameters_of(load(kind.base)).items() if not one.required and one.default is None}
    known = parameters - of_base <= set(described)
    return (name, f"from {own.__module__} import {name}") if parameters and known else None
