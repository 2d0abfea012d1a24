"""The second path controller: the path parameter is that of the nearest point of the path."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller, ControlOutput, diagonal_gain, scalar_gain
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint, PathTask

# σ̄ is called irregular where dσ̄/dq exceeds this many times its value on the path
_STEEPEST = 1e6


class Projection(Controller):
    """Path control by projection, eq. (39), for any path.

        (q_d(σ̄) − q)ᵀq_d'(σ̄) = 0,    dσ̄/dt = q_d'ᵀq̇ / (‖q_d'‖² + e_pᵀq_d'')
        τ = M(q)[r'(σ̄)dσ̄/dt + K_v e_v + k_p e_p] + C(q,q̇)q̇ + g(q) + f̂(q̇),   r = q_d'ϑ

    V = ½e_vᵀe_v + ½k_p e_pᵀe_p falls along the closed loop, V̇ = −e_vᵀK_v e_v, because e_p is orthogonal to the path;
    k_p must be a scalar for that. dσ̄/dt is the exact chain rule and keeps the sign that the square root printed below
    (39) loses. Where no nearest point is defined (the denominator vanishes, as at the centre of a circle) the last σ̄
    is kept and ``regular`` is False.

    The state is the last σ̄; it counts laps and tells branches apart.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        k_p: position gain [1/s²], a scalar.
        K_v: velocity gain [1/s], scalar or diagonal (n,).
        options: ``friction`` of :class:`Controller`.
    """

    gains = ("k_p", "K_v")

    def __init__(self, robot: RobotModel, task: PathTask, k_p: ArrayLike, K_v: ArrayLike, **options: Any) -> None:
        super().__init__(robot, task, **({"start": "nearest"} | options))
        self.k_p, self.K_v = scalar_gain("k_p", k_p), diagonal_gain("K_v", K_v, robot.n)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        s, point, sdot, regular = self._project(q, qd, z[..., 0])
        e_p, e_v = point.q_d - q, point.velocity - qd
        qdd = point.velocity_slope * sdot[..., None] + self.K_v * e_v + self.k_p * e_p
        tau = self.robot.inverse_dynamics(q, qd, qdd) + self.friction_torque(qd)
        none = np.zeros_like(s)
        return ControlOutput(tau, sdot[..., None], s, sdot, none, none, e_p, e_v, regular)

    def _project(self, q: Array, qd: Array, last: Array) -> tuple[Array, PathPoint, Array, Array]:
        """σ̄, the task there, dσ̄/dt, and where they are defined."""
        s = self.task.sigma_bar(q, near=last)
        point = self.point(s)
        gradient = (point.dq_d * point.dq_d).sum(-1)
        denominator = gradient + ((point.q_d - q) * point.ddq_d).sum(-1)
        regular = denominator * _STEEPEST > gradient
        if not regular.all():
            s = np.where(regular, s, last)
            point = self.point(s)
        along = (point.dq_d * qd).sum(-1)
        sdot = np.divide(along, denominator, out=np.zeros_like(along), where=regular & ~self._held_by_end(s, q, point))
        return s, point, sdot, regular

    def _held_by_end(self, s: Array, q: Array, point: PathPoint) -> Array:
        """Where the nearest point of an open path is one of its ends, and stays there as the arm moves."""
        if self.task.closed:
            return np.zeros(s.shape, dtype=bool)
        along = ((q - point.q_d) * point.dq_d).sum(-1)
        return (s <= self.task.s0) & (along < 0) | (s >= self.task.s_end) & (along > 0)
