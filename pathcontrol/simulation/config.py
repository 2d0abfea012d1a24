"""Look-ups in a run's configuration that never fail: a missing or malformed section reads as an empty one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def table(config: Any, name: str) -> Mapping[str, Any]:
    """Return the section called ``name``, such as ``"loop"``."""
    found = config.get(name) if isinstance(config, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def first_rollout(config: Any) -> int:
    """Return the number of the first rollout of a run."""
    first = config.get("first_rollout", 0) if isinstance(config, Mapping) else 0
    return first if isinstance(first, int) else 0


def laws(config: Any) -> Sequence[Mapping[str, Any]]:
    """Return the sections of the control laws, one after another: those of a sequence, or one."""
    law = table(config, "controller")
    sequence = law.get("sequence")
    if isinstance(sequence, list) and sequence and all(isinstance(each, Mapping) for each in sequence):
        return sequence
    return [law]
