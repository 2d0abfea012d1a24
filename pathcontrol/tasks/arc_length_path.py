"""A path with its arc length as parameter."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array
from pathcontrol.errors import TaskError
from pathcontrol.geometry.arc_length import ArcLength, apart, curvature_vector, last
from pathcontrol.tasks.base import PathPoint, PathTask
from pathcontrol.tasks.check import check_moves
from pathcontrol.tasks.derived import DerivedPath


class ArcLengthPath(DerivedPath):
    """A path with its arc length as parameter, ‖q_d'‖ = 1, from s = 0; made by :meth:`PathTask.by_arc_length`.

    With u the parameter of ``path`` and L(u) its arc length, q_d(s) = path.q_d(L⁻¹(s)). The joints move as before:
    ϑ(s) = ϑ(u)‖q_d'(u)‖ is the path speed [rad/s].

    Raises:
        TaskError: the path neither ends nor repeats, stands still somewhere, or turns back, as at a cusp.
    """

    def __init__(self, path: PathTask) -> None:
        super().__init__(path)
        if not np.isfinite(last(path)):
            raise TaskError(
                f"{type(path).__name__} neither ends nor repeats, expected a path of finite length; cut a stretch "
                "of it, as in task.between(0.0, 10.0).by_arc_length()"
            )
        self._length = ArcLength(path, path.s0, last(path))
        check_moves(path)
        self.s0 = 0.0
        if path.closed:
            self.period = self._length.total
        else:
            self.s_end = self._length.total

    def q_d(self, s: Array) -> Array:
        return self.path.q_d(self._parameter(s))

    def dq_d(self, s: Array) -> Array:
        return _unit(self.path.dq_d(self._parameter(s)))

    def ddq_d(self, s: Array) -> Array:
        u = self._parameter(s)
        return curvature_vector(self.path.dq_d(u), self.path.ddq_d(u))

    def theta(self, s: Array) -> Array:
        u = self._parameter(s)
        return self.path.theta(u) * np.linalg.norm(self.path.dq_d(u), axis=-1)

    def dtheta(self, s: Array) -> Array:
        return self.at(s).dtheta

    def at(self, s: Array) -> PathPoint:
        point = self.path.at(self._parameter(s))
        squared = (point.dq_d * point.dq_d).sum(-1)
        stretch = (point.dq_d * point.ddq_d).sum(-1) / squared
        return PathPoint(
            point.q_d,
            _unit(point.dq_d),
            curvature_vector(point.dq_d, point.ddq_d),
            point.theta * np.sqrt(squared),
            point.dtheta + point.theta * stretch,
        )

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        return self._length(self.path.sigma_bar(q, None if near is None else self._parameter(as_array("near", near))))

    @property
    def knots(self) -> Array | None:
        return self._lengths(self.path.knots)

    @property
    def profile_knots(self) -> Array | None:
        return self._lengths(self.path.profile_knots)

    def _lengths(self, knots: Array | None) -> Array | None:
        """Where on this path some ``knots`` (K,) of the path underneath are, and which of them are one place."""
        return None if knots is None else apart(self._length(knots)) if len(knots) else knots

    def _parameter(self, s: Array) -> Array:
        """The parameter u of the path underneath."""
        s = np.asarray(s, dtype=np.float64)
        return self._length.inverse(s if self.closed else np.clip(s, 0.0, self.s_end))


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
