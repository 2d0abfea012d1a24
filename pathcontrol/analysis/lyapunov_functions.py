"""The Lyapunov functions of the two path controllers and their derivatives along the closed loop.

V̇ ≤ 0 is that of exact compensation, q̈ = u: without friction that the law leaves, saturation or sampling. Of a run with
these V is what its errors give, and rises at many ticks once the errors are small.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.known import known_task
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.projection import Projection
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run


class Lyapunov(NamedTuple):
    """V ≥ 0 and its rate V̇ ≤ 0, each (*batch,)."""

    V: Array
    Vdot: Array


def extended_motion_plan_lyapunov(controller: ExtendedMotionPlan, s: Array, e_p: Array, e_v: Array) -> Lyapunov:
    """V = ½e_pᵀe_p + ½e_vᵀK_p⁻¹e_v [rad²] and V̇ = −e_vᵀK_p⁻¹K_v e_v − k(s)(e_pᵀq_d')² [rad²/s].

    Args:
        controller: the law, for its gains and task.
        s: path parameter, (*batch,).
        e_p: position error [rad], (*batch, n).
        e_v: velocity error [rad/s], (*batch, n).
    """
    return _extended(controller.K_p, controller.K_v, controller.plan_gain(s), e_p, e_v, controller.point(s).dq_d)


def projection_lyapunov(controller: Projection, e_p: Array, e_v: Array) -> Lyapunov:
    """V = ½e_vᵀe_v + ½k_p e_pᵀe_p [rad²/s²], eq. (42), and V̇ = −e_vᵀK_v e_v [rad²/s³].

    Args:
        controller: the law, for its gains.
        e_p: position error [rad], (*batch, n).
        e_v: velocity error [rad/s], (*batch, n).
    """
    return _projected(controller.k_p, controller.K_v, e_p, e_v)


@np.errstate(over="ignore", invalid="ignore")  # of numbers from a file, which may be huge
def lyapunov(controller: Controller, run: Run) -> Lyapunov:
    """V and V̇ of the controller's theorem along a run, each (rollout, time).

    V is evaluated at the errors of the run; V̇ is what the theorem gives there, not a difference of V.
    """
    expect("controller", controller, Controller)
    known_task(run, controller.task)
    e_p, e_v = run.array("e_p"), run.array("e_v")
    if isinstance(controller, ExtendedMotionPlan):
        s, K_p, K_v = run.array("s").T, _over_time(controller.K_p), _over_time(controller.K_v)
        # where a rollout has diverged its errors are NaN, whatever the path does; laws want the rollouts last in s
        tangent = controller.point(np.where(np.isfinite(s), s, controller.task.s0)).dq_d.swapaxes(0, 1)
        k = np.broadcast_to(controller.plan_gain(s), s.shape).T
        return _extended(K_p, K_v, k, e_p, e_v, tangent)
    if isinstance(controller, Projection):
        return _projected(_over_time(controller.k_p), _over_time(controller.K_v), e_p, e_v)
    raise InputError(
        f"no Lyapunov function is given for {type(controller).__name__}; use ExtendedMotionPlan or Projection, "
        "or ExtendedMotionPlan with k = 0 for computed torque"
    )


def _extended(K_p: Array, K_v: Array, k: Array, e_p: Array, e_v: Array, dq_d: Array) -> Lyapunov:
    along = (e_p * dq_d).sum(-1)
    V = 0.5 * (e_p**2).sum(-1) + 0.5 * (e_v**2 / K_p).sum(-1)
    return Lyapunov(V, -(e_v**2 * (K_v / K_p)).sum(-1) - k * along**2)


def _projected(k_p: Array, K_v: Array, e_p: Array, e_v: Array) -> Lyapunov:
    V = 0.5 * (e_v**2).sum(-1) + 0.5 * (k_p * e_p**2).sum(-1)
    return Lyapunov(V, -(K_v * e_v**2).sum(-1))


def _over_time(gain: Array) -> Array:
    """Gains (rollout, n) as (rollout, 1, n), to meet errors (rollout, time, n)."""
    return gain[:, None, :] if gain.ndim == 2 else gain
