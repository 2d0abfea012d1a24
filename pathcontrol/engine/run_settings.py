"""The settings of a run as a struct of the engine, or the reason why the run cannot be compiled."""

from __future__ import annotations

from ctypes import addressof

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.motion_control import ComputedTorque, PDPlus, SlotineLi
from pathcontrol.control.projection import Projection
from pathcontrol.engine.arm_constants import make_arms
from pathcontrol.engine.friction_coefficients import coefficients_of
from pathcontrol.engine.path_table import has_same_projection, path_struct
from pathcontrol.engine.structs import Memory, Path, Rows, Setup
from pathcontrol.errors import EngineError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

#: position and velocity gains of each law, by the names of its attributes, in the order of the engine's numbers
GAINS: dict[type[Controller], tuple[str, str]] = {
    ComputedTorque: ("K_p", "K_v"),
    PDPlus: ("K_p", "K_v"),
    SlotineLi: ("Lambda", "K_d"),
    ExtendedMotionPlan: ("K_p", "K_v"),
    Projection: ("k_p", "K_v"),
}
_COMPENSATION = ("none", "viscous", "full")
_BRANCHES = ("follow", "nearest", "local")


def add_law(setup: Setup, controller: Controller, memory: Memory) -> None:
    """Set the law of a run: its kind, gains, model of the arm, friction and paths.

    Raises:
        EngineError: the law is none of those that are compiled, or its arm, friction or task is beyond the engine.
    """
    kind = type(controller)
    if kind not in GAINS:
        known = ", ".join(law.__name__ for law in GAINS)
        raise EngineError(
            f"the law {kind.__name__} is in Python; compiled are {known}",
            value=kind.__name__,
            choices=tuple(law.__name__ for law in GAINS),
        )
    if controller.observer is not None:
        raise EngineError("the law has a momentum observer, friction='observed'")
    n = controller.robot.n
    setup.joints, setup.law = n, list(GAINS).index(kind)
    setup.compensation = _COMPENSATION.index(controller.friction)
    position, velocity = (memory.rows(getattr(controller, name), n) for name in GAINS[kind])
    setup.position_gain, setup.velocity_gain = position, velocity
    setup.plan_gain = memory.numbers(getattr(controller, "k", 0.0))
    if isinstance(controller, Projection):
        setup.branch, setup.capture = _BRANCHES.index(controller.branches.branch), controller.branches.capture
    setup.law_arms = make_arms([controller.robot], None, memory)
    setup.law_friction = coefficients_of(controller.robot.friction).rows(n, memory)
    _add_paths(setup, controller.task, isinstance(controller, Projection), memory)


def _add_paths(setup: Setup, task: PathTask, projected: bool, memory: Memory) -> None:
    """Set the tables of the tasks, and the one that each rollout has."""
    tasks, index = _find_distinct(task)
    paths = []
    for one in tasks:
        path, kept = path_struct(one)
        if projected and not has_same_projection(one, path):
            raise EngineError(f"{type(one).__name__}.sigma_bar is not the nearest point of its path")
        memory.keep(kept)
        paths.append(path)
    setup.paths = addressof(memory.keep((Path * len(paths))(*paths)))
    setup.path_index = None if index is None else memory.address(index, np.int32)


def _find_distinct(task: PathTask) -> tuple[list[PathTask], NDArray[np.intp] | None]:
    """Return the different tasks of all rollouts, and the index of each rollout's task; None if there is one."""
    if not isinstance(task, TaskBatch):
        return [task], None
    found: dict[int, int] = {}
    tasks: list[PathTask] = []
    index = np.empty(len(task), dtype=np.intp)
    for i, one in enumerate(task):
        if id(one) not in found:
            found[id(one)] = len(tasks)
            tasks.append(one)
        index[i] = found[id(one)]
    return tasks, index


def add_plant(setup: Setup, robot: RobotModel | RobotBatch, damped: Array, memory: Memory) -> None:
    """Set the simulated arm, or one for each rollout, with its friction.

    ``damped`` (N,) or (1,) marks arms with strong viscous friction, see :func:`has_strong_friction`.

    Raises:
        EngineError: an arm or its friction is beyond the engine.
    """
    bodies, index = (list(robot.bodies), robot.body) if isinstance(robot, RobotBatch) else ([robot], None)
    setup.plant_arms = make_arms(bodies, index, memory)
    setup.plant_friction = coefficients_of(robot.friction).rows(robot.n, memory)
    setup.damped = memory.numbers(damped)


def rows_or_none(values: Array | None, n: int, memory: Memory) -> Rows:
    """Return values of the joints of each rollout, or empty rows."""
    return Rows(None, 0) if values is None else memory.rows(values, n)
