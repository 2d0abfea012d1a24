"""What is known of an object, as long as it lives."""

from __future__ import annotations

from typing import Generic, TypeVar
from weakref import ref

Key = TypeVar("Key")
Value = TypeVar("Value")


class KnownOf(Generic[Key, Value]):
    """Values kept for objects by identity, until these are gone.

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
        """Keep, and return, the value of an object in place of another."""
        known, which = self._known, id(key)
        known[which] = ref(key, lambda _: known.pop(which, None)), value
        return value
