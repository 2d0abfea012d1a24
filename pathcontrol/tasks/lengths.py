"""Arc length and curvature of paths."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_finite
from pathcontrol._expect import expect
from pathcontrol.errors import InputError, TaskError
from pathcontrol.geometry.arc_length import ArcLength, curvature_vector
from pathcontrol.tasks.base import Task
from pathcontrol.tasks.values_check import check_path

_SAMPLES = 17


def arc_length(task: Task, s0: ArrayLike | None = None, s_end: ArrayLike | None = None) -> Array:
    """Return the length ∫‖q_d'‖ds [rad], (*batch,), from ``s0`` to ``s_end``, (*batch,) each; negative backwards.

    To about 1e-14 of the length for smooth paths, and for splines.

    Args:
        task: the path.
        s0: where to begin; by default where the path begins.
        s_end: where to end; by default where the path ends, or one lap after where it begins.

    Raises:
        InputError: an end is outside an open path, or left out where there is none; the shapes do not fit.
        TaskError: the path stands still somewhere, or returns a wrong shape or NaN.
    """
    expect("task", task, Task, error=TaskError)
    if s_end is None and not np.isfinite(last_parameter(task)):
        raise InputError(f"{type(task).__name__} neither ends nor repeats, so s_end is needed", argument="s_end")
    start = _check_inside(task, "s0", task.s0 if s0 is None else s0)
    end = _check_inside(task, "s_end", last_parameter(task) if s_end is None else s_end)
    try:
        both = np.stack(np.broadcast_arrays(start, end))
    except ValueError as error:
        raise InputError(
            f"s0 has shape {start.shape} and s_end {end.shape}, expected shapes that broadcast",
            argument="s_end",
            value=s_end,
        ) from error
    lower, upper = (
        (task.s0, last_parameter(task)) if task.closed else (both.min(initial=np.inf), both.max(initial=-np.inf))
    )
    if not lower < upper:  # no length to measure
        return np.zeros(both.shape[1:])
    length = length_along(task, float(lower), float(upper))(both)
    return length[1] - length[0]


def curvature(task: Task, s: ArrayLike) -> Array:
    """Return the curvature κ = ‖q_d' ∧ q_d''‖/‖q_d'‖³ [1/rad], (*batch,), at s (*batch,), in any parametrisation.

    ‖a ∧ b‖ is the area that a and b span; divided by ‖a‖ it is the part of b normal to a.
    """
    expect("task", task, Task, error=TaskError)
    s = as_array("s", s)
    return np.linalg.norm(curvature_vector(task.dq_d(s), task.ddq_d(s)), axis=-1)


def length_along(task: Task, lower: float, upper: float) -> ArcLength:
    """Return the arc length [rad] of a path from ``lower`` on, up to ``upper``, or all round a closed one."""
    check_path(task, np.linspace(lower, upper, _SAMPLES))
    return ArcLength(task.dq_d, lower, upper, task.closed, task.knots, type(task).__name__)


def last_parameter(task: Task) -> float:
    """Return the end of a path, or of its first lap; ``inf`` if it neither ends nor repeats."""
    return task.s_end if task.period is None else task.s0 + task.period


def _check_inside(task: Task, name: str, s: ArrayLike) -> Array:
    """Check that ``s`` is in the domain of the path."""
    s = check_finite(name, as_array(name, s))
    slack = 1e-12 * (1 + np.abs(s))
    outside = (s < task.s0 - slack) | (s > task.s_end + slack)
    if not task.closed and outside.any():
        raise InputError(
            f"{name} = {s[outside].flat[0]:g}, expected a number from {task.s0:g} to {task.s_end:g}",
            argument=name,
            value=s[outside].flat[0],
            limit=(task.s0, task.s_end),
            s=s[outside].flat[0],
        )
    return s
