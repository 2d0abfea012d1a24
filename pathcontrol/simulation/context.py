"""The context of a run: the simulated arm, and the path that it was to follow."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError, warn
from pathcontrol.robot.batch import RobotBatch, select_friction
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.storage.array_store import ArrayStore
from pathcontrol.simulation.variables import OUTCOMES
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.laps import Laps
from pathcontrol.tasks.task import PathTask


class StoredContext(NamedTuple):
    """Robot and task as a file holds them: JSON text, and the numbers (k,) that it refers to."""

    text: str
    numbers: Array


class _Arrays(Protocol):
    """Arrays by their names, as a run has them."""

    def array(self, name: str) -> Array: ...

    def __contains__(self, name: str) -> bool: ...


def check_sequence(run: _Arrays, task: PathTask | None) -> None:
    """Check that a run with the path indices of a sequence fits a ``task`` that is one.

    Raises:
        InputError: the data are of paths that the task does not have, or are no numbers of paths.
    """
    if not isinstance(task, PathSequence) or "path_index" not in run:
        return
    which = run.array("path_index")
    if which.ndim != 1 or which.dtype.kind not in "iu":
        raise InputError(
            f"path_index is {which.dtype} with the shape {which.shape}, expected whole numbers over ('time',)",
            value=str(which.dtype),
        )
    lengths = {len(run.array(name)) for name, (dims, *_) in OUTCOMES.items() if dims == ("path",) and name in run}
    if (which.size and not 0 <= int(which.min()) <= int(which.max()) < len(task)) or lengths - {len(task)}:
        raise InputError(f"the data are of other paths than the {len(task)} of the task; expected data and task of one")


class RunContext:
    """The robot and the task of a run, each made at the first request; ``None`` where it is unknown.

    Args:
        robot: returns the simulated arm.
        task: returns the path and its velocity profile.
        stored: the recipes of both, if they come from a file.
        robots: the arm of each rollout by its number, where they differ.
        first: returns the number of the first rollout that a :class:`TaskBatch` has a task for.
        model: returns the arm that the law computes with, where it is not the simulated one.
    """

    def __init__(
        self,
        robot: Callable[[], RobotModel | None],
        task: Callable[[], PathTask | None],
        stored: StoredContext | None = None,
        robots: Mapping[int, RobotModel] | None = None,
        first: Callable[[], int] = lambda: 0,
        model: Callable[[], RobotModel | None] = lambda: None,
    ) -> None:
        self._robot, self._task, self._stored, self._robots = robot, task, stored, robots
        self._first, self._model = first, model

    @classmethod
    def of(
        cls,
        robot: RobotModel | RobotBatch | None,
        task: PathTask | None,
        first: int = 0,
        model: RobotModel | None = None,
    ) -> RunContext:
        """Return the context of a run whose robot, task and model are at hand; rollouts are numbered from ``first``."""
        numbered = {"first": lambda: first, "model": lambda: model}
        if isinstance(robot, RobotBatch):
            robots = dict(enumerate(robot.robots, first))
            return cls(lambda: robot.robots[0], lambda: task, robots=robots, **numbered)  # type: ignore[arg-type]
        return cls(lambda: robot, lambda: task, **numbered)  # type: ignore[arg-type]

    @classmethod
    def load(cls, stored: StoredContext) -> RunContext:
        """Return the stored context; it is read at the first request."""
        return cls(
            lambda: _robot(stored),
            lambda: _task(stored),
            stored,
            first=lambda: _first(stored),
            model=lambda: _model(stored),
        )

    @cached_property
    def robot(self) -> RobotModel | None:
        """The simulated arm."""
        return self._robot()

    @cached_property
    def model(self) -> RobotModel | None:
        """The arm that the law computes with: the simulated one, unless another is known."""
        model = self._model()
        return self.robot if model is None else model

    @cached_property
    def task(self) -> PathTask | None:
        """The path and its velocity profile."""
        return self._task()

    def task_of(self, rollouts: Array) -> PathTask | None:
        """Return the task of ``rollouts`` by their numbers, from a batch the tasks of these."""
        task = self.task
        if not isinstance(task, TaskBatch):
            return task
        rows = rollouts - self._first()
        if ((rows < 0) | (rows >= len(task))).any():
            raise InputError(
                f"the data have rollouts {rollouts.tolist()}, of which the run does not know all tasks", value=rollouts
            )
        return task.rows(rows)

    def rollout(self, number: int) -> RunContext:
        """Return the context of one rollout."""
        arm, known = self.robot if self._robots is None else self._robots[number], self._model()
        row = number - self._first()
        robot, model = (None if one is None else select_friction(one, row) for one in (arm, known))
        same = robot is arm and model is known
        if same and (self._stored is not None or (self._robots is None and not isinstance(self.task, TaskBatch))):
            return self
        task = self.task_of(np.array([number]))
        return RunContext(lambda: robot, lambda: task, model=lambda: model)

    def with_robot(self, robot: RobotModel) -> RunContext:
        """Return the same context with another robot."""
        return RunContext(lambda: robot, lambda: self.task, first=self._first, model=self._model)

    def path(self, index: int) -> RunContext:
        """Return the context of one path of a sequence."""
        return RunContext(lambda: self.robot, lambda: _path(self.task, index), model=self._model)

    def stored(self, upto: float) -> StoredContext:
        """Return robot and task for a file; an endless path is kept ``upto`` this s."""
        if self._stored is not None:
            return self._stored
        from pathcontrol.robot.recipe import recipe_of

        store, robot = ArrayStore(), self.robot
        recipes: dict[str, Any] = {"robot": None if robot is None else recipe_of(robot)}
        if self.model is not None and self.model is not robot:
            recipes["model"] = recipe_of(self.model)
        recipes["task"] = _recipe(self.task, store, upto)
        if first := self._first():
            recipes["first_rollout"] = first
        return StoredContext(json.dumps(recipes), store.numbers)


def _recipe(task: PathTask | None, store: ArrayStore, upto: float) -> dict[str, Any] | None:
    """Return the recipe of the task, or warn: no run is lost because its path cannot be kept."""
    from pathcontrol.simulation.storage.task_recipes import (
        task_recipe,  # knows every kind of task: only files need that
    )

    if task is None:
        return None
    try:
        return task_recipe(task, store, upto)
    except Exception as error:  # whatever the user's own code raises
        warn(f"the {type(task).__name__} is not kept with its run: {error}")
        return None


def _robot(stored: StoredContext) -> RobotModel | None:
    """Return the stored arm."""
    from pathcontrol.robot.recipe import robot_of

    recipe = _part_of(stored, "robot")
    return None if recipe is None else robot_of(recipe)


def _model(stored: StoredContext) -> RobotModel | None:
    """Return the stored arm that the law computes with."""
    from pathcontrol.robot.recipe import robot_of

    recipe = _part_of(stored, "model", missing=None)
    return None if recipe is None else robot_of(recipe)


def _task(stored: StoredContext) -> PathTask | None:
    """Return the stored task."""
    from pathcontrol.simulation.storage.task_recipes import task_of

    recipe = _part_of(stored, "task")
    return None if recipe is None else task_of(recipe, ArrayStore(stored.numbers))


def _first(stored: StoredContext) -> int:
    """Return the stored number of the first rollout; 0 is not stored."""
    first = _part_of(stored, "first_rollout", missing=0)
    if not isinstance(first, int):
        raise InputError(
            f"the tasks of the run are said to begin with rollout {first!r}, expected a number", value=first
        )
    return first


def _part_of(stored: StoredContext, name: str, **otherwise: Any) -> Any:
    """Return one of the recipes; a missing one is an error unless ``missing=`` gives a default."""
    try:
        recipes = json.loads(stored.text)
        return recipes.get(name, otherwise["missing"]) if otherwise else recipes[name]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"the {name} of the run cannot be read: {error}") from error


def _path(task: PathTask | None, index: int) -> PathTask | None:
    """Return one path of a sequence, ``None`` if the task is none."""
    if not isinstance(task, PathSequence):
        return None
    path = task.paths[index]
    return path.path if isinstance(path, Laps) else path
