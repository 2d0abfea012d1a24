"""The disturbance of a run as its configuration describes it, in a time that begins elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_BEGINS = ("start", "time")  # what the begin of a disturbance with a ``duration`` is called
_DEEPEST = 20  # sums in one another


def move_described(described: Any, begin: float, depth: int = 0) -> Any:
    """Return the description of a disturbance, or of a sum, for a time that is 0 at ``begin`` [s].

    The begin of a disturbance that has a ``duration`` is earlier by that, and the phase of one that has a ``frequency``
    further. What has neither, or is no number, stays as it is.
    """
    if not isinstance(described, Mapping) or depth > _DEEPEST:
        return described
    moved = dict(described)
    if isinstance(terms := described.get("terms"), list):
        moved["terms"] = [move_described(term, begin, depth + 1) for term in terms]
    if "duration" in described:
        moved |= {name: _add(described[name], -begin) for name in _BEGINS if name in described}
    if {"frequency", "phase"} <= described.keys():
        moved["phase"] = _add(described["phase"], 2 * np.pi * begin, described["frequency"])
    return moved


def _add(value: Any, amount: float, factor: Any = 1.0) -> Any:
    """Return a number, or numbers (N,), plus an ``amount`` times a ``factor``; what is none as it is."""
    try:
        return (np.asarray(value, dtype=np.float64) + amount * np.asarray(factor, dtype=np.float64)).tolist()
    except (TypeError, ValueError):
        return value
