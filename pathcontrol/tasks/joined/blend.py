"""A smooth bridge from one path to another."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.geometry.hermite import hermite_polynomials
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.task import PathTask

_SLOWEST = 1e-3  # of the speed at its ends


class Blend(PathTask):
    """The quintic with given q_d, q_d' and q_d'' at both ends; ln ϑ is the cubic with given ϑ and ϑ'.

    Args:
        before: the path before it, at s = 0.
        after: the path after it, at ``s_end``.
        s_end: its range of the parameter.

    Raises:
        InputError: the quintic comes to a standstill, because the paths run against each other.
    """

    def __init__(self, before: PathPoint, after: PathPoint, s_end: float) -> None:
        self.s_end = float(s_end)
        ends, both = np.array([0.0, self.s_end]), (before, after)
        path = hermite_polynomials(ends, np.stack([[p.q_d, p.dq_d, p.ddq_d] for p in both], axis=1))
        rate = hermite_polynomials(
            ends, np.stack([[np.log(p.theta), p.dtheta / p.theta] for p in both], axis=1)[..., None]
        )
        self._path, self._rate = [path, path.derivative(1), path.derivative(2)], [rate, rate.derivative(1)]
        speed = np.linalg.norm(self.dq_d(np.linspace(0.0, self.s_end, 65)), axis=-1)
        if speed.min() < _SLOWEST * speed[0]:
            raise InputError(
                "the path turns straight back there, so that a blend would stand still; run the two paths one after "
                "the other instead, or put a path between them"
            )

    def q_d(self, s: Array) -> Array:
        return self._path[0](s)

    def dq_d(self, s: Array) -> Array:
        return self._path[1](s)

    def ddq_d(self, s: Array) -> Array:
        return self._path[2](s)

    def theta(self, s: Array) -> Array:
        return np.exp(self._rate[0](s)[..., 0])

    def dtheta(self, s: Array) -> Array:
        return self.theta(s) * self._rate[1](s)[..., 0]
