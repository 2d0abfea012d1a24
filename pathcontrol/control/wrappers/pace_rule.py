"""The pace: how fast the plan may go within the torque limits of the arm."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.speed_rule import Moment, Speed, SpeedRule
from pathcontrol.profiles.topp.time_optimal import time_optimal
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.profile import END_TIME
from pathcontrol.tasks.task import PathTask

APPROACH = 0.02  # s, time constant with which w comes to the speed that is asked for, or possible
_FLAT = 1e-9  # share of the largest |∂τ/∂ẇ|/τ_max below which a joint does not depend on ẇ


class FastestPlan:
    """The largest factor of a profile with which the rest of a path can still be passed within torque limits.

    Args:
        robot: the arm, with its friction.
        task: the path, and the profile that the factor is of.
        torque: limits [N m], (n,).
        margin: share of them that is left to feedback.

    Attributes:
        robot: the arm, as given.
        task: the path, as given.
        fastest: the task with its time-optimal profile, or a batch of them.
    """

    def __init__(self, robot: RobotModel, task: PathTask, torque: Array, margin: float) -> None:
        self.robot, self.task, self._torque, self._margin = robot, task, torque, margin
        self.fastest = self._each(lambda one: one)

    def forward(self, s: Array) -> tuple[Array, Array]:
        """Return the largest w > 0 at s (*batch,) and its slope dw/ds, (*batch,) each."""
        return _compare_rates(self.fastest, self.task, s, s)

    def back(self, s: Array) -> tuple[Array, Array]:
        """Return the largest −w > 0 of a plan that goes back at s (*batch,), and its slope, (*batch,) each."""
        mirror = 2 * self.task.s0 if self.task.closed else self.task.s0 + self.task.s_end
        return _compare_rates(self.fastest_back, self.task, s, mirror - s)

    @cached_property
    def fastest_back(self) -> PathTask:
        """The reversed path with its time-optimal profile, which friction makes another one."""
        return self._each(lambda one: one.reversed())

    def _each(self, change: Callable[[PathTask], PathTask]) -> PathTask:
        """Return the changed task, or each of a batch, with its time-optimal profile."""
        if not isinstance(self.task, TaskBatch):
            return self._make_fastest(change(self.task))
        made = {id(one): self._make_fastest(change(one)) for one, _ in self.task.groups()}
        return TaskBatch([made[id(one)] for one in self.task])

    def _make_fastest(self, task: PathTask) -> PathTask:
        """Return a task with its time-optimal profile."""
        end, torque = None if task.closed else END_TIME, self._torque
        return task.with_profile(
            time_optimal(self.robot, task, velocity=None, torque=torque, margin=self._margin, end_time=end)
        )


def _compare_rates(fastest: PathTask, task: PathTask, s: Array, at: Array) -> tuple[Array, Array]:
    """Return ϑ of the ``fastest`` task at ``at`` over that of ``task`` at s, and the slope of this ratio in s."""
    point = task.at(s)
    ratio = fastest.theta(at) / point.theta  # points of its path are not needed
    direction = 1.0 if at is s else -1.0
    return ratio, (direction * fastest.dtheta(at) - ratio * point.dtheta) / point.theta


class PaceRule(SpeedRule):
    """The factor w follows the speed that is asked for as far as torque limits allow.

    Args:
        plan: the largest w from which the limits can be kept.
        torque: limits [N m], (n,).
        settings: what :meth:`describe` returns.
    """

    last = True

    def __init__(self, plan: FastestPlan, torque: Array, settings: dict[str, Any]) -> None:
        self.plan, self.torque, self._settings = plan, torque, settings

    def start(self, law: Controller, q: Array, qd: Array, s: Array) -> Array:
        """Return the factor at which the plan goes as fast as the arm, (*batch, 1)."""
        velocity, _ = law.full_speed(s)
        squared = np.vecdot(velocity, velocity)
        along = np.divide(np.vecdot(velocity, qd), squared, out=np.zeros_like(squared), where=squared > 0)
        return np.minimum(np.maximum(along, 0.0), self.plan.forward(s)[0])[..., None]

    def rate(self, moment: Moment, asked: Speed, x: Array) -> Array:
        """Return ẇ [1/s], (*batch,); a plan that goes back does what one that goes forward does, mirrored."""
        w = x[..., 0]
        way = np.where(w < 0, -1.0, 1.0)
        wanted, rest = way * self._wanted_rate(moment, asked, w), -way * w / APPROACH
        least, most = rate_bounds(moment.out.tau, way[..., None] * moment.gradient, self.torque)
        kept, turns = least <= most, way * asked.factor < 0
        # where nothing keeps all limits, slower is better; but no pace turns round unasked, it only comes to rest
        rate = np.where(kept, np.minimum(np.maximum(wanted, least), most), most)
        rate = np.where(kept & ~turns, rate, np.minimum(rate, 0.0))
        return np.asarray(way * np.maximum(rate, np.where(kept, np.minimum(wanted, rest), rest)))

    def describe(self) -> dict[str, Any]:
        return self._settings

    def _wanted_rate(self, moment: Moment, asked: Speed, w: Array) -> Array:
        """Return the ẇ with which w comes to the speed that is asked for, or to the largest one if that takes less.

        Along a largest one that falls, a plan below it has to brake too.
        """
        s, sdot = moment.out.s, moment.out.sdot
        wanted = asked.rate + (asked.factor - w) / APPROACH
        largest, slope = self.plan.forward(s)
        forward = np.minimum(wanted, slope * np.maximum(sdot, 0.0) + (largest - w) / APPROACH)
        if not (asked.factor < 0).any():
            return forward
        largest, slope = self.plan.back(s)
        back = np.maximum(wanted, -slope * np.minimum(sdot, 0.0) - (largest + w) / APPROACH)
        return np.where(asked.factor < 0, back, forward)


def rate_bounds(tau: Array, gradient: Array, torque: Array) -> tuple[Array, Array]:
    """Return the least and the largest ẇ for which |``tau`` + ẇ ``gradient``| ≤ ``torque``, (*batch,) each.

    Joints that hardly depend on ẇ are left out. Where no ẇ keeps all others within their limits, the least is larger.
    """
    share = np.abs(gradient) / torque
    flat = share <= _FLAT * share.max(-1, keepdims=True)
    slope = np.where(flat, 1.0, gradient)
    one, other = (-torque - tau) / slope, (torque - tau) / slope
    least = np.where(flat, -np.inf, np.minimum(one, other)).max(-1)
    return least, np.where(flat, np.inf, np.maximum(one, other)).min(-1)
