"""The motion that a task plans over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.analysis.gamma import plan_of
from pathcontrol.control.ending import Ending, arrival_parameter
from pathcontrol.errors import InputError, SimulationError, warn
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.trajectory import Trajectory, sample_times
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.task import PathTask
from pathcontrol.tasks.task_check import check_task

_ACCURACY = 1e-11  # of the path parameter, relative and absolute
_LONGEST = 1e5  # s
_REST = 1e-3  # rad/s or m/s


def plan_trajectory(
    task: PathTask,
    rate: float,
    duration: float | None = None,
    robot: RobotModel | None = None,
    joints: Sequence[str] = (),
) -> Trajectory:
    """Return the timed trajectory q_d(σ(t)) of the plan σ̇ = ϑ(σ) from the start of a path, with its braking at an end.

    Velocity and acceleration are q_d'σ̇ and q_d''σ̇² + q_d'ϑ'σ̇. It is what motion control follows; an arm that begins
    with it at rest can not do so where the plan begins at speed, which a warning tells.

    Args:
        task: the path and its velocity profile.
        rate: samples per second [Hz].
        duration: how long [s]; by default until the end of an open path, or once round a closed one.
        robot: the arm, which gives the joints their names and units.
        joints: their names, without a robot; by default ``joint_1`` and so on.

    Raises:
        InputError: an argument has another form, the path goes on for ever and no ``duration`` is given, or its plan
            rests at the start.
        TaskError: the task returns something it must not.
    """
    refuse_batch("task", task)
    check_task(task, None if robot is None else robot.n)
    times = sample_times(rate, _find_duration(task, rate) if duration is None else as_scalar("duration", duration))
    point = plan_of(task, Ending.of(task))(_parameter(task, times))
    q, qd = point.q_d, point.velocity
    qdd = point.velocity_slope * np.broadcast_to(point.theta, times.shape)[:, None]
    _warn_of_start(qd[0])
    if robot is not None:
        return Trajectory(times, q, qd, qdd, robot.joint_names, robot.position_units)
    return Trajectory(times, q, qd, qdd, joints or [f"joint_{i + 1}" for i in range(q.shape[-1])])


def _follow_plan(task: PathTask, duration: float, **options: Any) -> Any:
    """Integrate σ̇ = ϑ(σ) from the start of a path for a ``duration`` [s]."""
    from scipy.integrate import solve_ivp  # takes a quarter of a second to load

    plan = plan_of(task, Ending.of(task))
    solution = solve_ivp(
        lambda _, s: plan(s).theta + np.zeros_like(s),
        (0.0, duration),
        [task.s0],
        method="DOP853",
        rtol=_ACCURACY,
        atol=_ACCURACY,
        **options,
    )
    if not solution.success:
        raise SimulationError(f"the plan of {task!r} cannot be followed: {solution.message}")
    return solution


def _parameter(task: PathTask, times: Array) -> Array:
    """Return σ(t) of the plan at increasing times from 0, (k,)."""
    return np.asarray(_follow_plan(task, times[-1], t_eval=times).y[0])


def _find_duration(task: PathTask, rate: float) -> float:
    """Return how long the plan takes for the whole path [s], up to a whole number of samples."""
    if task.period is None and not np.isfinite(task.s_end):
        raise InputError(f"{task!r} neither ends nor repeats; give a duration", argument="duration")
    end = arrival_parameter(task) if task.period is None else task.s0 + task.period

    def left(_: float, s: Array) -> float:
        return float(s[0] - end)

    left.terminal = True  # type: ignore[attr-defined]
    found = _follow_plan(task, _LONGEST, events=left).t_events[0]
    if not found.size:
        raise InputError(
            f"the plan of {task!r} is not at its end within {_LONGEST:g} s; give a duration", argument="duration"
        )
    return float(np.ceil(found[0] * rate) / rate)


def _warn_of_start(qd: Array) -> None:
    """Warn of a trajectory that begins at speed."""
    if (fastest := float(np.abs(qd).max())) > _REST:
        warn(
            f"the trajectory begins at {fastest:.3g} rad/s: an arm that is at rest cannot follow that; give the task a "
            "profile that starts slowly, as SmoothStartStop or time_optimal(…, start_rate=…)"
        )
