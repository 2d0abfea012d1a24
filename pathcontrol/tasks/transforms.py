"""Paths reversed, shifted, scaled and cut out of others.

The derivatives are those of the path underneath by the chain rule, and ϑ is taken over as the rate of the parameter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, finite, readonly, scalar
from pathcontrol.errors import InputError
from pathcontrol.tasks.base import PathPoint, PathTask
from pathcontrol.tasks.derived import DerivedPath


class ReversedPath(DerivedPath):
    """The path taken backwards, q_d(s) = path.q_d(m − s) and ϑ(s) = path.ϑ(m − s).

    m = s0 + s_end for an open path; m = 2s0 for a closed one, which begins where it did.
    """

    def __init__(self, path: PathTask) -> None:
        super().__init__(path)
        if not path.closed and path.s_end == np.inf:
            raise InputError(
                f"{type(path).__name__} has no end to begin from; cut a stretch of it, as in "
                "task.between(0.0, 10.0).reversed()"
            )
        self._keep_domain()
        self._mirror = 2 * path.s0 if path.closed else path.s0 + path.s_end

    def q_d(self, s: Array) -> Array:
        return self.path.q_d(self._mirror - s)

    def dq_d(self, s: Array) -> Array:
        return -self.path.dq_d(self._mirror - s)

    def ddq_d(self, s: Array) -> Array:
        return self.path.ddq_d(self._mirror - s)

    def theta(self, s: Array) -> Array:
        return self.path.theta(self._mirror - s)

    def dtheta(self, s: Array) -> Array:
        return -self.path.dtheta(self._mirror - s)

    def at(self, s: Array) -> PathPoint:
        point = self.path.at(self._mirror - s)
        return point._replace(dq_d=-point.dq_d, dtheta=-point.dtheta)

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        if near is not None:
            return self._mirror - self.path.sigma_bar(q, self._mirror - as_array("near", near))
        s = self._mirror - self.path.sigma_bar(q)
        return s if self.period is None else self.s0 + np.mod(s - self.s0, self.period)

    @property
    def knots(self) -> Array | None:
        return self._mirrored(self.path.knots)

    @property
    def profile_knots(self) -> Array | None:
        return self._mirrored(self.path.profile_knots)

    def _mirrored(self, knots: Array | None) -> Array | None:
        return None if knots is None else self._mirror - knots[::-1] + (self.period or 0.0)


class _MovedPath(DerivedPath):
    """q_d(s) = a ∘ path.q_d(s) + b, joint by joint."""

    def __init__(self, path: PathTask, factor: Array, offset: Array) -> None:
        super().__init__(path)
        self._keep_domain()
        self._factor, self._offset = factor, offset

    def q_d(self, s: Array) -> Array:
        return self._factor * self.path.q_d(s) + self._offset

    def dq_d(self, s: Array) -> Array:
        return self._factor * self.path.dq_d(s)

    def ddq_d(self, s: Array) -> Array:
        return self._factor * self.path.ddq_d(s)

    def theta(self, s: Array) -> Array:
        return self.path.theta(s)

    def dtheta(self, s: Array) -> Array:
        return self.path.dtheta(s)

    def at(self, s: Array) -> PathPoint:
        q_d, dq_d, ddq_d, theta, dtheta = self.path.at(s)
        return PathPoint(self._factor * q_d + self._offset, self._factor * dq_d, self._factor * ddq_d, theta, dtheta)

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        if not np.ptp(np.abs(self._factor), axis=-1).any():  # similar figures have the same nearest point
            return self.path.sigma_bar((as_array("q", q) - self._offset) / self._factor, near)
        return super().sigma_bar(q, near)

    @property
    def knots(self) -> Array | None:
        return self.path.knots

    @property
    def profile_knots(self) -> Array | None:
        return self.path.profile_knots


class ShiftedPath(_MovedPath):
    """The path moved by an ``offset`` [rad], (n,)."""

    def __init__(self, path: PathTask, offset: ArrayLike) -> None:
        self.offset = readonly(finite("offset", as_array("offset", offset)))
        if self.offset.shape != (path.n,):
            raise InputError(
                f"offset has shape {self.offset.shape}, expected ({path.n},): the path has {path.n} joints"
            )
        super().__init__(path, np.ones(path.n), self.offset)


class ScaledPath(_MovedPath):
    """The path scaled by a ``factor``, for all joints or (n,), ``about`` a posture [rad], (n,).

    The parameter keeps its rate ϑ, so that the joints move faster by the factor.
    """

    def __init__(self, path: PathTask, factor: ArrayLike, about: ArrayLike | None = None) -> None:
        self.factor = readonly(finite("factor", as_array("factor", factor)))
        if self.factor.shape not in ((), (path.n,)) or not self.factor.all():
            raise InputError(f"factor = {self.factor.tolist()}, expected a number other than 0, or {path.n} of them")
        centre = path.q_d(np.asarray(path.s0)) if about is None else about
        self.about = readonly(finite("about", as_array("about", centre)))
        if self.about.shape != (path.n,):
            raise InputError(f"about has shape {self.about.shape}, expected ({path.n},): the path has {path.n} joints")
        factors = np.broadcast_to(self.factor, path.n)
        super().__init__(path, factors, (1 - factors) * self.about)


class PathSection(DerivedPath):
    """The stretch of a path between two of its parameters, as an open path with the same parameter.

    Of a closed path it may be any stretch, of several laps too.
    """

    def __init__(self, path: PathTask, s0: float, s_end: float) -> None:
        super().__init__(path)
        self.s0, self.s_end = scalar("s0", s0), scalar("s_end", s_end)
        slack = 1e-12 * (1 + abs(self.s0) + abs(self.s_end))
        inside = path.closed or (self.s0 >= path.s0 - slack and self.s_end <= path.s_end + slack)
        if not (self.s0 < self.s_end and inside):
            whole = "" if path.closed else f", both from {path.s0:g} to {path.s_end:g}"
            raise InputError(f"s0 = {self.s0:g} and s_end = {self.s_end:g}, expected s0 < s_end{whole}")

    def q_d(self, s: Array) -> Array:
        return self.path.q_d(s)

    def dq_d(self, s: Array) -> Array:
        return self.path.dq_d(s)

    def ddq_d(self, s: Array) -> Array:
        return self.path.ddq_d(s)

    def theta(self, s: Array) -> Array:
        return self.path.theta(s)

    def dtheta(self, s: Array) -> Array:
        return self.path.dtheta(s)

    def at(self, s: Array) -> PathPoint:
        return self.path.at(s)

    @property
    def knots(self) -> Array | None:
        return self._within(self.path.knots)

    @property
    def profile_knots(self) -> Array | None:
        return self._within(self.path.profile_knots)

    def _within(self, knots: Array | None) -> Array | None:
        """Knots of the path that lie in the stretch, those of a closed one in each lap, and its ends."""
        if knots is None:
            return None
        if self.path.period is not None:
            first, last = np.floor((np.array([self.s0, self.s_end]) - self.path.s0) / self.path.period)
            # a lap ends with the first knot of the next
            knots = (np.arange(first, last + 1)[:, None] * self.path.period + knots[:-1]).ravel()
        within = knots[(knots > self.s0) & (knots < self.s_end)]
        return np.unique(np.concatenate([[self.s0], within, [self.s_end]]))
