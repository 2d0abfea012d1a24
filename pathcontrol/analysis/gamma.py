"""Distance of a state to the curve Γ of a task, eqs. (4) and (5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, joint_array, scalar
from pathcontrol.errors import InputError
from pathcontrol.tasks.base import PathTask
from pathcontrol.tasks.batch import TaskBatch
from pathcontrol.tasks.closest_point import ClosestPoint, Curve


def distance_to_gamma(
    task: PathTask, q: ArrayLike, qd: ArrayLike, weight: float = 1.0, return_s: bool = False
) -> Array | tuple[Array, Array]:
    """dist([q; q̇], Γ) = min over s of √(‖q_d(s) − q‖² + w²‖q_d'(s)ϑ(s) − q̇‖²), a global minimum.

    Γ is a curve in state space, so this is the closest-point problem of the path on [q_d; w q_d'ϑ].

    Args:
        task: path and velocity profile; its path ends or repeats.
        q: joint positions [rad], (*batch, n).
        qd: joint velocities [rad/s], (*batch, n).
        weight: w [s], how much a velocity counts beside a position; 1 as in the paper, 0 for the path alone.
        return_s: also return the path parameter of the nearest point of Γ.

    A :class:`TaskBatch` takes q and q̇ of shape (*batch, N, n).

    Returns:
        The distance [rad], (*batch,), and with ``return_s`` the parameter, (*batch,).

    Raises:
        TaskError: the path goes on for ever without repeating.
    """
    w = scalar("weight", weight, least=0.0)
    q, qd = joint_array("q", q, task.n), joint_array("qd", qd, task.n)
    if q.shape != qd.shape:
        raise InputError(f"q has shape {q.shape} and qd {qd.shape}, expected the same")
    if isinstance(task, TaskBatch):
        each = [distance_to_gamma(one, q[..., i, :], qd[..., i, :], w, True) for i, one in enumerate(task)]
        distance, s = (np.stack(parts, axis=-1) for parts in zip(*each, strict=True))
        return (distance, s) if return_s else distance
    state, gamma = np.concatenate([q, w * qd], axis=-1), gamma_curve(task, w)
    lower, upper = task.one_traverse
    s = ClosestPoint(gamma, lower, upper, task.closed, task.knots)(state)
    distance = np.linalg.norm(gamma.p(s) - state, axis=-1)
    return (distance, s) if return_s else distance


def gamma_curve(task: PathTask, weight: float = 1.0) -> Curve:
    """Γ as a curve s ↦ [q_d(s); w r(s)] in R²ⁿ, r = q_d'ϑ, with its derivative."""

    def p(s: Array) -> Array:
        point = task.at(s)
        return np.concatenate([point.q_d, weight * point.velocity], axis=-1)

    def dp(s: Array) -> Array:
        point = task.at(s)
        return np.concatenate([point.dq_d, weight * point.velocity_slope], axis=-1)

    return Curve(p, dp)
