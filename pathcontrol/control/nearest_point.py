"""Laws whose path parameter is that of the nearest point of the path."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import FrictionCompensation, Start
from pathcontrol.control.branch import Branch, BranchPolicy
from pathcontrol.control.reference_law import STEEPEST, Reference, ReferenceLaw
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.task import PathTask


class NearestPoint(ReferenceLaw):
    """The base of laws with σ̄, the parameter of the nearest point: (q_d(σ̄) − q)ᵀq_d'(σ̄) = 0, eq. (29).

    Its rate is dσ̄/dt = q_d'ᵀq̇ / (‖q_d'‖² + e_pᵀq_d''). Where no nearest point is defined (the denominator vanishes, as
    at the centre of a circle) the last σ̄ is kept and ``regular`` is False.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        branch: ``"follow"`` the branch of the path that the arm is on, until it is pushed away to another; always the
            ``"nearest"`` one; or ``"local"``, never another. See :class:`BranchPolicy`.
        capture: distance from its branch [rad] from which an arm counts as pushed away.
        friction: as of :class:`Controller`.
        start: as of :class:`Controller`; unless given, ``"s0"`` on a path that ends, and ``"nearest"`` on others.
        observer_hz: as of :class:`Controller`.
        more: arguments of the next base class.
    """

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        branch: Branch = "follow",
        capture: Annotated[float, Form.POSITIVE, Unit("rad")] = 0.1,
        friction: FrictionCompensation = "viscous",
        start: Start | None = None,
        observer_hz: Annotated[ArrayLike, Form.GAIN, Unit("Hz")] | None = None,
        **more: Any,
    ) -> None:
        given: dict[str, Any] = {"friction": friction, "observer_hz": observer_hz}
        super().__init__(robot, task, start="s0" if start is None else start, **given, **more)
        # an open path may end close to where it begins, and an arm at its begin be nearer to the end
        if start is None and not np.all(np.isfinite(task.s_end)):
            self.start_at = "nearest"
        self.branches = BranchPolicy(branch, capture)

    def project(self, q: Array, qd: Array, near: Array) -> Reference:
        """Return σ̄ with its gradient q_d'ᵀ/(‖q_d'‖² + e_pᵀq_d'')."""
        s = self.branches.sigma_bar(self.task, q, near)
        point = self.point(s)
        if (elsewhere := self.branches.captured(self.task, q, s, point.q_d)) is not s:
            s, point = elsewhere, self.point(elsewhere)
        squared = np.vecdot(point.dq_d, point.dq_d)
        denominator = squared + np.vecdot(point.q_d - q, point.ddq_d)
        regular = denominator * STEEPEST > squared
        if not regular.all():
            s = np.where(regular, s, near)
            point = self.point(s)
        moves = (regular & ~self._held_by_end(s, q, point))[..., None]
        gradient = np.divide(point.dq_d, denominator[..., None], out=np.zeros_like(point.dq_d), where=moves)
        return Reference(s, point, gradient, None, regular)

    def speed_gradient(self, q: Array, qd: Array, s: Array, velocity: Array) -> tuple[Array, Array]:
        return velocity, np.zeros(s.shape)  # the nearest point does not depend on q̇

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"branch": self.branches.branch, "capture": self.branches.capture}

    def _held_by_end(self, s: Array, q: Array, point: PathPoint) -> Array:
        """Return where the nearest point is an end of the open path and stays there as the arm moves."""
        if self.task.closed:
            return np.zeros(s.shape, dtype=bool)
        along = ((q - point.q_d) * point.dq_d).sum(-1)
        return (s <= self.task.s0) & (along < 0) | (s >= self.task.s_end) & (along > 0)
