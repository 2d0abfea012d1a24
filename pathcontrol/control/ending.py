"""The end of the motion plan of an open path: braking, timing and arrival."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.batch.task_batch import TaskBatch, map_tasks
from pathcontrol.tasks.profile import END_TIME
from pathcontrol.tasks.task import PathTask

_SAMPLES = 257  # samples of the path for its average speed
_SHORTEST = 1e-150  # braking length below which its inverse would overflow
_REMAINING = 1e-4  # rad (or m) of joint path that a plan at the end may have left


class Ending(NamedTuple):
    """The last stretch of an open path, where the plan no longer waits for the arm and comes to rest.

    The plan comes to rest at s_end exponentially, with the time constant T = 0.1 s: over the last s_end − s < Tϑ(s_end)
    its rate is ϑ(s)(s_end − s)/(Tϑ(s_end)). A profile that is slow at its end has little left to brake.

    A plan with feedback from the arm would wait for ever where dry friction holds the arm and ϑ tends to 0. So every
    plan is timed, σ̇ = ϑ(σ), once it has come to the last joint path that takes T at the average speed of the whole,
    or to the braking if that is longer. The arm is drawn to the end by its position gain and held there.

    Attributes:
        s_end: last path parameter, as all of these a number, or (N,) for a batch of tasks in which it differs.
        braking: Tϑ(s_end), the length of parameter over which ϑ is brought to 0.
        begin: path parameter from which on the plan is timed.
    """

    s_end: float | Array
    braking: float | Array
    begin: float | Array

    @classmethod
    def of(cls, task: PathTask) -> Self | None:
        """Return the ending of ``task``, ``None`` where it has none."""
        if isinstance(task, TaskBatch):
            return None if task.closed else cls(*map_tasks(task, cls.of).T)
        if not np.isfinite(task.s_end):
            return None
        s = np.linspace(task.s0, task.s_end, _SAMPLES)
        theta, length = task.theta(s) + np.zeros_like(s), np.linalg.norm(task.dq_d(s), axis=-1)
        with np.errstate(over="ignore"):  # a plan may take for ever
            speed = np.trapezoid(length, s) / np.trapezoid(1 / theta, s)
        braking = max(END_TIME * float(theta[-1]), _SHORTEST)
        return cls(task.s_end, braking, task.s_end - max(braking, END_TIME * float(speed / length[-1])))

    def brake(self, point: PathPoint, s: Array) -> PathPoint:
        """Return ``point``, the task at s, with ϑ and ϑ' of the plan that comes to rest."""
        left = (self.s_end - s) / self.braking
        share, slope = np.minimum(np.maximum(left, 0.0), 1.0), np.where(left < 1.0, -1.0 / self.braking, 0.0)
        return point._replace(theta=point.theta * share, dtheta=point.dtheta * share + point.theta * slope)


def arrival_parameter(task: PathTask) -> float:
    """Return the s from which on the plan of an open path has arrived, with 0.1 mrad of the path left."""
    return task.s_end - _REMAINING / float(np.linalg.norm(task.dq_d(np.array(task.s_end))))
