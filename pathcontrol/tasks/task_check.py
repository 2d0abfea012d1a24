"""The check of a task before it is simulated."""

from __future__ import annotations

import numbers

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import describe, expect
from pathcontrol.errors import TaskError
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.regularity import check_regular, pick_irregular
from pathcontrol.tasks.task import PathTask, Reprofiled
from pathcontrol.tasks.values_check import check_values, count_joints

_SAMPLES = 129


def check_task(task: PathTask, n: int | None = None) -> None:
    """Check shapes and values of a task, or of each in a batch, on samples of its domain.

    Args:
        task: the task.
        n: the number of joints; those of q_d if it is left out.

    Raises:
        TaskError: it is not a path for ``n`` joints, returns a wrong shape or NaN, or ϑ is not positive somewhere.
    """
    if isinstance(task, TaskBatch):
        _check_each(task, n)
        return
    if isinstance(task, list | tuple):
        raise TaskError(
            f"task {describe(task)}, expected a PathTask, or TaskBatch([...]) of one for each rollout",
            argument="task",
            value=task,
        )
    expect("task", task, PathTask, error=TaskError)
    name = type(task).__name__
    _check_domain(task, name)
    lower, upper = task.sampled_interval
    if n is None:
        n = count_joints(task, name, lower)
    s = np.linspace(lower, upper, _SAMPLES)
    check_values(f"{name}.q_d", task.q_d, s, n)
    theta = check_values(f"{name}.theta", task.theta, s, None)
    if not (theta > 0).all():
        i = int(np.argmax(~(theta > 0)))
        raise TaskError(
            f"{name}.theta(s={s[i]:g}) = {theta[i]:g}, expected ϑ > 0 everywhere: where it is not, the motion plan "
            "ṡ = ϑ(s) stops for ever",
            value=float(theta[i]),
            s=float(s[i]),
        )
    _check_period(task, name)
    for method in ("dq_d", "ddq_d", "dtheta"):
        check_values(f"{name}.{method}", getattr(task, method), s, None if method == "dtheta" else n)
    check_regular(task)
    _check_projection(task, name, s[1:-1:16])
    inside = pick_irregular(task)
    for function, derivative in (("q_d", "dq_d"), ("dq_d", "ddq_d"), ("theta", "dtheta")):
        _check_derivative(task, name, inside, function, derivative)


def _check_each(batch: TaskBatch, n: int | None) -> None:
    """Check each different task of a batch."""
    for task, rows in batch.groups():
        try:
            check_task(task, n)
        except TaskError as error:
            raise TaskError(f"tasks[{rows[0]}]: {error}", **error.details_with()) from error


def _check_domain(task: PathTask, name: str) -> None:
    """Check the domain of a task."""
    for end in ("s0", "s_end", *(["period"] if task.period is not None else [])):
        value = getattr(task, end)
        if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
            raise TaskError(f"{name} has {end} = {value!r}, expected a number", value=value)
    if not np.isfinite(task.s0) or not task.s_end > task.s0:
        raise TaskError(
            f"{name} has s0 = {task.s0} and s_end = {task.s_end}, expected a finite s0 < s_end",
            value=task.s_end,
            limit=task.s0,
        )
    if task.period is not None and not (0 < task.period < np.inf and task.s_end == np.inf):
        raise TaskError(
            f"{name} has period = {task.period} and s_end = {task.s_end}; a closed path has a period > 0 and no s_end",
            value=task.period,
        )


def _check_projection(task: PathTask, name: str, s: Array) -> None:
    """Check that the projection of a class of one's own finds postures of the path on the path."""
    if isinstance(task, Reprofiled):  # has that of the path underneath
        _check_projection(task.path, type(task.path).__name__, s)
        return
    if type(task).sigma_bar is PathTask.sigma_bar or type(task).__module__.startswith("pathcontrol."):
        return
    label, q = f"{name}.sigma_bar", np.asarray(task.q_d(s), dtype=np.float64)
    for near in (None, s):
        try:
            found = np.asarray(task.sigma_bar(q, near), dtype=np.float64)
        except (TypeError, ValueError, IndexError) as error:
            raise TaskError(
                f"{label}(q, near) fails for q of shape {q.shape}: {error}; work on arrays with the joints last, "
                "q[..., 0], or leave sigma_bar out and have it computed"
            ) from error
        if found.shape != s.shape:
            raise TaskError(
                f"{label} of q with shape {q.shape} has shape {found.shape}, expected {s.shape}; joints come last: "
                "q[..., 0]",
                value=found.shape,
            )
        off = np.abs(np.asarray(task.q_d(found)) - q).max(-1)
        if not (worst := off.max()) <= 1e-3 * (1 + np.abs(q).max()):  # it may be found numerically
            i = int(off.argmax())
            raise TaskError(
                f"{label}(q_d(s={s[i]:g})) = {found[i]:g}, where the path is {worst:.3g} away from q; correct it, or "
                "leave sigma_bar out and have it computed",
                s=float(s[i]),
            )


def _check_derivative(task: PathTask, name: str, inside: Array, function: str, derivative: str) -> None:
    """Check a derivative given by hand against its function at most places inside; a few may be kinks."""
    h = 1e-5 * float(np.ptp(task.sampled_interval))
    f, given = getattr(task, function), getattr(task, derivative)(inside)
    difference = (f(inside + h) - f(inside - h)) / (2 * h) + 0.0 * np.asarray(given)
    off = np.abs(difference - given) > 1e-3 * (np.abs(difference) + np.abs(difference).max()) + 1e-6
    if np.count_nonzero(off) > 0.1 * off.size:
        i = tuple(np.argwhere(off)[0])
        raise TaskError(
            f"{name}.{derivative}(s={inside[i[0]]:g}) = {np.asarray(given)[i[0]]}, but {name}.{function} changes at "
            f"the rate {difference[i[0]]}; correct it, or leave {derivative} out and have it computed; if "
            f"it is, {function} is too rough to be differentiated",
            s=float(inside[i[0]]),
        )


def _check_period(task: PathTask, name: str) -> None:
    """Check that a closed path has the same posture and rate a period later."""
    if task.period is None:
        return
    s = task.s0 + np.array([0.0, 0.37 * task.period])
    for method in ("q_d", "theta"):
        here, later = (np.asarray(getattr(task, method)(x)) for x in (s, s + task.period))
        apart = np.abs(here - later)
        if not (apart <= 1e-6 * (1 + np.abs(here).max() + np.abs(later))).all():
            raise TaskError(
                f"{name}.{method} is not the same at s and s + period = s + {task.period:g}: it differs by "
                f"{apart.max():.3g}; correct the period, or leave it out and give s_end",
                value=float(apart.max()),
            )
