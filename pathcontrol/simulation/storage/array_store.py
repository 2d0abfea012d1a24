"""A store of many arrays in a single one, so that a file holds two variables and not thousands."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from hashlib import blake2b
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, check_finite
from pathcontrol.errors import InputError

_MOST_AXES = 8
_INLINE = 8  # an array of so few numbers is written into the recipe itself


class ArrayStore:
    """A store of arrays of floats, which returns references that fit into JSON; equal arrays are kept once.

    Args:
        numbers: the content of another store, (k,), to read its arrays.
    """

    def __init__(self, numbers: Array | None = None) -> None:
        self._parts = [] if numbers is None else [numbers]
        self._size = 0 if numbers is None else len(numbers)
        self._places: dict[bytes, dict[str, Any]] = {}
        self._known: dict[Hashable, tuple[Any, dict[str, Any]]] = {}

    @property
    def numbers(self) -> Array:
        """All numbers stored, (k,)."""
        return np.concatenate([np.empty(0), *self._parts])

    def put(self, array: Array) -> dict[str, Any]:
        """Store an array; return ``{"shape": …, "at": …}``, or ``{"values": …}`` for a few numbers."""
        array = np.asarray(array, dtype=np.float64)
        if array.size <= _INLINE:
            return {"values": array.tolist()}
        key = blake2b(array.tobytes() + repr(array.shape).encode()).digest()
        if key not in self._places:
            self._places[key] = {"shape": list(array.shape), "at": self._size}
            self._parts.append(array.reshape(-1))
            self._size += array.size
        return self._places[key]

    def make_once(self, key: Hashable, what: Any, recipe: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return the ``recipe`` of an object, made once for each ``key``, which contains the object's id."""
        if key not in self._known:
            self._known[key] = what, recipe()  # with the object itself, so that no other one gets its id
        return self._known[key][1]

    def get(self, place: Mapping[str, Any]) -> Array:
        """Return the array to which a reference of :meth:`put` refers.

        Raises:
            InputError: there is no such place, or its numbers are not finite.
        """
        if "values" in place:
            return check_finite("values", np.array(place["values"], dtype=np.float64))
        (numbers,), shape, at = self._parts, place["shape"], place["at"]
        if not isinstance(shape, list) or not all(type(length) is int and length >= 0 for length in (at, *shape)):
            raise InputError(
                f"an array is said to have the shape {shape} and to be at {at}, expected whole numbers", value=shape
            )
        size = math.prod(shape)
        if len(shape) > _MOST_AXES or at + size > len(numbers):
            raise InputError(f"an array of shape {shape} is said to be at {at} of {len(numbers)} numbers", value=shape)
        return check_finite("numbers", numbers[at : at + size].reshape(shape))
