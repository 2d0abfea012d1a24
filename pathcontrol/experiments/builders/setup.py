"""The objects that a validated experiment names, and their checks with one another."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array, as_joint_array, check_finite
from pathcontrol.control.base import Controller
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.arms import build_arms
from pathcontrol.experiments.builders.disturbances import build_disturbance
from pathcontrol.experiments.builders.file_errors import refuse_unit, report_by_key, report_users_code
from pathcontrol.experiments.builders.making import Place, make
from pathcontrol.experiments.builders.tasks import build_duration, build_task
from pathcontrol.experiments.schema.experiment import Experiment, Output
from pathcontrol.registry import LAWS
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Disturbance
from pathcontrol.simulation.arm.noise import NoiseSource
from pathcontrol.simulation.checks.disturbance_loop import find_misfit
from pathcontrol.simulation.engines import Engine
from pathcontrol.simulation.finish import Until
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop, torque_limits
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask

_MOST_SAMPLES = 10_000_000
_LOOP_KEYS = {
    "sampling": 'expected mode = "sampled" in [loop]',
    "torque_limits": "expected torque_limits = true in [loop]",
}


class Setup(NamedTuple):
    """All that :func:`pathcontrol.simulate` needs, checked, and the files to write.

    Attributes:
        controllers: the law with its model of the arm and its task, or one for each path of a sequence.
        task: the task, or the whole sequence.
        plant: the simulated arm.
        loop: how the loop is closed.
        q: initial joint positions [rad], (n,).
        qd: initial joint velocities [rad/s], (n,).
        duration: longest simulated time [s]: one number, or one for each path of a sequence.
        laps: how many times a closed path is gone round, or None.
        engine: which engine runs it.
        output: the files to write.
        until: when the run ends.
        disturbance: what else pushes the plant, or None.
    """

    controllers: tuple[Controller, ...]
    task: PathTask
    plant: RobotModel
    loop: SampledLoop | ContinuousTime
    q: Array
    qd: Array
    duration: float | Array
    laps: int | None
    engine: Engine
    output: Output
    until: Until = "end"
    disturbance: Disturbance | None = None

    @property
    def controller(self) -> Controller:
        """The law, of the first path if there are several."""
        return self.controllers[0]


def build(experiment: Experiment, base_dir: str | Path = ".") -> Setup:
    """Build and check everything an experiment names; nothing is simulated.

    Args:
        experiment: a validated experiment.
        base_dir: the folder that the paths in it are relative to.

    Raises:
        ExperimentError: something does not exist, does not fit together or is out of range.
    """
    place = Place(Path(base_dir), experiment.to_radians)
    with np.errstate(all="ignore"):  # absurd numbers overflow in the checks, which find that themselves
        model, plant = build_arms(experiment, place.folder)
        task = build_task(experiment.task, model, place)
        _refuse_joints(experiment.output, model)
        controllers = _controllers(experiment, model, task, place)
        duration, laps = build_duration(experiment, task)
        loop = _loop(experiment, plant, float(np.max(duration)), place)
        q, qd = _state(experiment, controllers[0])
        disturbance = build_disturbance([experiment], plant, q[None], qd[None], place)
        _check_loop(disturbance, loop, plant, q)
    setup = Setup(controllers, task, plant, loop, q, qd, duration, laps, experiment.engine, experiment.output)
    return setup._replace(until=experiment.until, disturbance=disturbance)


def _controllers(experiment: Experiment, model: RobotModel, task: PathTask, place: Place) -> tuple[Controller, ...]:
    """Return the law for the task, or one for each path of a sequence."""
    if not isinstance(task, PathSequence):
        return (law_of(experiment, model, task, place),)
    if experiment.until != "end":
        raise ExperimentError(
            f"until = {experiment.until!r}, expected 'end': each path of a sequence is followed to it",
            argument="until",
            value=experiment.until,
        )
    return tuple(law_of(experiment, model, path, place) for path in task.paths)


def law_of(
    experiment: Experiment,
    model: RobotModel,
    task: PathTask,
    place: Place,
    gains: Mapping[str, Array] = MappingProxyType({}),
) -> Controller:
    """Return the law of an experiment for one path, with other ``gains`` where some are given.

    Raises:
        ExperimentError: an argument is out of range.
    """
    law: Controller = make("controller", experiment.controller, LAWS, place, {"robot": model, "task": task}, gains)
    return law


def _refuse_joints(output: Output, robot: RobotModel) -> None:
    """Check that the arm has the joints that a figure shows, now and not after the simulation."""
    if output.figure_joints is not None and max(output.figure_joints) >= robot.n:
        raise ExperimentError(
            f"output.figure_joints = {list(output.figure_joints)}, expected indices from 0 to {robot.n - 1}: "
            f"{', '.join(robot.joint_names)}",
            argument="output.figure_joints",
            value=list(output.figure_joints),
            limit=(0, robot.n - 1),
        )


def _loop(experiment: Experiment, plant: RobotModel, duration: float, place: Place) -> SampledLoop | ContinuousTime:
    """Return the loop, with encoders and torque limits that fit the simulated arm."""
    loop: SampledLoop | ContinuousTime = make("loop", experiment.loop, None, place, {"robot": plant})
    with report_by_key("loop", list(type(experiment.loop).model_fields)):
        torque_limits(loop, plant)
        if isinstance(loop, ContinuousTime):
            _refuse_too_long(duration, "output_period", loop.output_period)
        else:
            loop.sensors(plant)
            if loop.noise is not None:
                NoiseSource(loop.noise, (1, plant.n), 0)
            _refuse_too_long(duration, "period", loop.period, loop.delay)
    return loop


def _check_loop(
    disturbance: Disturbance | None, loop: SampledLoop | ContinuousTime, plant: RobotModel, q: Array
) -> None:
    """Check that the loop can do what the disturbance does, and say so in the keys of the file."""
    named = None if disturbance is None else disturbance.find_names(plant)
    if misfit := find_misfit(named, loop, q[None]):
        raise ExperimentError(f"disturbance: {misfit.problem}; {_LOOP_KEYS[misfit.lacks]}", argument="disturbance")


def _refuse_too_long(duration: float, name: str, period: float, delay: float = 0.0) -> None:
    samples = duration / period
    if samples > _MOST_SAMPLES:
        raise ExperimentError(
            f"duration = {duration:g} and loop.{name} = {period:g} make {samples:.3g} samples, "
            f"expected at most {_MOST_SAMPLES:.0e}: shorten the one or lengthen the other",
            argument="duration",
            value=duration,
        )
    if delay > duration:
        raise ExperimentError(
            f"loop.delay = {delay:g}, expected at most duration = {duration:g}",
            argument="loop.delay",
            value=delay,
            limit=duration,
        )


def _state(experiment: Experiment, controller: Controller) -> tuple[Array, Array]:
    """Return (q, q̇) at the start, for which the law has been tried once."""
    n, given = controller.robot.n, experiment.start.arguments(experiment.to_radians)
    for name in ("q", "qd"):
        if isinstance(given.get(name), Mapping):
            raise ExperimentError(
                f"start.{name} = {getattr(experiment.start, name)}, expected a list with a number for each joint, in "
                f"the order {', '.join(controller.robot.joint_names)}",
                argument=f"start.{name}",
                value=getattr(experiment.start, name),
            )
    with report_by_key("start", ("q", "qd")):
        begin = controller.task.q_d(np.array(controller.task.s0))
        q = check_finite("q", as_joint_array("q", given.get("q", begin), n))
        qd = check_finite("qd", as_joint_array("qd", given.get("qd", np.zeros(n)), n))
    for name, per in (("q", ""), ("qd", "/s")):
        for i, (value, unit) in enumerate(zip(given.get(name, ()), controller.robot.position_units, strict=False)):
            refuse_unit(f"start.{name}[{i}]", value, unit + per)
    with report_users_code("controller", f"{type(controller).__name__} at the start"):
        controller.law(0.0, q, qd, controller.start(q, qd))
    return q, qd
