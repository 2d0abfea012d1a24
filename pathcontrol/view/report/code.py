"""Calls and values as Python writes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

_LONGEST_LINE = 100


class Name(str):
    """What stands in a script as it is: the name of a variable, or a call."""


def call(function: str, positional: Sequence[str], named: Mapping[str, Any]) -> str:
    """Return a call, on one line if it is short."""
    arguments = [*positional, *(f"{key}={_literal(value)}" for key, value in named.items())]
    line = f"{function}({', '.join(arguments)})"
    if len(line) <= _LONGEST_LINE:
        return line
    return f"{function}(\n" + "".join(f"    {argument},\n" for argument in arguments) + ")"


def _literal(value: Any) -> str:
    """A value as Python writes it, texts between double quotes."""
    if isinstance(value, Name):
        return value
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
