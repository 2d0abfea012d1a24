"""Runs made of logs of arms: what is not in the log is derived from the path, or unknown."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_joint_array, check_finite
from pathcontrol._expect import expect
from pathcontrol.control.ending import Ending
from pathcontrol.errors import InputError, TaskError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.checks.log_slips import warn_of_log_slips
from pathcontrol.simulation.context import RunContext
from pathcontrol.simulation.finish import count_laps
from pathcontrol.simulation.run_arguments import map_position_units, name_versions
from pathcontrol.simulation.samples import Samples, complete_outcome
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.task import PathTask
from pathcontrol.tasks.task_check import check_task

_STEPS = 3  # of Newton's method from one sample to the next
_SINGULAR = 1e-3  # share of ‖q_d'‖² below which the curvature of a path would turn a step round


def make_log_run(
    times: ArrayLike,
    q: ArrayLike,
    qd: ArrayLike | None = None,
    tau: ArrayLike | None = None,
    robot: RobotModel | None = None,
    task: PathTask | None = None,
) -> tuple[Samples, dict[str, Any], RunContext]:
    """Return samples, configuration and context of a run made of the log of an arm.

    Times may be irregular; the run begins at 0 s. Without q̇ it is the central difference of q. With a task s is the
    parameter σ̄ of the nearest point of its path, followed from sample to sample, ṡ its rate for the arm's velocity,
    dσ̄/dt = q_d'ᵀq̇/(‖q_d'‖² + e_pᵀq_d''), and the errors are e_p = q_d(s) − q and e_v = q_d'(s)ϑ(s) − q̇, with ϑ braked
    at the end of an open path. What a log does not tell is NaN: τ where it is not given, the demand of the law, and
    without a task s and all errors. Means and RMS values of metrics weigh samples, not the time between them.

    What looks like a slip of units is told by a warning: degrees, milliseconds, torques beyond the limits, velocities
    that are not the rate of the positions.

    Args:
        times: [s], (k,), increasing, or ``datetime64``.
        q: joint positions [rad], (k, n).
        qd: joint velocities [rad/s], (k, n).
        tau: torques of the motors at the joints [N m], (k, n); NaN where they are unknown.
        robot: the arm, which names the joints.
        task: the path that it was to follow.

    Raises:
        InputError: shapes do not fit together, times do not increase, or positions or velocities are not finite.
        TaskError: the task returns something it must not, or has other joints.
    """
    time, first = _read_times(times)
    position = check_finite("q", _read_shape("q", q, time, None if robot is None else robot.n))
    n = position.shape[1]
    velocity = _differentiate(time, position) if qd is None else check_finite("qd", _read_shape("qd", qd, time, n))
    torque = np.full(position.shape, np.nan) if tau is None else _read_torques(tau, time, n)
    if task is not None:
        expect("task", task, PathTask, error=TaskError)
        refuse_batch("task", task)
        check_task(task, n)
    s = np.full(len(time), np.nan) if task is None else follow_path(task, position)
    along = path_variables(task, s, position, velocity)
    warn_of_log_slips(time, position, None if qd is None else velocity, torque, robot, along["e_p"])
    unknown = np.full(position.shape, np.nan)
    motion = {"q": position, "qd": velocity, "q_measured": position, "qd_measured": velocity}
    arrays = motion | {"tau_demand": unknown, "tau": torque, "s": s} | along
    names = [f"joint_{i + 1}" for i in range(n)]
    joints = dict.fromkeys(names, "rad") if robot is None else map_position_units(robot)
    outcome = complete_outcome(1, {} if task is None or not task.closed else {"laps": _count_laps(task, s)})
    rows = {name: array[None] for name, array in arrays.items()}
    config = _describe(time, first, robot, task)
    return Samples(time, joints, rows, outcome, np.arange(1)), config, RunContext.of(robot, task, model=robot)


def path_variables(task: PathTask | None, s: Array, q: Array, qd: Array) -> dict[str, Array]:
    """Return ``sdot``, ``e_p``, ``e_v`` and ``regular`` of an arm at (q, q̇), (k, n), with the path parameter s (k,)."""
    if task is None:
        unknown = np.full(q.shape, np.nan)
        return {"sdot": s, "e_p": unknown, "e_v": unknown, "regular": np.zeros(len(s), dtype=bool)}
    point, ending = task.at(s), Ending.of(task)
    plan = point if ending is None else ending.brake(point, s)
    e_p = np.broadcast_to(point.q_d, q.shape) - q
    gradient, along = np.vecdot(point.dq_d, point.dq_d), np.vecdot(point.dq_d, qd)
    denominator = gradient + np.vecdot(e_p, point.ddq_d)
    regular = denominator > _SINGULAR * gradient
    sdot = np.divide(along, denominator, out=np.zeros_like(s), where=regular)
    return {"sdot": sdot, "e_p": e_p, "e_v": plan.velocity - qd, "regular": regular & np.isfinite(s)}


def follow_path(task: PathTask, q: Array) -> Array:
    """Return σ̄ (k,) of postures (k, n) one after another, on the branch of the path on which the one before was."""
    s, found = np.asarray(task.sigma_bar(q[:1])), np.empty(len(q))
    for k in range(len(q)):
        s = _approach(task, q[k : k + 1], s)
        found[k] = s[0]
    return np.asarray(task.sigma_bar(q, near=found))


def _approach(task: PathTask, q: Array, s: Array) -> Array:
    """Return the parameter (1,) nearest to a posture (1, n) by Newton's method from ``s`` (1,)."""
    for _ in range(_STEPS):
        point = task.at(s)
        error, gradient = q - point.q_d, np.vecdot(point.dq_d, point.dq_d)
        curved = gradient - np.vecdot(error, point.ddq_d)
        step = np.vecdot(error, point.dq_d) / np.where(curved > 0.5 * gradient, curved, gradient)
        s = s + step
        if not task.closed:
            s = np.minimum(np.maximum(s, task.s0), task.s_end)
        if abs(step[0]) * np.sqrt(gradient[0]) < 1e-9:  # rad
            break
    return s


def _read_times(times: ArrayLike) -> tuple[Array, float]:
    """Return times [s] from 0 on, (k,), and the first one [s]."""
    given = np.asarray(times)
    if given.dtype.kind in "Mm" and given.ndim == 1 and len(given):
        passed = (given - given[0]) / np.timedelta64(1, "s")
        first = 0.0 if given.dtype.kind == "m" else float(given[0].astype("datetime64[ns]").astype(np.int64)) / 1e9
    elif given.dtype.kind in "iu" and given.ndim == 1 and len(given):  # exact, whatever the epoch
        passed, first = (given - given[0]).astype(np.float64), float(given[0])
    else:
        passed = check_finite("times", as_array("times", times))
        first = float(passed.flat[0]) if passed.size else 0.0
        passed = passed - first
    if passed.ndim != 1 or len(passed) < 2:
        raise InputError(
            f"times has shape {given.shape}, expected (k,), two or more times [s]", argument="times", value=given
        )
    if (back := np.flatnonzero(~(np.diff(passed) > 0))).size:
        i = int(back[0]) + 1
        raise InputError(
            f"times[{i}] = {given[i]} is not after times[{i - 1}] = {given[i - 1]}; expected increasing times: sort "
            "them, and drop samples that are repeated",
            argument="times",
            value=given[i],
            limit=given[i - 1],
            time=float(given[i]),
        )
    return passed, first


def _read_torques(tau: ArrayLike, time: Array, n: int) -> Array:
    """Return torques (k, n), NaN where they are unknown."""
    array = _read_shape("tau", tau, time, n)
    check_finite("tau", np.where(np.isnan(array), 0.0, array))
    return array


def _read_shape(name: str, values: ArrayLike, time: Array, n: int | None) -> Array:
    """Return an array (k, n) of its own, after a check of its shape."""
    array = as_array(name, values)
    if array.ndim != 2 or len(array) != len(time) or not array.shape[1] or n not in (None, array.shape[1]):
        turned = "; it is transposed, give its .T" if array.ndim == 2 and array.shape[1] == len(time) else ""
        raise InputError(
            f"{name} has shape {array.shape}, expected ({len(time)}, {'n' if n is None else n}): a row for each time, "
            f"a column for each joint{turned}",
            argument=name,
            value=array,
        )
    return np.array(as_joint_array(name, array, array.shape[1]))


def _differentiate(time: Array, q: Array) -> Array:
    """Return the central differences of positions (k, n), of second order also between irregular times."""
    return np.asarray(np.gradient(q, time, axis=0, edge_order=2 if len(time) > 2 else 1))


def _count_laps(task: PathTask, s: Array) -> Array:
    """Return the laps of a closed path, (1,)."""
    return count_laps(task, s[:1], s[-1:])


def _describe(time: Array, first: float, robot: RobotModel | None, task: PathTask | None) -> dict[str, Any]:
    """Return the configuration of a log."""
    law = {"controller": "log"} | ({} if task is None else {"task": task.describe()})
    return {
        "controller": law,
        "plant": {} if robot is None else {"robot": robot.name},
        "loop": {"loop": "log", "period": float(np.median(np.diff(time))), "begin": first},
        "versions": name_versions(),
    }
