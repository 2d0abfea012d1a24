"""Adaptive control on a path parameter: the law learns the masses and inertias of its arm while it follows a path."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import ControlOutput
from pathcontrol.control.gains import joint_gains, rollout_gain
from pathcontrol.control.plan_feedback import Plan, PlanFeedback
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask

_PARAMETERS = 10  # of a rigid body
_MOMENTS = [4, 6, 9]  # Ixx, Iyy and Izz among them, which sum up to twice ∫‖r‖²dm


class AdaptiveSlotineLi(PlanFeedback):
    """Slotine and Li's adaptive law (Int. J. Robotics Research 6(3), 1987), on the extended motion plan.

        σ̇ = ϑ(σ) − k e_pᵀq_d'(σ),    ė_p = q_d'σ̇ − q̇
        q̇_s = r(σ) + Λe_p,    q̈_s = r'(σ)σ̇ + Λė_p,    x = q̇_s − q̇,    r = q_d'ϑ
        τ = Y(q, q̇, q̇_s, q̈_s)θ̂ + K_d x + f̂(q̇),    dθ̂/dt = ΓYᵀx

    Yθ = M(q)q̈_s + C(q,q̇)q̇_s + g(q) is linear in the inertial parameters θ of the bodies that the joints move, ten for
    each; :attr:`RobotModel.inertial_parameters` lists them. θ̂ begins with those of the law's own model. Rotor inertia
    is taken as known.

    With θ̃ = θ − θ̂, in continuous time, all friction compensated and no torque at its limit,

        V = ½xᵀM(q)x + ½θ̃ᵀΓ⁻¹θ̃,    V̇ = −xᵀK_d x.

    So V, with the parameters' error in it, never grows, whatever σ̇ is: this proof does not ask for time, and k ≥ 0
    is as free as in the extended motion plan. x is square integrable, and e_p tends to 0 with it, as
    ½d‖e_p‖²/dt = −e_pᵀΛe_p − k(e_pᵀq_d')² + e_pᵀx. θ̂ need not tend to θ: it explains the torques of this path only.
    Friction that is not compensated, noise and torque limits are taken for inertia, and θ̂ may drift with them.

    Γ is diagonal, γm² for masses, γ(ml)² for m c and γ(ml²)² for inertias, with γ the ``adaptation``, m the mass that
    the joints move and l its radius of gyration about them, so that each parameter is learnt in its own unit.
    The state z is σ, and at its end θ̂ − θ of the law's model, (10n,).

    Args:
        robot: the model the law begins with.
        task: path and velocity profile.
        Lambda: Λ [1/s], scalar or diagonal (n,).
        K_d: gain on x [N m s/rad], scalar or diagonal (n,).
        adaptation: γ [1/J], ≥ 0, a scalar or one for each rollout, (N,). With 0 nothing is learnt, and with k = 0 too
            this is :class:`SlotineLi`.
        k: gain of the extended motion plan [1/(rad² s)], ≥ 0, a scalar or one for each rollout, (N,).
        options: ``friction`` and ``start`` of :class:`Controller`.
    """

    gains = ("Lambda", "K_d", "adaptation", "k")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        Lambda: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        K_d: Annotated[ArrayLike, Form.GAIN, Unit("N m s/rad")],
        adaptation: Annotated[ArrayLike, Form.GAIN_OR_ZERO, Unit("1/J")],
        k: Annotated[ArrayLike, Form.GAIN_OR_ZERO, Unit("1/rad^2/s")] = 0.0,
        **options: Any,
    ) -> None:
        super().__init__(robot, task, k, **options)
        self.Lambda, self.K_d = joint_gains(robot, Lambda=Lambda, K_d=K_d)
        self.adaptation = rollout_gain("adaptation", adaptation)
        if (self.adaptation < 0).any():
            raise InputError(
                f"adaptation = {self.adaptation.tolist()}, expected 0 or more: a negative one unlearns the parameters",
                argument="adaptation",
                value=adaptation,
                limit=0.0,
            )

    @property
    def adaptation_matrix(self) -> Array:
        """The diagonal of Γ, (10n,), or of each rollout, (N, 10n)."""
        bodies = self.robot.inertial_parameters.reshape(-1, _PARAMETERS)
        mass = bodies[:, 0].sum()
        gyration = np.sqrt(0.5 * bodies[:, _MOMENTS].sum() / mass)
        scale = mass * np.repeat([1.0, gyration, gyration**2], [1, 3, 6])
        return np.asarray(self.adaptation * np.tile(scale**2, self.robot.n))

    def start(self, q: ArrayLike, qd: ArrayLike) -> Array:
        z = super().start(q, qd)
        return np.concatenate([z, np.zeros((*z.shape[:-1], _PARAMETERS * self.robot.n))], axis=-1)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        s, learnt = z[..., 0], self.learnt(z)
        point, e_p, e_v, sdot, slope, drift = plan = self.plan(s, q, qd)
        velocity, acceleration = self._reference(plan, qd)
        sliding = velocity - qd
        regressor = self.robot.torque_regressor(q, qd, acceleration, velocity=velocity)
        known = self.robot.inverse_dynamics(q, qd, acceleration, velocity=velocity)
        tau = known + (regressor * learnt[..., None, :]).sum(-1) + self.K_d * sliding
        tau = tau + self.friction_torque(qd, point.velocity)
        out = ControlOutput(tau, sdot[..., None], s, sdot, slope, drift, e_p, e_v, np.isfinite(s))
        out = self.compensate(t, q, qd, z, out)
        rate = self.adaptation_matrix * (regressor * sliding[..., None]).sum(-2)
        return out._replace(zdot=np.concatenate([out.zdot, rate], axis=-1))

    def learning_rate(self, q: Array, qd: Array, z: Array) -> Array:
        """Return the largest eigenvalue of K_d⁻¹YΓYᵀ [1/s], (*batch,), at (q, q̇) and z: how fast x makes a torque.

        Times the period of a sampled loop it should be below 1.
        """
        velocity, acceleration = self._reference(self.plan(z[..., 0], q, qd), qd)
        regressor = self.robot.torque_regressor(q, qd, acceleration, velocity=velocity)
        root = 1 / np.sqrt(np.broadcast_to(self.K_d, q.shape))[..., None]
        scaled = root * regressor * np.sqrt(self.adaptation_matrix)[..., None, :]
        return np.asarray(np.linalg.norm(scaled, ord=2, axis=(-2, -1)) ** 2)

    def _reference(self, plan: Plan, qd: Array) -> tuple[Array, Array]:
        """Return q̇_s [rad/s] and q̈_s [rad/s²], (*batch, n)."""
        rate = plan.sdot[..., None]
        velocity = plan.point.velocity + self.Lambda * plan.e_p
        return velocity, plan.point.velocity_slope * rate + self.Lambda * (plan.point.dq_d * rate - qd)

    def advance(self, z: Array, out: ControlOutput, period: float) -> Array:
        learnt = self.learnt(z) + period * self.learnt(out.zdot)
        return np.concatenate([super().advance(z, out, period), learnt], axis=-1)

    def learnt(self, z: Array) -> Array:
        """Return θ̂ less the parameters of the law's model, (*batch, 10n), of a state z."""
        return np.asarray(z)[..., -_PARAMETERS * self.robot.n :]
