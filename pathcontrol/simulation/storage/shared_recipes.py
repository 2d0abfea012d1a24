"""Recipes of many objects, in which a part that several of them share is written once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any


def share_parts(recipes: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return ``{"parts": …, "tasks": …}``: the recipes of tasks, and of the objects found in them more than once.

    Such an object is replaced by ``{"part": i}``; parts may refer to parts before them.
    """
    uses: Counter[int] = Counter()
    _count(list(recipes), uses)
    parts: list[dict[str, Any]] = []
    places: dict[int, int] = {}

    def write(value: Any) -> Any:
        if isinstance(value, list):
            return [write(item) for item in value]
        if not isinstance(value, dict):
            return value
        if id(value) in places:
            return {"part": places[id(value)]}
        recipe = {name: write(item) for name, item in value.items()}
        if "class" not in value or uses[id(value)] < 2:
            return recipe
        places[id(value)] = len(parts)
        parts.append(recipe)
        return {"part": places[id(value)]}

    tasks = write(list(recipes))
    return {"parts": parts, "tasks": tasks}


def _count(value: Any, uses: Counter[int]) -> None:
    """Count how often each recipe is found, by its id."""
    if isinstance(value, list):
        for item in value:
            _count(item, uses)
    elif isinstance(value, dict):
        uses[id(value)] += 1
        if uses[id(value)] == 1:
            _count(list(value.values()), uses)
