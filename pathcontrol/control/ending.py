"""The ends of the motion plan of an open path: braking, timing and arrival."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

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

    A plan that goes back, at a negative factor of its speed, comes to rest on s0 in the same way.

    The plan comes to rest at s_end exponentially, with the time constant T = 0.1 s: over the last s_end − s < Tϑ(s_end)
    its rate is ϑ(s)(s_end − s)/(Tϑ(s_end)). A profile that is slow at its end has little left to brake.

    A plan with feedback from the arm would wait for ever where dry friction holds the arm and ϑ tends to 0. So every
    plan is timed, σ̇ = ϑ(σ), once it has come to the last joint path that takes T at the average speed of the whole,
    or to the braking if that is longer. The arm is drawn to the end by its position gain and held there.

    Attributes:
        s_end: last path parameter, as all of these a number, or (N,) for a batch of tasks in which it differs; ∞ for a
            path that does not end.
        braking: Tϑ(s_end), the length of parameter over which ϑ is brought to 0.
        begin: path parameter from which on the plan is timed.
        s0: first path parameter.
        braking_back: Tϑ(s0), the same length for a plan that goes back.
        begin_back: path parameter below which a plan that goes back is timed.
    """

    s_end: float | Array
    braking: float | Array
    begin: float | Array
    s0: float | Array
    braking_back: float | Array
    begin_back: float | Array

    @classmethod
    def of(cls, task: PathTask) -> Self | None:
        """Return the ending of ``task``, ``None`` for a closed path."""
        if task.closed:
            return None
        if isinstance(task, TaskBatch):
            return cls(*map_tasks(task, cls.of).T)
        if not np.isfinite(task.s_end):
            back = max(END_TIME * float(np.asarray(task.theta(np.asarray(task.s0)))), _SHORTEST)
            return cls(np.inf, 1.0, np.inf, task.s0, back, task.s0 + back)
        s = np.linspace(task.s0, task.s_end, _SAMPLES)
        theta, length = task.theta(s) + np.zeros_like(s), np.linalg.norm(task.dq_d(s), axis=-1)
        with np.errstate(over="ignore", divide="ignore"):  # a plan may take for ever, and a path begin at rest
            speed = np.trapezoid(length, s) / np.trapezoid(1 / theta, s)
            braking = np.maximum(END_TIME * theta[[-1, 0]], _SHORTEST)
            stretch = np.maximum(braking, END_TIME * speed / length[[-1, 0]])
        return cls(
            task.s_end, float(braking[0]), task.s_end - stretch[0], task.s0, float(braking[1]), task.s0 + stretch[1]
        )

    def brake(self, point: PathPoint, s: Array, factor: Array | float = 1.0) -> PathPoint:
        """Return ``point``, the task at s, with ϑ and ϑ' of the plan that goes at a ``factor`` and comes to rest."""
        left, back = self._largest_factor_forward(s), self._largest_factor_back(s)
        share = _bound_factor(factor, left, back)
        slope = np.where(left < factor, -1.0 / self.braking, np.where(-back > factor, -1.0 / self.braking_back, 0.0))
        return point._replace(theta=point.theta * share, dtheta=point.dtheta * share + point.theta * slope)

    def share(self, s: Array, factor: Array | float = 1.0) -> Array:
        """Return the share of ϑ(s) at which a plan with a ``factor`` goes, as it comes to rest, (*batch,)."""
        return _bound_factor(factor, self._largest_factor_forward(s), self._largest_factor_back(s))

    def follows(self, s: Array, factor: Array) -> NDArray[np.bool_]:
        """Return where a plan goes at its ``factor``, and is not braked at an end, (*batch,)."""
        return (self._largest_factor_forward(s) >= factor) & (-self._largest_factor_back(s) <= factor)

    def timed(self, s: Array, factor: Array | float = 1.0) -> NDArray[np.bool_]:
        """Return where a plan with a ``factor`` is timed at the end that it goes to, (*batch,)."""
        return (s >= self.begin) | (s <= self.begin_back) & (np.asarray(factor) < 0)

    def _largest_factor_forward(self, s: Array) -> Array:
        """Return the largest factor at s with which the plan comes to rest on s_end, negative beyond it."""
        return np.asarray((self.s_end - s) / self.braking)

    def _largest_factor_back(self, s: Array) -> Array:
        """Return the largest factor at s with which the plan comes to rest on s0, negative before it."""
        return np.asarray((s - self.s0) / self.braking_back)


def _bound_factor(factor: Array | float, forward: Array, back: Array) -> Array:
    """Return the factor, or the largest one ``forward``, or ``back``, with which the plan comes to rest on an end."""
    return np.minimum(np.maximum(factor, -np.maximum(back, 0.0)), np.maximum(forward, 0.0))


def arrival_parameter(task: PathTask) -> float:
    """Return the s from which on the plan of an open path has arrived, with 0.1 mrad of the path left."""
    return task.s_end - _REMAINING / float(np.linalg.norm(task.dq_d(np.array(task.s_end))))
