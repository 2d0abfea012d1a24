"""The second path controller: its path parameter is that of the nearest point of the path."""

from __future__ import annotations

from typing import Annotated, Any

from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import FrictionCompensation, Start
from pathcontrol.control.branch import Branch
from pathcontrol.control.gains import scalar_gain
from pathcontrol.control.nearest_point import NearestPoint
from pathcontrol.control.state_to_reference import StateToReferenceProjection
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask


class Projection(NearestPoint, StateToReferenceProjection):
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
        friction: as of :class:`Controller`.
        start: as of :class:`Controller`; unless given, ``"s0"`` on a path that ends, and ``"nearest"`` on others.
        observer_hz: as of :class:`Controller`.
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
        friction: FrictionCompensation = "viscous",
        start: Start | None = None,
        observer_hz: Annotated[ArrayLike, Form.GAIN, Unit("Hz")] | None = None,
    ) -> None:
        self.k_p = scalar_gain("k_p", k_p)
        given: dict[str, Any] = {"friction": friction, "start": start, "observer_hz": observer_hz}
        super().__init__(robot, task, branch, capture, K_p=self.k_p, K_v=K_v, **given)

    def reference(self, q: Array, qd: Array, near: Array) -> Array:
        return self.project(q, qd, near).s

    @property
    def metric(self) -> Array:
        return self.k_p
