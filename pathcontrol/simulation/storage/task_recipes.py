"""Recipes of tasks: a task as plain values and arrays, and back.

Curves of the library, what is made from them and tables of ϑ are kept as what they are made of, and are the same again
to the last bit. Any other path is kept as samples, a :class:`RecordedPath`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import as_array, check_finite
from pathcontrol.arguments import parameters_of
from pathcontrol.errors import InputError
from pathcontrol.registry import PROFILES, TASKS, load
from pathcontrol.simulation.storage.array_store import ArrayStore
from pathcontrol.simulation.storage.recipe_size import check_extent
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.profile import ConstantRate, VelocityProfile
from pathcontrol.tasks.recorded import RecordedPath, recorded_profile
from pathcontrol.tasks.task import PathSection, PathTask, Reprofiled

#: modules of classes that no experiment file names, but that saved runs make again from their arguments
_PLACES = {
    "TabulatedProfile": "profiles.tabulated:TabulatedProfile",
    "RecordedToolpath": "cartesian.recorded_toolpath:RecordedToolpath",
    "Reprofiled": "tasks.task:Reprofiled",
    "Laps": "tasks.laps:Laps",
    "RecordedPath": "tasks.recorded:RecordedPath",
    "RecordedProfile": "tasks.recorded:RecordedProfile",
    "PathSequence": "tasks.joined.path_sequence:PathSequence",
    "PathSection": "tasks.task:PathSection",
    "ReversedPath": "tasks.task:ReversedPath",
    "ScaledPath": "tasks.task:ScaledPath",
    "ShiftedPath": "tasks.task:ShiftedPath",
}


def task_recipe(task: PathTask, store: ArrayStore, upto: float | None = None, rated: bool = True) -> dict[str, Any]:
    """Return the recipe from which :func:`task_of` makes the task again.

    Args:
        task: any task.
        store: the store of its arrays.
        upto: the largest s that was used of an endless path.
        rated: False if its ϑ need not be kept.
    """
    return store.make_once((id(task), upto, rated), task, lambda: _task_recipe(task, store, upto, rated))


def _task_recipe(task: PathTask, store: ArrayStore, upto: float | None, rated: bool) -> dict[str, Any]:
    """Return the recipe of a task of any kind."""
    if isinstance(task, TaskBatch):
        return {"class": "TaskBatch"} | share_parts([task_recipe(one, store, upto) for one in task])
    if task.kept_as:
        return _recipe(_class_of(task.kept_as), task, store, None)
    if isinstance(task, PathSequence):
        return _recipe(PathSequence, task, store, upto, rated)
    if isinstance(task, Reprofiled):
        path = task_recipe(task.path, store, upto, rated=False)
        if not rated:
            return path
        return {"class": "Reprofiled", "path": path, "profile": _profile_recipe(task, store, upto)}
    if _class_of(type(task).__name__) is type(task) and _has_own_domain(task):
        return _recipe(type(task), task, store, task.s_end if isinstance(task, PathSection) else upto, rated)
    recorded = RecordedPath.of(task, None if rated else ConstantRate(1.0), upto)
    return _recipe(RecordedPath, recorded, store, upto, rated)


def task_of(recipe: Any, store: ArrayStore) -> PathTask:
    """Return the task of a recipe, with its arrays from ``store``.

    Raises:
        InputError: it is no recipe of a task.
    """
    try:
        check_extent(recipe)
        task = _make(recipe, store)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        raise InputError(f"this is no recipe of a task ({type(error).__name__}: {error})") from error
    if not isinstance(task, PathTask):
        raise InputError(f"this is a recipe of {task!r}, expected one of a task", value=task)
    return task


def _recipe(cls: type, made: Any, store: ArrayStore, upto: float | None, rated: bool = True) -> dict[str, Any]:
    """Return the recipe from which ``cls`` makes an object again: the arguments of its constructor."""
    if hasattr(cls, "arguments_of"):
        given = cls.arguments_of(made)
    else:
        given = {name: getattr(made, name) for name in parameters_of(cls)}
    own = {name: [write(item, store.put) for item in given[name]] for name, (write, _) in _codecs_of(cls).items()}
    return {"class": cls.__name__} | {name: _value(value, store, upto, rated) for name, value in (given | own).items()}


def _codecs_of(cls: type) -> Mapping[str, tuple[Any, Any]]:
    """Return the functions of a class that write and read the items of its arguments, by their names."""
    return getattr(cls, "codecs", {})


def _value(value: Any, store: ArrayStore, upto: float | None, rated: bool) -> Any:
    """Return an argument as plain values."""
    if isinstance(value, PathTask):
        return task_recipe(value, store, upto, rated)
    if isinstance(value, VelocityProfile):
        return _recipe(type(value), value, store, upto)
    if isinstance(value, tuple):
        return [_value(item, store, upto, rated) for item in value]
    return store.put(value) if isinstance(value, np.ndarray) else value


def _profile_recipe(task: Reprofiled, store: ArrayStore, upto: float | None) -> dict[str, Any]:
    """Return the profile of a task if it is one of the library that needs nothing else, or else samples of ϑ."""
    profile = task.profile
    if profile.kept_as:
        return _recipe(_class_of(profile.kept_as), profile, store, upto)
    known = profile if _class_of(type(profile).__name__) is type(profile) else recorded_profile(task, upto)
    return _recipe(type(known), known, store, upto)


def _class_of(name: str) -> Any:
    """Return the class of the library of this name that is made again from its arguments, or ``None``."""
    if name in _PLACES:
        return load(_PLACES[name])
    found: list[Any] = [kind.find(name) for kind in (TASKS, PROFILES) if kind.has(name)]
    return next((one for one in found if isinstance(one, type) and getattr(one, "kept_by_arguments", False)), None)


def _has_own_domain(task: PathTask) -> bool:
    """Return whether a task has the domain that its constructor gave it."""
    twin = type(task)(**{name: getattr(task, name) for name in parameters_of(type(task))})
    return (twin.s0, twin.s_end, twin.period) == (task.s0, task.s_end, task.period)


def _make(recipe: Any, store: ArrayStore, parts: Sequence[Any] = ()) -> Any:
    """Return the value of a recipe: an object, an array, a list, a JSON value, or one of ``parts`` made before."""
    if isinstance(recipe, list):
        return [_make(item, store, parts) for item in recipe]
    if not isinstance(recipe, Mapping):
        return recipe
    if "part" in recipe:
        return parts[recipe["part"]]
    if "class" not in recipe:
        return store.get(recipe)
    if recipe["class"] == "TaskBatch":
        made: list[Any] = []
        for part in recipe["parts"]:
            made.append(_make(part, store, made))
        return TaskBatch(_make(recipe["tasks"], store, made))
    values = {name: value for name, value in recipe.items() if name != "class"}
    cls = _class_of(recipe["class"])
    if cls is None:
        names = [place.rpartition(":")[2] for kind in (TASKS, PROFILES) for place in kind.members.values()]
        known = [*filter(_class_of, names), *_PLACES]
        raise InputError(
            f"class {recipe['class']!r} of a task, expected one of {', '.join(known)}",
            value=recipe["class"],
            choices=tuple(known),
        )
    own = {name: [read(item, store.get) for item in values.pop(name)] for name, (_, read) in _codecs_of(cls).items()}
    return _try_out(cls(**own, **{name: _make(value, store, parts) for name, value in values.items()}))


def _try_out(made: Any) -> Any:
    """Check that a path can be evaluated at three places, which wrong ones often cannot; return it."""
    if isinstance(made, PathTask):
        s = np.linspace(*made.sampled_interval, 3)
        for asked, shape in ((made.q_d, (3, made.n)), (made.dq_d, (3, made.n)), (made.theta, (3,))):
            check_finite(
                f"{type(made).__name__}.{asked.__name__}", np.broadcast_to(as_array("values", asked(s)), shape)
            )
    return made


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
