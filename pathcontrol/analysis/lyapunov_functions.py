"""The Lyapunov functions of laws of path control and their derivatives along the closed loop.

V̇ ≤ 0 holds for exact compensation, q̈ = u: without uncompensated friction, saturation or sampling. In a run with these
V follows from its errors, and rises at many ticks once the errors are small.

Of a law that is wrapped, for its speed to be overridden or paced, they are those of the law inside, with the velocity
error e_v = wr − q̇: no factor w(t) that is differentiable changes V̇.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.fitting_law import refuse_other_path, refuse_other_rows
from pathcontrol.analysis.metric_helpers import resolve_task
from pathcontrol.analysis.speed_factor import speed_factor
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.maneuver_regulation import ManeuverRegulation, StateMetric
from pathcontrol.control.projection import Projection
from pathcontrol.control.state_to_reference import StateToReferenceProjection
from pathcontrol.control.transverse_linearization import TransverseLinearization
from pathcontrol.control.wrappers.wrapper import LawWrapper, unwrap
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run


class Lyapunov(NamedTuple):
    """V ≥ 0 and its rate V̇ ≤ 0, each (*batch,)."""

    V: Array
    Vdot: Array


def extended_motion_plan_lyapunov(controller: ExtendedMotionPlan, s: Array, e_p: Array, e_v: Array) -> Lyapunov:
    """Return V and V̇ of the extended motion plan.

    V = ½e_pᵀe_p + ½e_vᵀK_p⁻¹e_v [rad²] and V̇ = −e_vᵀK_p⁻¹K_v e_v − k(s)(e_pᵀq_d')² [rad²/s].

    Args:
        controller: the law, for its gains and task.
        s: path parameter, (*batch,).
        e_p: position error [rad], (*batch, n).
        e_v: velocity error [rad/s], (*batch, n).
    """
    return _evaluate_extended(
        controller.K_p, controller.K_v, controller.plan_gain(s), e_p, e_v, controller.point(s).dq_d
    )


def state_to_reference_lyapunov(
    controller: StateToReferenceProjection, s: Array, sdot: Array, e_p: Array, e_v: Array
) -> Lyapunov:
    """Return V and V̇ of control by any state-to-reference projection.

    With the metric P of the law V = ½e_pᵀP e_p + ½e_vᵀP K_p⁻¹e_v, and V̇ = −e_vᵀP K_p⁻¹K_v e_v + e_pᵀP q_d'(ṡ − ϑ), in
    rad² and rad²/s for P without a unit. V̇ is at most 0 where the projection meets condition 3 of
    :class:`StateToReferenceProjection`, and only there.

    Args:
        controller: the law, for its gains, metric and task.
        s: path parameter, (*batch,).
        sdot: its rate [1/s], (*batch,).
        e_p: position error [rad], (*batch, n).
        e_v: velocity error [rad/s], (*batch, n).
    """
    point = controller.point(s)
    gains = controller.K_p, controller.K_v, controller.metric
    return _evaluate_referred(gains, e_p, e_v, point.dq_d * (sdot - point.theta)[..., None])


def projection_lyapunov(controller: Projection, e_p: Array, e_v: Array) -> Lyapunov:
    """Return V and V̇ of control by projection.

    V = ½e_vᵀe_v + ½k_p e_pᵀe_p [rad²/s²], eq. (42), and V̇ = −e_vᵀK_v e_v [rad²/s³].

    Args:
        controller: the law, for its gains.
        e_p: position error [rad], (*batch, n).
        e_v: velocity error [rad/s], (*batch, n).
    """
    return _evaluate_projected(controller.k_p, controller.K_v, e_p, e_v)


@np.errstate(over="ignore", invalid="ignore")  # numbers from a file may be huge
def lyapunov(controller: Controller, run: Run) -> Lyapunov:
    """Return V and V̇ of the controller's theorem along a run, each (rollout, time).

    V is evaluated at the errors of the run; V̇ is that of the theorem, not a difference of V. For
    :class:`ManeuverRegulation` V = eᵀPe, and for :class:`TransverseLinearization` that of the motion beside the path.

    Raises:
        InputError: no such function is known for the law, it goes along another path than the run, or its gains have
            rows for another number of rollouts.
    """
    expect("controller", controller, Controller)
    resolve_task(run, controller.task)
    refuse_other_rows(run, controller)
    refuse_other_path(run, controller)
    e_p, e_v = run.array("e_p"), run.array("e_v")
    if isinstance(controller, LawWrapper):  # whose plan waits for nothing where it is held
        controller = unwrap(controller).at_speed(speed_factor(run, controller.task).T)
    if isinstance(controller, ExtendedMotionPlan):
        s, K_p, K_v = run.array("s").T, _add_time_axis(controller.K_p), _add_time_axis(controller.K_v)
        # the errors of a diverged rollout are NaN, so that any s will do there; laws take the rollouts last in s
        tangent = controller.point(np.where(np.isfinite(s), s, controller.task.s0)).dq_d.swapaxes(0, 1)
        k = np.broadcast_to(controller.plan_gain(s), s.shape).T
        return _evaluate_extended(K_p, K_v, k, e_p, e_v, tangent)
    if isinstance(controller, Projection):
        return _evaluate_projected(_add_time_axis(controller.k_p), _add_time_axis(controller.K_v), e_p, e_v)
    if isinstance(controller, StateToReferenceProjection):
        s, sdot = (
            np.where(np.isfinite(part), part, controller.task.s0) for part in (run.array("s").T, run.array("sdot").T)
        )
        point = controller.point(s)
        lead = (point.dq_d * (sdot - point.theta)[..., None]).swapaxes(0, 1)
        gains = [_add_time_axis(gain) for gain in (controller.K_p, controller.K_v, controller.metric)]
        return _evaluate_referred(gains, e_p, e_v, lead)
    if isinstance(controller, ManeuverRegulation):
        metric = StateMetric(*map(_add_time_axis, controller.metric))
        by_e_p, by_e_v = metric.apply(e_p, e_v)
        V = (by_e_p * e_p + by_e_v * e_v).sum(-1)
        return Lyapunov(V, -(e_p**2 + e_v**2 / _add_time_axis(controller.K_p)).sum(-1))
    if isinstance(controller, TransverseLinearization):
        s = run.array("s").T
        tangent = controller.point(np.where(np.isfinite(s), s, controller.task.s0)).dq_d.swapaxes(0, 1)
        return _evaluate_transverse(controller.k_p, controller.k_v, e_p, e_v, tangent)
    raise InputError(
        f"no Lyapunov function of e_p and e_v is given for {type(controller).__name__}; the laws that have one are "
        "ExtendedMotionPlan (with k = 0 computed torque), StateToReferenceProjection, Projection, ManeuverRegulation "
        "and TransverseLinearization",
        argument="controller",
        value=controller,
    )


def _evaluate_extended(K_p: Array, K_v: Array, k: Array, e_p: Array, e_v: Array, dq_d: Array) -> Lyapunov:
    """Return V and V̇ of the extended motion plan for given gains and errors."""
    along = (e_p * dq_d).sum(-1)
    V = 0.5 * (e_p**2).sum(-1) + 0.5 * (e_v**2 / K_p).sum(-1)
    return Lyapunov(V, -(e_v**2 * (K_v / K_p)).sum(-1) - k * along**2)


def _evaluate_referred(gains: Sequence[Array], e_p: Array, e_v: Array, lead: Array) -> Lyapunov:
    """Return V and V̇ of a state-to-reference projection for K_p, K_v and P, errors, and q_d'(ṡ − ϑ) [rad/s]."""
    K_p, K_v, P = gains
    V = 0.5 * (P * (e_p**2 + e_v**2 / K_p)).sum(-1)
    return Lyapunov(V, (P * (e_p * lead - e_v**2 * (K_v / K_p))).sum(-1))


def _evaluate_projected(k_p: Array, K_v: Array, e_p: Array, e_v: Array) -> Lyapunov:
    """Return V and V̇ of control by projection for given gains and errors."""
    V = 0.5 * (e_v**2).sum(-1) + 0.5 * (k_p * e_p**2).sum(-1)
    return Lyapunov(V, -(K_v * e_v**2).sum(-1))


def _evaluate_transverse(k_p: Array, k_v: Array, e_p: Array, e_v: Array, dq_d: Array) -> Lyapunov:
    """Return V and V̇ of what is beside the path for gains () or (N, 1), errors, and q_d' [rad].

    V = ½Nq̇ᵀNq̇ + ½k_p e_pᵀe_p and V̇ = −k_v Nq̇ᵀNq̇, where Nq̇ = −Ne_v is the part of q̇ that is normal to the path.
    """
    along = (e_v * dq_d).sum(-1, keepdims=True) / (dq_d**2).sum(-1, keepdims=True)
    normal = ((e_v - along * dq_d) ** 2).sum(-1)
    return Lyapunov(0.5 * normal + 0.5 * k_p * (e_p**2).sum(-1), -k_v * normal)


def _add_time_axis(gain: Array) -> Array:
    """Return gains (rollout, n) as (rollout, 1, n), to match errors (rollout, time, n)."""
    return gain[:, None, :] if gain.ndim == 2 else gain
