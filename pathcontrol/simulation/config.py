"""Parts of a run's configuration, which may be anyone's: where it is not as simulations write it, they are empty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def table(config: Any, name: str) -> Mapping[str, Any]:
    """The table called ``name``, such as ``"loop"``."""
    found = config.get(name) if isinstance(config, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def laws(config: Any) -> Sequence[Mapping[str, Any]]:
    """The tables of the control laws, one after another: those of a sequence, or one."""
    law = table(config, "controller")
    sequence = law.get("sequence")
    if isinstance(sequence, list) and sequence and all(isinstance(each, Mapping) for each in sequence):
        return sequence
    return [law]
