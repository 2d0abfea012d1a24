"""The first path controller: a motion plan whose rate has feedback from the arm."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import ControlOutput
from pathcontrol.control.gains import joint_gains
from pathcontrol.control.plan_feedback import PlanFeedback
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask


class ExtendedMotionPlan(PlanFeedback):
    """The extended motion plan, eqs. (22) and (25): a path controller for any path.

        σ̇ = ϑ(σ) − k e_pᵀq_d'(σ)
        τ = M(q)[r'(σ)σ̇ + K_v e_v + K_p e_p] + C(q,q̇)q̇ + g(q) + f̂(q̇),   r = q_d'ϑ

    with e_p = q_d(σ) − q and e_v = r(σ) − q̇. Where the law compensates all friction, in continuous time and within the
    torque limits, V = ½e_pᵀe_p + ½e_vᵀK_p⁻¹e_v does not grow: V̇ = −e_vᵀK_p⁻¹K_v e_v − k(e_pᵀq_d')². With friction that
    is left, or torques held over a period, V falls only until the errors are as small as these make them.

    k = 0 is computed torque on the timed trajectory, k → ∞ the projection law.
    Over the last stretch of an open path k is 0 (:class:`Ending`), so that the plan cannot wait there for ever for an
    arm that dry friction holds; the theorem asks for no more than k(σ) ≥ 0.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        K_p: position gain [1/s²], scalar or diagonal (n,).
        K_v: velocity gain [1/s], scalar or diagonal (n,).
        k: gain of the extended motion plan [1/(rad² s)], ≥ 0; a scalar, or one for each rollout, (N,) or (N, 1).
        options: ``friction`` and ``start`` of :class:`Controller`.
    """

    gains = ("K_p", "K_v", "k")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        K_p: Annotated[ArrayLike, Form.GAIN, Unit("1/s^2")],
        K_v: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        k: Annotated[ArrayLike, Form.GAIN_OR_ZERO, Unit("1/rad^2/s")],
        **options: Any,
    ) -> None:
        super().__init__(robot, task, k, **options)
        self.K_p, self.K_v = joint_gains(robot, K_p=K_p, K_v=K_v)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        s = z[..., 0]
        point, e_p, e_v, sdot, slope, drift = self.plan(s, q, qd)
        qdd = point.velocity_slope * sdot[..., None] + self.K_v * e_v + self.K_p * e_p
        tau = self.robot.inverse_dynamics(q, qd, qdd) + self.friction_torque(qd, point.velocity)
        out = ControlOutput(tau, sdot[..., None], s, sdot, slope, drift, e_p, e_v, np.isfinite(s))
        return self.compensate(t, q, qd, z, out)
