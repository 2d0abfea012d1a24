"""One call from a controller and an initial state to a :class:`Run`."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, finite, joint_array, scalar
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.errors import InputError, PathControlError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.continuous import run_continuous
from pathcontrol.simulation.modes import ContinuousTime, SampledLoop
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.sampled import run_sampled


def simulate(
    controller: Controller,
    q: ArrayLike,
    qd: ArrayLike | None = None,
    *,
    duration: float,
    plant: RobotModel | None = None,
    loop: SampledLoop | ContinuousTime | None = None,
    progress: bool = True,
) -> Run:
    """Simulate a control law on an arm.

    Args:
        controller: the law, with its own model of the arm.
        q: initial joint positions [rad], (n,) or a batch (*batch, n); the run counts batches as rollouts.
        qd: initial joint velocities [rad/s], broadcast against ``q``; default at rest.
        duration: simulated time [s], rounded to whole periods of the loop, one at least.
        plant: the arm that is really there, with its friction; default the controller's own model.
        loop: how the loop is closed; default ``SampledLoop()``, a 2.5 ms hold and nothing else.
        progress: show a bar on standard error when it takes longer than two seconds.

    Raises:
        InputError: an argument has the wrong shape or value.
        SimulationError: a rollout diverged, or the integrator gave up.
    """
    duration = scalar("duration", duration, positive=True)
    robot = controller.robot if plant is None else plant
    if robot.joint_names != controller.robot.joint_names:
        raise InputError(
            f"the plant has the joints {robot.joint_names}, the controller's model {controller.robot.joint_names}"
        )
    loop = SampledLoop() if loop is None else loop
    if not isinstance(loop, SampledLoop | ContinuousTime):
        raise InputError(f"loop = {loop!r}, expected SampledLoop(...) or ContinuousTime(...)")
    q0, qd0 = _initial_state(q, qd, robot.n)
    period = loop.period if isinstance(loop, SampledLoop) else loop.output_period
    if duration < period:
        raise InputError(f"duration = {duration:g} s is less than one period of {period:g} s; both are in seconds")
    _check_law(controller, q0, qd0)
    config = _config(controller, robot, loop, duration)
    if isinstance(loop, SampledLoop):
        time, arrays = run_sampled(controller, robot, loop, q0, qd0, duration, progress)
    else:
        time, arrays = run_continuous(controller, robot, loop, q0, qd0, duration, progress)
    joints = dict(zip(robot.joint_names, robot.position_units, strict=True))
    return Run.from_arrays(time, joints, arrays, config)


def _initial_state(q: ArrayLike, qd: ArrayLike | None, n: int) -> tuple[Array, Array]:
    position = finite("q", joint_array("q", q, n))
    velocity = np.zeros(n) if qd is None else finite("qd", joint_array("qd", qd, n))
    try:
        pair = np.broadcast_arrays(position, velocity)
    except ValueError as error:
        raise InputError(f"q has shape {position.shape} and qd {velocity.shape}, which do not fit together") from error
    q0, qd0 = (np.array(a).reshape(-1, n) for a in pair)
    return q0, qd0


def _check_law(controller: Controller, q: Array, qd: Array) -> None:
    """The law, asked once, gives what :class:`ControlOutput` says: shapes that fit the initial states, and numbers."""
    name = type(controller).__name__
    try:
        z = controller.start(q, qd)
        out = controller.law(0.0, q, qd, z)
    except (ValueError, IndexError, TypeError) as error:
        if isinstance(error, PathControlError):
            raise
        raise InputError(f"{name}.law fails at the initial states, of shape {q.shape}: {error}") from error
    if not isinstance(out, ControlOutput):
        raise InputError(f"{name}.law returns {type(out).__name__}, expected a ControlOutput")
    wanted = {"tau": q.shape, "e_p": q.shape, "e_v": q.shape, "zdot": np.shape(z)}
    for field in ControlOutput._fields:
        shape, value = wanted.get(field, q.shape[:1]), getattr(out, field)
        if np.shape(value) != shape:
            raise InputError(
                f"{name}.law gives {field} of shape {np.shape(value)} for initial states of shape {q.shape}, expected "
                f"{shape}; gains that differ between rollouts need one row for each, and as many initial states"
            )
        if not np.isfinite(value).all():
            raise InputError(f"{name}.law gives {field} = {np.asarray(value).tolist()} at the start, expected numbers")


def _config(
    controller: Controller, robot: RobotModel, loop: SampledLoop | ContinuousTime, duration: float
) -> dict[str, Any]:
    packages = ("pathcontrol", "pin", "numpy", "scipy")
    return {
        "controller": controller.describe(),
        "plant": {"robot": robot.name, "friction": robot.friction.describe()},
        "loop": loop.describe(),
        "duration": duration,
        "versions": {"python": platform.python_version()} | {name: version(name) for name in packages},
    }
