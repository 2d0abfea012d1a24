"""Recipes of many objects, in which what several of them are made of is written once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any


def shared(recipes: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """``{"parts": …, "tasks": …}``: the recipes of tasks, and of the objects that are found in them more than once.

    In the place of such an object stands ``{"part": i}``; parts may be made of parts before them.
    """
    uses: Counter[int] = Counter()
    _count(list(recipes), uses)
    parts: list[dict[str, Any]] = []
    places: dict[int, int] = {}

    def written(value: Any) -> Any:
        if isinstance(value, list):
            return [written(item) for item in value]
        if not isinstance(value, dict):
            return value
        if id(value) in places:
            return {"part": places[id(value)]}
        recipe = {name: written(item) for name, item in value.items()}
        if "class" not in value or uses[id(value)] < 2:
            return recipe
        places[id(value)] = len(parts)
        parts.append(recipe)
        return {"part": places[id(value)]}

    tasks = written(list(recipes))
    return {"parts": parts, "tasks": tasks}


def _count(value: Any, uses: Counter[int]) -> None:
    """How often each recipe is found, by its id."""
    if isinstance(value, list):
        for item in value:
            _count(item, uses)
    elif isinstance(value, dict):
        uses[id(value)] += 1
        if uses[id(value)] == 1:
            _count(list(value.values()), uses)
