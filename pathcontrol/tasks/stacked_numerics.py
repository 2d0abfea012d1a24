"""Derivatives and nearest points of stacked tasks: every row is computed as its own task computes it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array
from pathcontrol.tasks.base import PathTask
from pathcontrol.tasks.closest_point import Curve
from pathcontrol.tasks.closest_point.curve import Interval
from pathcontrol.tasks.closest_point.downhill import newton
from pathcontrol.tasks.differentiation import NODES, interpolated


class StackedDerivative:
    """The derivatives of a function of stacked tasks, each row in the window of its own task.

    Args:
        tasks: the task of each row.
        name: the differentiator of a task.
        function: maps s (*batch, N) to values (*batch, N) or (*batch, N, n).
    """

    def __init__(self, tasks: Sequence[PathTask], name: str, function: Callable[[Array], Array]) -> None:
        self._tasks, self._name, self._function = tasks, name, function

    @cached_property
    def _windows(self) -> tuple[Array, Array, list[float]]:
        """First and last centre of the window of each row, (N,) each, and half its width."""
        each = [getattr(task, self._name) for task in self._tasks]
        ends = [(one.lower + one.width, one.upper - one.width) for one in each]
        return *np.array(ends).T, [one.width for one in each]

    def __call__(self, s: Array, order: int) -> Array:
        """Derivative of ``order`` 1 or 2 at s (*batch, N)."""
        s, (first, last, widths) = np.asarray(s, dtype=np.float64), self._windows
        centre, width = np.clip(s, first, last), np.array(widths)
        # the function wants the rows last
        places = np.moveaxis(centre[..., None] + width[:, None] * NODES, -1, 0)
        values = np.ascontiguousarray(np.moveaxis(self._function(places), 0, s.ndim))
        scale = np.array([each**order for each in widths])[:, None]  # NumPy's power may round otherwise
        return interpolated(values, (s - centre) / width, scale, order)


class StackedClosestPoint:
    """The nearest points of stacked tasks: the local search for all rows together, the global one row by row.

    Args:
        tasks: the task of each row.
        stacked: all of them.
    """

    def __init__(self, tasks: Sequence[PathTask], stacked: PathTask) -> None:
        self._tasks, self._curve = tasks, Curve(stacked.q_d, stacked.dq_d, stacked.ddq_d)

    @cached_property
    def _interval(self) -> Interval:
        lower, upper = np.array([task.one_traverse for task in self._tasks]).T
        return Interval(lower, upper, self._tasks[0].closed)

    def __call__(self, x: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Parameter (*batch, N) of the point nearest to x (*batch, N, n); see :meth:`PathTask.sigma_bar`."""
        x = as_array("x", x)
        if near is None:
            return np.stack([task._closest_point(x[..., i, :]) for i, task in enumerate(self._tasks)], axis=-1)
        start = np.broadcast_to(as_array("near", near), x.shape[:-1])
        s, found = newton(self._curve, self._interval, x, start)
        for i in np.flatnonzero(~found.reshape(-1, len(self._tasks)).all(0)).tolist():
            s[..., i] = self._tasks[i]._closest_point(x[..., i, :], start[..., i])
        return s
