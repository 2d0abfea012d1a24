"""A cache of values by the identity of the objects that they belong to."""

from __future__ import annotations

from typing import Generic, TypeVar
from weakref import ref

Key = TypeVar("Key")
Value = TypeVar("Value")


class IdentityCache(Generic[Key, Value]):
    """Values kept for objects by identity, for as long as these live.

    Unlike a ``WeakKeyDictionary`` it takes objects without a hash, such as a task that is a dataclass, and tells equal
    ones apart.
    """

    def __init__(self) -> None:
        self._known: dict[int, tuple[ref[Key], Value]] = {}

    def get(self, key: Key) -> Value | None:
        """Return the value of an object, ``None`` if it has none."""
        found = self._known.get(id(key))
        return None if found is None else found[1]

    def keep(self, key: Key, value: Value) -> Value:
        """Set the value of an object, and return it."""
        known, which = self._known, id(key)
        known[which] = ref(key, lambda _: known.pop(which, None)), value
        return value
