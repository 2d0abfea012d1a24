"""The configuration of a run, looked up without fail: a missing or malformed section reads as an empty one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pathcontrol.simulation.described_disturbance import move_described


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


def config_of_path(config: Mapping[str, Any], index: int, begin: float) -> dict[str, Any]:
    """Return the configuration of one path of a sequence, as a run whose time 0 is at ``begin`` [s]."""
    own = dict(config) | {"controller": dict(enumerate(laws(config))).get(index, {})}
    if "disturbance" in own:
        own["disturbance"] = move_described(own["disturbance"], begin)
    return own


def sample_parameters(config: Any) -> dict[str, Any]:
    """Return the parameters of the sample of a sweep that a run is the history of: numbers, lists of them, texts."""
    found = {str(name): value for name, value in table(config, "sweep").items() if name != "sample"}
    return {name: value for name, value in found.items() if isinstance(value, str) or _are_numbers(value)}


def _are_numbers(value: Any) -> bool:
    """Return whether a value is a number, or a list of numbers."""
    return all(isinstance(item, int | float) for item in (value if isinstance(value, list) else [value]))
