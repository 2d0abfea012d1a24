"""What a run is about: the simulated arm, and the path it was asked to follow."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError, PathControlWarning
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.storage.array_store import Shelf
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.joined.sequence import PathSequence
from pathcontrol.tasks.laps import Laps
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    import xarray as xr


class Stored(NamedTuple):
    """Robot and task as a file holds them: JSON, and the numbers (k,) that it refers to."""

    text: str
    numbers: Array


def check_sequence(data: xr.Dataset, task: PathTask | None) -> None:
    """Check that data which say on which path of a sequence the arm was, and a ``task`` that is one, fit together.

    Raises:
        InputError: the data are of paths that the task does not have, or are no numbers of paths.
    """
    if not isinstance(task, PathSequence) or "path_index" not in data.coords:
        return
    which = data["path_index"]
    if which.dims != ("time",) or which.dtype.kind not in "iu":
        raise InputError(f"path_index is {which.dtype} over {which.dims}, expected whole numbers over ('time',)")
    if (which.size and not 0 <= int(which.min()) <= int(which.max()) < len(task)) or (
        data.sizes.get("path", len(task)) != len(task)
    ):
        raise InputError(f"the data are of other paths than the {len(task)} of the task; expected data and task of one")


class Origin:
    """The robot and the task of a run, each made when it is first asked for; ``None`` where it is not known.

    Args:
        robot: gives the simulated arm.
        task: gives the path and its velocity profile.
        stored: what both are made from, if they come from a file.
        robots: the arm of each rollout by its number, where they differ.
        first: gives the number of the first rollout that a :class:`TaskBatch` has a task for.
        model: gives the arm that the law computes with, where it is not the simulated one.
    """

    def __init__(
        self,
        robot: Callable[[], RobotModel | None],
        task: Callable[[], PathTask | None],
        stored: Stored | None = None,
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
    ) -> Origin:
        """That of a run whose robot, task and model are at hand; rollouts are numbered from ``first``."""
        numbered = {"first": lambda: first, "model": lambda: model}
        if isinstance(robot, RobotBatch):
            robots = dict(enumerate(robot.robots, first))
            return cls(lambda: robot.robots[0], lambda: task, robots=robots, **numbered)  # type: ignore[arg-type]
        return cls(lambda: robot, lambda: task, **numbered)  # type: ignore[arg-type]

    @classmethod
    def load(cls, stored: Stored) -> Origin:
        """What was stored; it is looked at when it is asked for."""
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
        """The task of ``rollouts`` by their numbers, of one among several its own."""
        task = self.task
        if not isinstance(task, TaskBatch):
            return task
        rows = rollouts - self._first()
        if ((rows < 0) | (rows >= len(task))).any():
            raise InputError(f"the data have rollouts {rollouts.tolist()}, of which the run does not know all tasks")
        return task.rows(rows)

    def rollout(self, number: int) -> Origin:
        """That of one rollout."""
        if self._stored is not None or (self._robots is None and not isinstance(self.task, TaskBatch)):
            return self
        robot, task = self.robot if self._robots is None else self._robots[number], self.task_of(np.array([number]))
        return Origin(lambda: robot, lambda: task, model=self._model)

    def with_robot(self, robot: RobotModel) -> Origin:
        """The same with another robot."""
        return Origin(lambda: robot, lambda: self.task, first=self._first, model=self._model)

    def path(self, index: int) -> Origin:
        """That of one path of a sequence."""
        return Origin(lambda: self.robot, lambda: _path(self.task, index), model=self._model)

    def stored(self, upto: float) -> Stored:
        """Robot and task for a file; of an endless path what is needed ``upto`` this s."""
        if self._stored is not None:
            return self._stored
        from pathcontrol.robot.recipe import recipe_of

        shelf, robot = Shelf(), self.robot
        recipes: dict[str, Any] = {"robot": None if robot is None else recipe_of(robot)}
        if self.model is not None and self.model is not robot:
            recipes["model"] = recipe_of(self.model)
        recipes["task"] = _recipe(self.task, shelf, upto)
        if isinstance(self.task, TaskBatch):
            recipes["first_rollout"] = self._first()
        return Stored(json.dumps(recipes), shelf.numbers)


def _recipe(task: PathTask | None, shelf: Shelf, upto: float) -> dict[str, Any] | None:
    """That of the task, or a warning: no run is lost because its path is odd."""
    from pathcontrol.simulation.storage.task_recipes import (
        task_recipe,  # knows every kind of task: only files need that
    )

    if task is None:
        return None
    try:
        return task_recipe(task, shelf, upto)
    except Exception as error:  # whatever the user's own code raises
        warnings.warn(f"the {type(task).__name__} is not kept with its run: {error}", PathControlWarning, stacklevel=3)
        return None


def _robot(stored: Stored) -> RobotModel | None:
    from pathcontrol.robot.recipe import robot_of

    recipe = _part_of(stored, "robot")
    return None if recipe is None else robot_of(recipe)


def _model(stored: Stored) -> RobotModel | None:
    from pathcontrol.robot.recipe import robot_of

    recipe = _part_of(stored, "model", missing=None)
    return None if recipe is None else robot_of(recipe)


def _task(stored: Stored) -> PathTask | None:
    from pathcontrol.simulation.storage.task_recipes import task_of

    recipe = _part_of(stored, "task")
    return None if recipe is None else task_of(recipe, Shelf(stored.numbers))


def _first(stored: Stored) -> int:
    first = _part_of(stored, "first_rollout")
    if not isinstance(first, int):
        raise InputError(f"the tasks of the run are said to begin with rollout {first!r}, expected a number")
    return first


def _part_of(stored: Stored, name: str, **otherwise: Any) -> Any:
    """One of the recipes; ``missing=`` says what is given where there is none, which else is an error."""
    try:
        recipes = json.loads(stored.text)
        return recipes.get(name, otherwise["missing"]) if otherwise else recipes[name]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"the {name} of the run cannot be read: {error}") from error


def _path(task: PathTask | None, index: int) -> PathTask | None:
    if not isinstance(task, PathSequence):
        return None
    path = task.paths[index]
    return path.path if isinstance(path, Laps) else path
