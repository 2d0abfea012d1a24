"""What the record of a run says of arrays: all of small ones, of large ones their shape and range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_MOST = 64  # numbers that are written in full


def in_short(value: Any) -> Any:
    """``value``, of plain values for JSON, with large arrays of numbers as ``{"shape": …, "min": …, "max": …}``."""
    if isinstance(value, Mapping):
        return {name: in_short(item) for name, item in value.items()}
    if not isinstance(value, list):
        return value
    try:
        array = np.asarray(value)
    except ValueError:  # a ragged list is no array
        return [in_short(item) for item in value]
    if array.dtype.kind not in "biuf":
        return [in_short(item) for item in value]
    if array.size <= _MOST:
        return value
    return {"shape": list(array.shape), "min": array.min().item(), "max": array.max().item()}


def is_whole(value: Any) -> bool:
    """Whether nothing of ``value`` was left out by :func:`in_short`."""
    if isinstance(value, Mapping):
        return value.keys() != {"shape", "min", "max"} and all(is_whole(item) for item in value.values())
    return not isinstance(value, list) or all(is_whole(item) for item in value)
