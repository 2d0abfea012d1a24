"""Adaptation of any function of s to batches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError


@dataclass(frozen=True)
class VectorizedFunction:
    """A function of s (*batch,) with values (*batch, *shape), from one that takes rows of numbers or single numbers."""

    function: Callable[[Any], Any]
    shape: tuple[int, ...]
    takes_arrays: bool

    def __call__(self, s: Array) -> Array:
        s = np.asarray(s, dtype=np.float64)
        flat = s.ravel()
        if self.takes_arrays or not flat.size:
            values = self.function(flat) if flat.size else []
        else:
            values = [self.function(float(x)) for x in flat]
        return np.asarray(values, dtype=np.float64).reshape(s.shape + self.shape)


def vectorize(
    name: str, function: Callable[[Any], Any], probes: Array, shape: tuple[int, ...] | None
) -> VectorizedFunction:
    """Wrap ``function`` for any batch; whether it takes arrays or numbers is found out at ``probes``, (5,).

    Args:
        name: what it is called in messages.
        function: maps rows of numbers, or a number.
        probes: where it may be called.
        shape: shape of one value; ``None`` for any (n,).

    Raises:
        InputError: it is no function, fails, or returns another shape.
    """
    if not callable(function):
        raise InputError(f"{name} = {function!r}, expected a function of s", argument=name, value=function)
    many, one = _try_call(function, probes), _try_call(function, probes[:1])
    if isinstance(many, np.ndarray) and isinstance(one, np.ndarray) and many.ndim and many.ndim == one.ndim:
        rows = len(many) == len(probes) and many[:1].shape == one.shape and np.allclose(many[:1], one, equal_nan=True)
        if rows and _is_value(many.shape[1:], shape):
            return VectorizedFunction(function, many.shape[1:], True)
    s = float(probes[0])
    alone = _try_call(function, s)
    if not isinstance(alone, np.ndarray):
        raise InputError(
            f"{name}(s={s:g}) fails with {alone!r}, and for an array of s with {many!r}; expected a function of "
            "numbers or of arrays",
            argument=name,
            value=function,
            s=s,
        )
    if not _is_value(alone.shape, shape):
        expected = "one value for each joint, (n,)" if shape is None else f"{shape}" if shape else "a number"
        raise InputError(
            f"{name}(s={s:g}) has shape {alone.shape}, expected {expected}", argument=name, value=function, s=s
        )
    return VectorizedFunction(function, alone.shape, False)


def _is_value(got: tuple[int, ...], expected: tuple[int, ...] | None) -> bool:
    """Return whether a shape is the expected one, or (n,) if any is allowed."""
    return len(got) == 1 and got[0] > 0 if expected is None else got == expected


def _try_call(function: Callable[[Any], Any], s: Any) -> Array | Exception:
    """Return the value as an array of numbers, or the exception raised."""
    try:
        return np.asarray(function(s), dtype=np.float64)
    except Exception as error:
        return error
