"""The second path controller: its path parameter is that of the nearest point of the path."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller, ControlOutput, diagonal_gain, scalar_gain
from pathcontrol.control.branch import Branch, BranchPolicy
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.task import PathTask

# σ̄ is called irregular where dσ̄/dq exceeds this many times its value on the path
_STEEPEST = 1e6
# in continuous time: time constant [s] with which the state converges to σ̄ after it jumped
_CATCH_UP = 1e-2


class Projection(Controller):
    """Path control by projection, eq. (39): a path controller for any path.

        (q_d(σ̄) − q)ᵀq_d'(σ̄) = 0,    dσ̄/dt = q_d'ᵀq̇ / (‖q_d'‖² + e_pᵀq_d'')
        τ = M(q)[r'(σ̄)dσ̄/dt + K_v e_v + k_p e_p] + C(q,q̇)q̇ + g(q) + f̂(q̇),   r = q_d'ϑ

    Where the law compensates all friction, in continuous time and within the torque limits, V = ½e_vᵀe_v + ½k_p e_pᵀe_p
    does not grow: V̇ = −e_vᵀK_v e_v, because e_p is orthogonal to the path; k_p must be a scalar for that. With friction
    that is left, or torques held over a period, V falls only until the errors are as small as these make them.

    dσ̄/dt is the exact chain rule and keeps the sign that the square root printed below (39) loses. Where no
    nearest point is defined (the denominator vanishes, as at the centre of a circle) the last σ̄ is kept and
    ``regular`` is False.

    Nothing here pulls along the path an arm that dry friction holds, so the end of an open path is reached by the
    timed plan σ̇ = ϑ(σ), once σ is where :class:`Ending` begins; V̇ is the same. There the arm is held by k_p.

    The state is the last σ̄; it counts laps and tells branches apart. ``branch`` is the rule for leaving a branch.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        k_p: position gain [1/s²], a scalar.
        K_v: velocity gain [1/s], scalar or diagonal (n,).
        branch: ``"follow"`` the branch of the path that the arm is on, until it is pushed away to another; always the
            ``"nearest"`` one; or ``"local"``, never another. See :class:`BranchPolicy`.
        capture: distance from its branch [rad] from which an arm counts as pushed away.
        options: ``friction`` and ``start`` of :class:`Controller`; unless given, ``start`` is ``"s0"`` on a path that
            ends, and ``"nearest"`` on others.
    """

    gains = ("k_p", "K_v")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        k_p: Annotated[ArrayLike, Form.GAIN, Unit("1/s^2")],
        K_v: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        branch: Branch = "follow",
        capture: Annotated[float, Form.POSITIVE, Unit("rad")] = 0.1,
        **options: Any,
    ) -> None:
        # an open path may end close to where it begins, and an arm at its begin be nearer to the end
        super().__init__(robot, task, **options)
        if "start" not in options:
            self.start_at = "s0" if np.all(np.isfinite(task.s_end)) else "nearest"
        self.branches = BranchPolicy(branch, capture)
        self.k_p, self.K_v = scalar_gain("k_p", k_p), diagonal_gain("K_v", K_v, robot.n, robot.joint_names)

    def first_parameter(self, q: Array, qd: Array) -> Array:
        """Return σ̄, (*batch,), of an arm that starts at (q, q̇), on the branch that ``start`` names."""
        return self._project(q, qd, super().first_parameter(q, qd))[0]

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        last, none = z[..., 0], np.zeros(z.shape[:-1])
        s, point, sdot, regular = self._project(q, qd, last)
        slope = none
        if (self.ending is not None or self.speed is not None) and (timed := self.timed(last)).any():
            s = np.where(timed, last, s)
            point = self.point(s)
            sdot, slope = np.where(timed, point.theta, sdot), np.where(timed, point.dtheta, 0.0)
            regular = regular | timed
        e_p, e_v = point.q_d - q, point.velocity - qd
        qdd = point.velocity_slope * sdot[..., None] + self.K_v * e_v + self.k_p * e_p
        tau = self.robot.inverse_dynamics(q, qd, qdd) + self.friction_torque(qd, point.velocity)
        # in continuous time the state integrates dσ̄/dt; its offset, as after a change of branch, decays exponentially
        zdot = sdot + np.where(regular, (s - last) / _CATCH_UP, 0.0)
        out = ControlOutput(tau, zdot[..., None], s, sdot, slope, none, e_p, e_v, regular)
        return self.compensate(t, q, qd, z, out)

    def speed_response(self, s: Array, theta: Array) -> Array:
        return np.where(self.timed(s), theta, 0.0)

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"branch": self.branches.branch, "capture": self.branches.capture}

    def _project(self, q: Array, qd: Array, last: Array) -> tuple[Array, PathPoint, Array, Array]:
        """Return σ̄, the task there, dσ̄/dt, and where these are defined."""
        s = self.branches.sigma_bar(self.task, q, last)
        point = self.point(s)
        if (elsewhere := self.branches.captured(self.task, q, s, point.q_d)) is not s:
            s, point = elsewhere, self.point(elsewhere)
        gradient = np.vecdot(point.dq_d, point.dq_d)
        denominator = gradient + np.vecdot(point.q_d - q, point.ddq_d)
        regular = denominator * _STEEPEST > gradient
        if not regular.all():
            s = np.where(regular, s, last)
            point = self.point(s)
        along = np.vecdot(point.dq_d, qd)
        sdot = np.divide(along, denominator, out=np.zeros_like(along), where=regular & ~self._held_by_end(s, q, point))
        return s, point, sdot, regular

    def _held_by_end(self, s: Array, q: Array, point: PathPoint) -> Array:
        """Return where the nearest point is an end of the open path and stays there as the arm moves."""
        if self.task.closed:
            return np.zeros(s.shape, dtype=bool)
        along = ((q - point.q_d) * point.dq_d).sum(-1)
        return (s <= self.task.s0) & (along < 0) | (s >= self.task.s_end) & (along > 0)
