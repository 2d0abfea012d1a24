"""The size and depth of the task that a recipe would make, found before anything is made of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pathcontrol.errors import InputError

_MOST, _DEEPEST = 10**6, 100  # tables of which one task is made, and how deep they are inside one another


class _Extent(NamedTuple):
    """The number of tables of a task, and the depth of their nesting."""

    size: int
    depth: int


def check_extent(recipe: Any) -> None:
    """Check that a recipe makes a task of bounded size; parts named repeatedly count each time.

    Raises:
        InputError: the task would be too large or too deep, a number is not finite, or a part is not there.
    """
    parts: list[_Extent] = []
    if isinstance(recipe, Mapping) and recipe.get("class") == "TaskBatch":
        for part in _get_list(recipe, "parts"):
            parts.append(_check_part(part, parts))
        for task in _get_list(recipe, "tasks"):
            _check_part(task, parts)
    else:
        _check_part(recipe, parts)


def _get_list(recipe: Mapping[str, Any], name: str) -> list[Any]:
    """Return a list in the recipe; raise if it is none."""
    if not isinstance(recipe.get(name), list):
        raise InputError(f"its {name} are {recipe.get(name)!r:.80}, expected a list", value=recipe.get(name))
    return recipe[name]


def _check_part(recipe: Any, parts: Sequence[_Extent]) -> _Extent:
    """Return the extent of a recipe; raise if it is too large."""
    extent = _measure(recipe, parts)
    if extent.size > _MOST or extent.depth > _DEEPEST:
        raise InputError(
            f"a task is said to be made of {extent.size} tables, {extent.depth} deep, expected at most {_MOST} and "
            f"{_DEEPEST}",
            value=extent.size,
            limit=_MOST,
        )
    return extent


def _measure(recipe: Any, parts: Sequence[_Extent]) -> _Extent:
    """Return the extent of a recipe."""
    if isinstance(recipe, Mapping) and "part" in recipe:
        part = recipe["part"]
        if type(part) is not int or not 0 <= part < len(parts):
            raise InputError(f"part {part!r:.80} is named, of {len(parts)} before it", value=part, limit=len(parts))
        return parts[part]
    if isinstance(recipe, Mapping | list):
        inner = [_measure(value, parts) for value in (recipe.values() if isinstance(recipe, Mapping) else recipe)]
        one = isinstance(recipe, Mapping)
        return _Extent(one + sum(each.size for each in inner), one + max((each.depth for each in inner), default=0))
    if isinstance(recipe, float) and math.isnan(recipe):
        raise InputError("one of its numbers is no number")
    return _Extent(0, 0)
