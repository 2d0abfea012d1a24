"""The Lyapunov functions of the two path controllers and their derivatives along the closed loop.

They hold for exact compensation, M(q)q̈ = M(q)u: without unmodelled friction, saturation or sampling.
"""

from __future__ import annotations

from typing import NamedTuple

from pathcontrol._arrays import Array
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
    """V = ½e_pᵀe_p + ½e_vᵀK_p⁻¹e_v [rad²] and V̇ = −e_vᵀK_p⁻¹K_v e_v − k(e_pᵀq_d')² [rad²/s].

    Args:
        controller: the law, for its gains and task.
        s: path parameter, (*batch,).
        e_p: position error [rad], (*batch, n).
        e_v: velocity error [rad/s], (*batch, n).
    """
    K_p, K_v = controller.K_p, controller.K_v
    along = (e_p * controller.point(s).dq_d).sum(-1)
    V = 0.5 * (e_p**2).sum(-1) + 0.5 * (e_v**2 / K_p).sum(-1)
    return Lyapunov(V, -(e_v**2 * (K_v / K_p)).sum(-1) - controller.k * along**2)


def projection_lyapunov(controller: Projection, e_p: Array, e_v: Array) -> Lyapunov:
    """V = ½e_vᵀe_v + ½k_p e_pᵀe_p [rad²/s²], eq. (42), and V̇ = −e_vᵀK_v e_v [rad²/s³].

    Args:
        controller: the law, for its gains.
        e_p: position error [rad], (*batch, n).
        e_v: velocity error [rad/s], (*batch, n).
    """
    V = 0.5 * (e_v**2).sum(-1) + 0.5 * (controller.k_p * e_p**2).sum(-1)
    return Lyapunov(V, -(controller.K_v * e_v**2).sum(-1))


def lyapunov(controller: Controller, run: Run) -> Lyapunov:
    """V and V̇ of the controller's theorem along a run, each (rollout, time).

    V is evaluated at the errors of the run; V̇ is what the theorem gives there, not a difference of V.
    """
    e_p, e_v = run.array("e_p"), run.array("e_v")
    if isinstance(controller, ExtendedMotionPlan):
        return extended_motion_plan_lyapunov(controller, run.array("s"), e_p, e_v)
    if isinstance(controller, Projection):
        return projection_lyapunov(controller, e_p, e_v)
    raise InputError(
        f"no Lyapunov function is given for {type(controller).__name__}; use ExtendedMotionPlan or Projection, "
        "or ExtendedMotionPlan with k = 0 for computed torque"
    )
