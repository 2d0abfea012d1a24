"""The distance of a state to the curve Γ of a task, eqs. (4) and (5)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array, as_scalar
from pathcontrol._expect import expect
from pathcontrol.control.ending import Ending
from pathcontrol.engine.gamma_distance import distances_to_gamma
from pathcontrol.errors import EngineError, InputError, TaskError
from pathcontrol.geometry.closest_point import ClosestPoint, Curve
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask


def distance_to_gamma(
    task: PathTask, q: ArrayLike, qd: ArrayLike, weight: float = 1.0, return_s: bool = False, *, braking: bool = False
) -> Array | tuple[Array, Array]:
    """Return the distance of the state [q; q̇] to Γ, a global minimum, eq. (5).

    It is min over s of √(‖q_d(s) − q‖² + w²‖q_d'(s)ϑ(s) − q̇‖²). Γ is a curve in state space, so this is the
    closest-point problem of the path on [q_d; w q_d'ϑ]. It has a corner
    wherever ϑ' jumps, as at the knots of a table; the search begins by cutting it there.

    Args:
        task: path and velocity profile; its path ends or repeats.
        q: joint positions [rad], (*batch, n); fastest where states follow one another along the last axis of the batch.
        qd: joint velocities [rad/s], (*batch, n).
        weight: w [s], how much a velocity counts beside a position; 1 as in the paper, 0 for the path alone.
        return_s: also return the path parameter of the nearest point of Γ.
        braking: take ϑ as the controllers do at the end of an open path, where their plan comes to rest, see
            :class:`~pathcontrol.control.ending.Ending`; an arm that does exactly what the plan asks for is then at
            distance 0 to the last. Closed paths have nothing to brake for.

    A :class:`TaskBatch` takes q and q̇ of shape (*batch, N, n). For a :class:`PathSequence` the nearest of its paths
    counts.

    Returns:
        The distance [rad], (*batch,), and with ``return_s`` the parameter, (*batch,).

    Raises:
        TaskError: the path goes on for ever without repeating.
    """
    expect("task", task, PathTask, error=TaskError)
    w = as_scalar("weight", weight, least=0.0)
    q, qd = as_joint_array("q", q, task.n), as_joint_array("qd", qd, task.n)
    if q.shape != qd.shape:
        raise InputError(f"q has shape {q.shape} and qd {qd.shape}, expected the same", argument="qd", value=qd)
    if isinstance(task, TaskBatch):
        each = [_find_nearest(one, q[..., i, :], qd[..., i, :], w, braking) for i, one in enumerate(task)]
        distance, s = (np.stack(parts, axis=-1) for parts in zip(*each, strict=True))
    else:
        distance, s = _find_nearest(task, q, qd, w, braking)
    return (distance, s) if return_s else distance


def _find_nearest(task: PathTask, q: Array, qd: Array, weight: float, braking: bool) -> tuple[Array, Array]:
    """Return distance and parameter, (*batch,) each, for one task."""
    if isinstance(task, PathSequence):
        return _find_nearest_path(task, q, qd, weight, braking)
    try:
        if q.ndim > 1:
            return distances_to_gamma(task, q, qd, weight, braking)
    except EngineError:
        pass  # the search below is for any task, and needs no compiled library
    ending = Ending.of(task) if braking else None
    state, gamma = np.concatenate([q, weight * qd], axis=-1), _curve(plan_of(task, ending), weight)
    lower, upper = task.one_traverse
    s = ClosestPoint(gamma, lower, upper, task.closed, task.knots, _kinks(task, ending))(state)
    return np.linalg.norm(gamma.p(s) - state, axis=-1), s


def _find_nearest_path(
    sequence: PathSequence, q: Array, qd: Array, weight: float, braking: bool
) -> tuple[Array, Array]:
    """Return distance and parameter for the nearest path of a sequence; Γ jumps from one to the next."""
    each = [_find_nearest(path, q, qd, weight, braking) for path in sequence]
    shifts = [start - path.s0 for start, path in zip(sequence.starts, sequence, strict=False)]
    distances = np.stack([distance for distance, _ in each])
    parameters = np.stack([s + shift for (_, s), shift in zip(each, shifts, strict=True)])
    best = distances.argmin(0)[None]
    return np.take_along_axis(distances, best, 0)[0], np.take_along_axis(parameters, best, 0)[0]


def planned_rate(task: PathTask, s: Array) -> Array:
    """Return the rate ϑ(s) [1/s], (*batch,), of the controllers' plan, with braking at the end of an open path."""
    return rate_of(task, Ending.of(task))(s)


def rate_of(task: PathTask, ending: Ending | None) -> Callable[[Array], Array]:
    """Return ϑ as a function of s, with the ending of the controllers' plan where there is one."""
    if ending is None:
        return lambda s: np.broadcast_to(task.theta(s), np.shape(s))  # it may be a plain number
    return lambda s: task.theta(np.clip(s, task.s0, task.s_end)) * ending.share(s)


def plan_of(task: PathTask, ending: Ending | None) -> Callable[[Array], PathPoint]:
    """Return the task as a function of s, with the ending of the controllers' plan where there is one."""
    if ending is None:
        return task.at
    return lambda s: ending.brake(task.at(np.clip(s, task.s0, task.s_end)), s)


def _kinks(task: PathTask, ending: Ending | None) -> Array | None:
    """Return the parameters at which ϑ' jumps."""
    if ending is None:
        return task.profile_knots
    begin = np.array([ending.s_end - ending.braking])
    return begin if task.profile_knots is None else np.union1d(begin, task.profile_knots)


def _curve(at: Callable[[Array], PathPoint], weight: float) -> Curve:
    """Return Γ as a curve s ↦ [q_d(s); w r(s)] in R²ⁿ, r = q_d'ϑ, with its derivative."""

    def p(s: Array) -> Array:
        point = at(s)
        return np.concatenate([point.q_d, weight * point.velocity], axis=-1)

    def dp(s: Array) -> Array:
        point = at(s)
        return np.concatenate([point.dq_d, weight * point.velocity_slope], axis=-1)

    return Curve(p, dp)
