"""The theorems of the control laws: V, its rate in the closed loop without errors, and the torque of that loop.

Every law asks for the torque τ* = τ_r + f̂, where f̂ is the friction that it compensates. Where the arm is the law's
model, q̈* = M⁻¹(τ_r − Cq̇ − g) is the acceleration of the closed loop, and σ̇* the rate of its path parameter, the
theorem gives V̇* = −…. Along any other motion of the same state, with q̈ and σ̇,

    V̇ − V̇* = ∂V/∂σ (σ̇ − σ̇*) + ∂V/∂q̇ (q̈ − q̈*).

With a speed factor w the velocity error is e_v = wr − q̇, and w has a rate ẇ; neither changes V̇*.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.maneuver_regulation import ManeuverRegulation
from pathcontrol.control.motion_control import ComputedTorque, PDPlus, SlotineLi
from pathcontrol.control.projection import Projection
from pathcontrol.control.state_to_reference import StateToReferenceProjection
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import InputError


class LoopState(NamedTuple):
    """States of a closed loop, (k, N) of them, with n joints.

    Attributes:
        q: joint positions [rad], (k, N, n).
        qd: joint velocities [rad/s], (k, N, n).
        e_p: position error q_d(σ) − q [rad], (k, N, n).
        e_v: velocity error wr(σ) − q̇ [rad/s], (k, N, n).
        dq_d: q_d'(σ) [rad], (k, N, n).
        r: q_d'ϑ [rad/s], (k, N, n).
        slope: ∂(wr)/∂σ [rad/s], (k, N, n).
        sdot: σ̇* [1/s], the rate of the path parameter that the theorem has there, (k, N).
        plan_rate: wϑ(σ) [1/s], (k, N).
        gain: k(σ) of the extended motion plan, 0 for other laws, (k, N).
    """

    q: Array
    qd: Array
    e_p: Array
    e_v: Array
    dq_d: Array
    r: Array
    slope: Array
    sdot: Array
    plan_rate: Array
    gain: Array

    def part(self, span: slice) -> LoopState:
        """Return some of the states, one after another in time."""
        return LoopState(*(field[span] for field in self))

    def acceleration(self, wdot: Array) -> Array:
        """Return d(wr)/dt [rad/s²], (k, N, n), where w has the rate ẇ (k, N)."""
        return self.slope * self.sdot[..., None] + wdot[..., None] * self.r


class Energy(NamedTuple):
    """V and its rate in the closed loop of the theorem, and the derivatives of V.

    Attributes:
        V: the Lyapunov function, (k, N).
        rate: V̇*, (k, N).
        by_velocity: −∂V/∂q̇, (k, N, n).
        by_parameter: ∂V/∂σ, (k, N).
    """

    V: Array
    rate: Array
    by_velocity: Array
    by_parameter: Array


class Theorem(Protocol):
    """The theorem of one law.

    Attributes:
        unit: unit of V for joints that turn.
    """

    unit: str

    def energy(self, at: LoopState) -> Energy:
        """Return V with its rate and derivatives."""

    def demand(self, at: LoopState, wdot: Array) -> tuple[Array, Array]:
        """Return the torque τ_r [N m] and the acceleration q̈* [rad/s²], (k, N, n) each."""


def theorem_of(controller: Controller) -> Theorem:
    """Return the theorem of a law, or of the law inside a wrapper.

    Raises:
        InputError: none is known.
    """
    law = unwrap(controller)
    for kind, make in _THEOREMS.items():
        if isinstance(law, kind):
            return make(law)
    known = ", ".join(kind.__name__ for kind in _THEOREMS)
    raise InputError(
        f"no Lyapunov function is given for {type(law).__name__}; expected one of {known}",
        argument="controller",
        value=controller,
    )


class _LinearErrors:
    """The laws with q̈* = d(wr)/dt + K_v e_v + K_p e_p.

    V = ½e_pᵀP e_p + ½e_vᵀP K_p⁻¹e_v and V̇* = −e_vᵀP K_p⁻¹K_v e_v + e_pᵀP q_d'(σ̇* − wϑ). The last term is 0 for a timed
    plan and a projection to the nearest point, and −k(e_pᵀq_d')² for the extended motion plan, with P = 1.
    """

    def __init__(self, law: ComputedTorque | ExtendedMotionPlan | StateToReferenceProjection) -> None:
        self._law, self._K_p, self._K_v = law, law.K_p, law.K_v
        self._P = law.metric if isinstance(law, StateToReferenceProjection) else np.ones(())
        self.unit = "rad^2/s^2" if isinstance(law, Projection) else "rad^2"

    def energy(self, at: LoopState) -> Energy:
        P, W = self._P, self._P / self._K_p
        V = 0.5 * (P * at.e_p**2 + W * at.e_v**2).sum(-1)
        rate = self._along(at) - (W * self._K_v * at.e_v**2).sum(-1)
        return Energy(V, rate, W * at.e_v, (P * at.e_p * at.dq_d + W * at.e_v * at.slope).sum(-1))

    def demand(self, at: LoopState, wdot: Array) -> tuple[Array, Array]:
        acceleration = at.acceleration(wdot) + self._K_v * at.e_v + self._K_p * at.e_p
        return self._law.robot.inverse_dynamics(at.q, at.qd, acceleration), acceleration

    def _along(self, at: LoopState) -> Array:
        """Return the part of V̇* from the path parameter, (k, N)."""
        if isinstance(self._law, ExtendedMotionPlan):
            return -at.gain * (at.e_p * at.dq_d).sum(-1) ** 2
        if isinstance(self._law, Projection | ComputedTorque):
            return np.zeros(at.sdot.shape)
        return np.asarray((self._P * at.e_p * at.dq_d).sum(-1) * (at.sdot - at.plan_rate))


class _KeptDynamics:
    """The laws that keep the arm's own dynamics: V has the metric M(q), and q̈* follows from the torque."""

    unit = "J"

    def __init__(self, law: PDPlus | SlotineLi) -> None:
        self._law = law

    def _inertial(self, at: LoopState, velocity: Array) -> Array:
        """Return M(q) times a velocity [N m s], (k, N, n)."""
        return self._law.robot.momentum(at.q, velocity)

    def _accelerate(self, at: LoopState, torque: Array) -> tuple[Array, Array]:
        """Return a torque with the acceleration that it gives the law's model."""
        return torque, self._law.robot.forward_dynamics(at.q, at.qd, torque)


class _PDPlus(_KeptDynamics):
    """PD+: V = ½e_vᵀM e_v + ½e_pᵀK_p e_p [J] and V̇* = −e_vᵀK_v e_v (Paden and Panja, Int. J. Control 47, 1988)."""

    _law: PDPlus

    def energy(self, at: LoopState) -> Energy:
        K_p, K_v = self._law.K_p, self._law.K_v
        momentum = self._inertial(at, at.e_v)
        V = 0.5 * (momentum * at.e_v + K_p * at.e_p**2).sum(-1)
        by_parameter = (momentum * at.slope + K_p * at.e_p * at.dq_d).sum(-1)
        return Energy(V, -(K_v * at.e_v**2).sum(-1), momentum, by_parameter)

    def demand(self, at: LoopState, wdot: Array) -> tuple[Array, Array]:
        law, desired = self._law, at.qd + at.e_v
        torque = law.robot.inverse_dynamics(at.q, at.qd, at.acceleration(wdot), velocity=desired)
        return self._accelerate(at, torque + law.K_v * at.e_v + law.K_p * at.e_p)


class _SlotineLi(_KeptDynamics):
    """Slotine and Li's law with ς = e_v + Λe_p: V = ½ςᵀMς + e_pᵀΛK_d e_p [J].

    V̇* = −e_vᵀK_d e_v − e_pᵀΛK_dΛe_p (Spong, Ortega and Kelly, IEEE Trans. Automatic Control 35, 1990).
    """

    _law: SlotineLi

    def energy(self, at: LoopState) -> Energy:
        L, K_d = self._law.Lambda, self._law.K_d
        sliding = at.e_v + L * at.e_p
        momentum = self._inertial(at, sliding)
        V = 0.5 * (momentum * sliding).sum(-1) + (L * K_d * at.e_p**2).sum(-1)
        rate = -(K_d * (at.e_v**2 + (L * at.e_p) ** 2)).sum(-1)
        by_parameter = (momentum * (at.slope + L * at.dq_d) + 2 * L * K_d * at.e_p * at.dq_d).sum(-1)
        return Energy(V, rate, momentum, by_parameter)

    def demand(self, at: LoopState, wdot: Array) -> tuple[Array, Array]:
        law, L = self._law, self._law.Lambda
        velocity = at.qd + at.e_v + L * at.e_p
        acceleration = at.acceleration(wdot) + L * at.e_v
        torque = law.robot.inverse_dynamics(at.q, at.qd, acceleration, velocity=velocity)
        return self._accelerate(at, torque + law.K_d * (velocity - at.qd))


class _ManeuverRegulation:
    """Maneuver regulation: V = eᵀPe, e = (e_p, e_v), and V̇* = −e_pᵀe_p − e_vᵀK_p⁻¹e_v (Hauser and Hindman, 1995)."""

    unit = "rad^2 s"

    def __init__(self, law: ManeuverRegulation) -> None:
        self._law = law

    def energy(self, at: LoopState) -> Energy:
        by_e_p, by_e_v = self._law.metric.apply(at.e_p, at.e_v)
        V = (by_e_p * at.e_p + by_e_v * at.e_v).sum(-1)
        rate = -(at.e_p**2 + at.e_v**2 / self._law.K_p).sum(-1)
        return Energy(V, rate, 2 * by_e_v, 2 * (by_e_p * at.dq_d + by_e_v * at.slope).sum(-1))

    def demand(self, at: LoopState, wdot: Array) -> tuple[Array, Array]:
        law = self._law
        desired = at.slope * at.plan_rate[..., None] + wdot[..., None] * at.r
        acceleration = desired + law.K_v * at.e_v + law.K_p * at.e_p
        return law.robot.inverse_dynamics(at.q, at.qd, acceleration), acceleration


_THEOREMS = {
    ManeuverRegulation: _ManeuverRegulation,
    ExtendedMotionPlan: _LinearErrors,
    StateToReferenceProjection: _LinearErrors,
    ComputedTorque: _LinearErrors,
    PDPlus: _PDPlus,
    SlotineLi: _SlotineLi,
}
