"""The motion that a task plans over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.analysis.gamma import plan_of, rate_of
from pathcontrol.control.ending import Ending, arrival_parameter
from pathcontrol.errors import InputError, SimulationError, warn
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.trajectory import Trajectory, sample_times
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.tasks.task_check import check_task

_ACCURACY = 1e-11  # of the path parameter, relative and absolute
_LONGEST = 1e5  # s
_REST = 1e-3  # rad/s or m/s
_RISE = 0.1  # s in which each path of a sequence comes from rest to its speed, as all plans come to rest at an end


def plan_trajectory(
    task: PathTask,
    rate: float,
    duration: float | None = None,
    robot: RobotModel | None = None,
    joints: Sequence[str] = (),
) -> Trajectory:
    """Return the timed trajectory q_d(σ(t)) of the plan σ̇ = ϑ(σ) from the start of a path, with its braking at an end.

    Velocity and acceleration are q_d'σ̇ and q_d''σ̇² + q_d'ϑ'σ̇. It is what motion control follows; an arm that begins
    with it at rest can not do so where the plan begins at speed, which a warning tells. Each path of a sequence, as of
    a :class:`ToolpathTask`, begins at rest: its plan is σ̇ = wϑ(σ) with a share w that grows from 0 to 1 in 0.1 s.

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
    if duration is None:
        whole = _follow_whole(task)
        times = sample_times(rate, float(np.ceil(whole[-1].end * rate) / rate))
        legs = _go_on(task, whole, times[-1])
    else:
        times = sample_times(rate, as_scalar("duration", duration))
        legs = _follow_plan(task, times[-1])
    s, share, rise = _sample_legs(legs, times, isinstance(task, PathSequence))
    point = plan_of(task, Ending.of(task))(s)
    q, qd = point.q_d, share * point.velocity
    qdd = share**2 * point.velocity_slope * np.broadcast_to(point.theta, times.shape)[:, None] + rise * point.velocity
    _warn_of_start(qd[0])
    if robot is not None:
        return Trajectory(times, q, qd, qdd, robot.joint_names, robot.position_units)
    return Trajectory(times, q, qd, qdd, joints or [f"joint_{i + 1}" for i in range(q.shape[-1])])


class _Leg(NamedTuple):
    """The plan along a path, or one path of a sequence: from ``begin`` to ``end`` [s], and s at times between."""

    begin: float
    end: float
    parameter: Callable[[Array], Array]


def _follow_whole(task: PathTask) -> list[_Leg]:
    """Integrate the plan until it is at the end of an open path, or once round a closed one."""
    if task.period is None and not np.isfinite(task.s_end):
        raise InputError(f"{task!r} neither ends nor repeats; give a duration", argument="duration")
    whole = _follow_plan(task, _LONGEST, _last_parameter(task))
    if whole[-1].end >= _LONGEST:
        raise InputError(
            f"the plan of {task!r} is not at its end within {_LONGEST:g} s; give a duration", argument="duration"
        )
    return whole


def _go_on(task: PathTask, legs: Sequence[_Leg], until: float) -> list[_Leg]:
    """Return legs to the last parameter of a path, the last of which goes on to a time ``until`` [s], a sample later.

    The plan ends between samples, and has a place at the one after.
    """
    *before, last = legs
    if not until > last.end:
        return list(legs)
    rise = _RISE if isinstance(task, PathSequence) else 0.0
    on = _follow_leg(task, last.end, _last_parameter(task), np.inf, until, rise, begin=last.begin)

    def parameter(times: Array) -> Array:
        earlier, later = np.minimum(times, last.end), np.maximum(times, last.end)
        return np.where(times < last.end, last.parameter(earlier), on.parameter(later))

    return [*before, _Leg(last.begin, until, parameter)]


def _last_parameter(task: PathTask) -> float:
    """Return the parameter at which a plan has been along the whole path."""
    return arrival_parameter(task) if task.period is None else task.s0 + task.period


def _follow_plan(task: PathTask, longest: float, end: float = np.inf) -> list[_Leg]:
    """Integrate σ̇ = wϑ(σ) from the start of a path for the ``longest`` time [s], or to σ = ``end``, path by path.

    Raises:
        SimulationError: the plan cannot be followed.
    """
    between = list(task.starts[1:-1]) if isinstance(task, PathSequence) else []
    legs, t, s, rise = list[_Leg](), 0.0, task.s0, _RISE if isinstance(task, PathSequence) else 0.0
    for mark in [*between, end]:
        legs.append(_follow_leg(task, t, s, mark, longest, rise, begin=t))
        t, s = legs[-1].end, mark
        if t >= longest:
            break
    return legs


def _follow_leg(task: PathTask, t: float, s: float, end: float, longest: float, rise: float, begin: float) -> _Leg:
    """Integrate the plan from s at the time t [s] until it is at the parameter ``end``, or time is up.

    Its path began at the time ``begin`` [s].
    """
    from scipy.integrate import solve_ivp  # takes a quarter of a second to load

    planned, last = rate_of(task, Ending.of(task)), np.nextafter(end, -np.inf)

    def rate(t: float, s: Array) -> Array:
        share = min((t - begin) / rise, 1.0) if rise else 1.0
        return share * planned(np.minimum(s, last))

    def left(_: float, s: Array) -> float:
        return float(s[0] - end)

    left.terminal = True  # type: ignore[attr-defined]
    tolerances = {"rtol": _ACCURACY, "atol": _ACCURACY}
    events = left if np.isfinite(end) else None
    found = solve_ivp(rate, (t, longest), [s], method="DOP853", events=events, dense_output=True, **tolerances)
    if not found.success:
        raise SimulationError(f"the plan of {task!r} cannot be followed: {found.message}")
    return _Leg(t, float(found.t[-1]), lambda times: np.minimum(found.sol(times)[0], last))


def _sample_legs(legs: Sequence[_Leg], times: Array, rises: bool) -> tuple[Array, Array, Array]:
    """Return σ at increasing ``times`` (k,), the share w of the speed and its rate [1/s], (k, 1) each."""
    which = np.clip(np.searchsorted([leg.begin for leg in legs], times, side="right") - 1, 0, None)
    s = np.concatenate([leg.parameter(np.minimum(times[which == i], leg.end)) for i, leg in enumerate(legs)])
    if not rises:
        return s, np.ones((len(times), 1)), np.zeros((len(times), 1))
    since = times - np.array([leg.begin for leg in legs])[which]
    return s, np.minimum(since / _RISE, 1.0)[:, None], np.where(since < _RISE, 1.0 / _RISE, 0.0)[:, None]


def _warn_of_start(qd: Array) -> None:
    """Warn of a trajectory that begins at speed."""
    if (fastest := float(np.abs(qd).max())) > _REST:
        warn(
            f"the trajectory begins at {fastest:.3g} rad/s: an arm that is at rest cannot follow that; give the task a "
            "profile that starts slowly, as SmoothStartStop or time_optimal(…, start_rate=…)"
        )
