"""A motion plan whose rate has feedback from the arm, shared by the laws that use it."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller
from pathcontrol.control.gains import each_rollout, rollout_gain
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.task import PathTask


class Plan(NamedTuple):
    """The plan at one moment.

    Attributes:
        point: the task at σ.
        e_p: position error q_d(σ) − q [rad], (*batch, n).
        e_v: velocity error q_d'(σ)ϑ(σ) − q̇ [rad/s], (*batch, n).
        sdot: the rate σ̇ [1/s], (*batch,).
        slope: ∂σ̇/∂σ with the arm held still [1/s], (*batch,).
        drift: rate at which the arm's motion changes σ̇ [1/s²], (*batch,).
    """

    point: PathPoint
    e_p: Array
    e_v: Array
    sdot: Array
    slope: Array
    drift: Array


class PlanFeedback(Controller):
    """The base of laws whose plan waits for the arm, σ̇ = ϑ(σ) − k e_pᵀq_d'(σ), eq. (22).

    Over the last stretch of an open path k is 0 (:class:`Ending`), so that the plan cannot wait there for ever for an
    arm that dry friction holds.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        k: gain of the extended motion plan [1/(rad² s)], ≥ 0; a scalar, or one for each rollout, (N,) or (N, 1).
        options: ``friction`` and ``start`` of :class:`Controller`.
    """

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        k: Annotated[ArrayLike, Form.GAIN_OR_ZERO, Unit("1/rad^2/s")],
        **options: Any,
    ) -> None:
        super().__init__(robot, task, **options)
        self.k = each_rollout(rollout_gain("k", k))
        if (self.k < 0).any():
            raise InputError(
                f"k = {self.k.tolist()}, expected k ≥ 0: a negative gain drives the path away from the arm",
                argument="k",
                value=k,
                limit=0.0,
            )

    def plan(self, s: Array, q: Array, qd: Array) -> Plan:
        """Return the plan at s (*batch,) for an arm at q [rad] and q̇ [rad/s], (*batch, n)."""
        point, k = self.point(s), self.plan_gain(s)
        e_p, e_v = point.q_d - q, point.velocity - qd
        free = point.theta - k * np.vecdot(e_p, point.dq_d)
        sdot = self.inside(s, free)
        curvature = np.vecdot(point.dq_d, point.dq_d) + np.vecdot(e_p, point.ddq_d)
        slope, drift = point.dtheta - k * curvature, k * np.vecdot(qd, point.dq_d)
        if not self.task.closed:
            held = sdot != free  # at an end of the path
            slope, drift = np.where(held, 0.0, slope), np.where(held, 0.0, drift)
        return Plan(point, e_p, e_v, sdot, slope, drift)

    def plan_gain(self, s: Array) -> Array:
        """Return k(σ) [1/(rad² s)], (*batch,): ``k``, and 0 where the plan is timed."""
        return self.k if self.ending is None and self.speed is None else np.where(self.timed(s), 0.0, self.k)
