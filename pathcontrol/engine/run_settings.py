"""The settings of a run as a struct of the engine, or the reason why the run cannot be compiled."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import addressof

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.motion_control import ComputedTorque, PDPlus, SlotineLi
from pathcontrol.control.observer import MomentumObserver
from pathcontrol.control.projection import Projection
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.engine.arm_constants import make_arms
from pathcontrol.engine.friction_coefficients import coefficients_of
from pathcontrol.engine.path_table import has_same_projection, path_struct
from pathcontrol.engine.speed_rules import SpeedRules
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
_COMPENSATION = {"none": 0, "viscous": 1, "full": 2, "observed": 0}
_BRANCHES = ("follow", "nearest", "local")


def add_law(setup: Setup, law: Controller, memory: Memory) -> SpeedRules:
    """Set the law of a run: its kind, gains, model of the arm, friction, observer and paths; return its speed rules.

    Raises:
        EngineError: the law is none of those that are compiled, or its arm, friction or task is beyond the engine.
    """
    controller = law.inner if isinstance(law, LawWrapper) else law
    kind = type(controller)
    if kind not in GAINS:
        known = ", ".join(law.__name__ for law in GAINS)
        raise EngineError(
            f"the law {kind.__name__} is in Python; compiled are {known}",
            value=kind.__name__,
            choices=tuple(law.__name__ for law in GAINS),
        )
    rules = SpeedRules(law, put_tables)
    n = controller.robot.n
    setup.joints, setup.law = n, list(GAINS).index(kind)
    setup.compensation = _COMPENSATION[controller.friction]
    if controller.observer is not None:
        if type(controller.observer) is not MomentumObserver:
            name = type(controller.observer).__name__
            raise EngineError(f"the observer {name} is in Python", value=name)
        setup.memory, setup.observes, setup.compensates = controller.observer.size, 1, controller.friction == "observed"
        setup.observer_gain = memory.rows(controller.observer.gain, n)
    position, velocity = (memory.rows(getattr(controller, name), n) for name in GAINS[kind])
    setup.position_gain, setup.velocity_gain = position, velocity
    setup.plan_gain = memory.numbers(getattr(controller, "k", 0.0))
    if isinstance(controller, Projection):
        setup.branch, setup.capture = _BRANCHES.index(controller.branches.branch), controller.branches.capture
    setup.law_arms = make_arms([controller.robot], None, memory)
    setup.law_friction = coefficients_of(controller.robot.friction).rows(n, memory)
    tasks, index = _find_distinct(controller.task)
    setup.paths = put_tables(controller.task, memory)
    setup.path_index = None if index is None else memory.address(index, np.int32)
    if isinstance(controller, Projection):
        _check_projections(tasks)
    rules.add_to(setup, n)
    return rules


def put_tables(task: PathTask, memory: Memory) -> int:
    """Put the tables of a task, or of all different ones of a batch, into ``memory``; return the address of the first.

    Raises:
        EngineError: a task has no table.
    """
    tables = [path_struct(one) for one in _find_distinct(task)[0]]
    memory.keep(tables)
    return addressof(memory.keep((Path * len(tables))(*(path for path, _ in tables))))


def _check_projections(tasks: Sequence[PathTask]) -> None:
    """Check that σ̄ of each task is the nearest point of its path.

    Raises:
        EngineError: that of one is not.
    """
    for one in tasks:
        if not has_same_projection(one, path_struct(one)[0]):
            name = type(one).__name__
            raise EngineError(f"{name}.sigma_bar is not the nearest point of its path", value=name)


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
