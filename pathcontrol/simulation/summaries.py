"""Summaries of arrays for a run's configuration: small ones are kept whole, large ones become shape, min and max."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_MOST = 64  # size of an array up to which it is kept whole


def summarize(value: Any) -> Any:
    """Return plain values for JSON, with large arrays of numbers as ``{"shape": …, "min": …, "max": …}``."""
    if isinstance(value, Mapping):
        return {name: summarize(item) for name, item in value.items()}
    if not isinstance(value, list):
        return value
    try:
        array = np.asarray(value)
    except ValueError:  # a ragged list is no array
        return [summarize(item) for item in value]
    if array.dtype.kind not in "biuf":
        return [summarize(item) for item in value]
    if array.size <= _MOST:
        return value
    return {"shape": list(array.shape), "min": array.min().item(), "max": array.max().item()}


def is_whole(value: Any) -> bool:
    """Return whether :func:`summarize` left nothing of ``value`` out."""
    if isinstance(value, Mapping):
        return value.keys() != {"shape", "min", "max"} and all(is_whole(item) for item in value.values())
    return not isinstance(value, list) or all(is_whole(item) for item in value)
