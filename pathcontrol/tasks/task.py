"""The base class of tasks, and the paths derived from one: reversed, moved, cut, by arc length.

They stand in one module because each knows the others: what is made of a path can be made into another one again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol._expect import expect
from pathcontrol.errors import InputError, TaskError
from pathcontrol.geometry.arc_length import curvature_vector, drop_coincident
from pathcontrol.geometry.periodic import wrap
from pathcontrol.tasks.base import PathPoint, Task, refuse_batch
from pathcontrol.tasks.lengths import arc_length, curvature, last_parameter, length_along
from pathcontrol.tasks.profile import VelocityProfile
from pathcontrol.tasks.regularity import check_moves

_MOST_PIECES = 10_000_000  # of a stretch of several laps


class PathTask(Task):
    """A robotic task: *where* (a path q_d(s)) and *how fast along it* (a velocity profile ϑ(s)), never *when*.

    Subclasses define :meth:`q_d` and :meth:`theta`, on arrays: s has shape ``(*batch,)``, q_d(s) ``(*batch, n)``.
    What they leave out is computed: derivatives to about 1e-10, the projection as the global closest point. The curve

        Γ = { (q, q̇) : q = q_d(s), q̇ = q_d'(s) ϑ(s) }

    in state space (Moreno and Kelly, eqs. 2, 3 and 5) is what the task asks for.

    Attributes:
        s0: first path parameter.
        s_end: last path parameter; ``inf`` for a path that does not end.
        period: for a closed path, the period of q_d and ϑ in s; else ``None``.
        frame: name of the frame of the arm that the path was made for, such as its tool; ``None`` where none is said.
            What is made from the path keeps it, and films, figures and metrics show it.
        tool_pose: pose in that frame of what follows the path, (4, 4); ``None`` for the frame itself.
        rotations: how many rotations of that the path prescribes: 3, 2 where it may turn about its z axis, or 0.
    """

    def with_profile(self, profile: VelocityProfile) -> PathTask:
        """Return the same path with another velocity profile."""
        return Reprofiled(self, profile)

    def reversed(self) -> PathTask:
        """Return the path taken backwards, with ϑ of the mirrored parameter. A closed one begins where it did."""
        return ReversedPath(self)

    def shifted(self, offset: ArrayLike) -> PathTask:
        """Return the path moved by an ``offset`` [rad], (n,)."""
        return ShiftedPath(self, offset)

    def scaled(self, factor: ArrayLike, about: ArrayLike | None = None) -> PathTask:
        """Return the path scaled by a ``factor``, one for all joints or (n,), ``about`` a posture [rad], (n,).

        By default about q_d(s0). The parameter keeps its rate ϑ(s), so that the joints move faster by the factor.
        """
        return ScaledPath(self, factor, about)

    def between(self, s0: float, s_end: float) -> PathTask:
        """Return the stretch from ``s0`` to ``s_end``, of a closed path any laps, open with the same parameter."""
        return PathSection(self, s0, s_end)

    def by_arc_length(self) -> PathTask:
        """Return the same path, as fast as this one, with its arc length [rad] as parameter: ‖q_d'‖ = 1."""
        return ArcLengthPath(self)

    def arc_length(self, s0: ArrayLike | None = None, s_end: ArrayLike | None = None) -> Array:
        """Return the length [rad], (*batch,), from ``s0`` to ``s_end``, (*batch,); by default of the path, or a lap."""
        return arc_length(self, s0, s_end)

    def curvature(self, s: ArrayLike) -> Array:
        """Return the curvature κ = ‖q_d' ∧ q_d''‖/‖q_d'‖³ [1/rad], (*batch,), at s (*batch,)."""
        return curvature(self, s)


class Reprofiled(PathTask):
    """A path with another velocity profile than its own; made by :meth:`PathTask.with_profile`."""

    def __init__(self, path: PathTask, profile: VelocityProfile) -> None:
        expect("profile", profile, VelocityProfile)
        self.path, self.profile = path, profile
        self.s0, self.s_end, self.period = path.s0, path.s_end, path.period
        self.keep_tool(path)

    @property
    def by_hand(self) -> bool:
        return self.path.by_hand

    @property
    def polyline(self) -> Array | None:
        return self.path.polyline

    def q_d(self, s: Array) -> Array:
        return self.path.q_d(s)

    def dq_d(self, s: Array) -> Array:
        return self.path.dq_d(s)

    def ddq_d(self, s: Array) -> Array:
        return self.path.ddq_d(s)

    def theta(self, s: Array) -> Array:
        return self.profile.theta(self.path, s)

    def dtheta(self, s: Array) -> Array:
        return self.profile.dtheta(self.path, s)

    def at(self, s: Array) -> PathPoint:
        dq_d, ddq_d, zero = self.path.dq_d(s), self.path.ddq_d(s), np.zeros_like(s, dtype=np.float64)
        theta, dtheta = self.profile.at(dq_d, ddq_d, self.path, s)
        return PathPoint(self.path.q_d(s), dq_d, ddq_d, theta + zero, dtheta + zero)

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        return self.path.sigma_bar(q, near)

    @property
    def knots(self) -> Array | None:
        return self.path.knots

    @property
    def profile_knots(self) -> Array | None:
        return self.profile.knots(self.path)

    def describe(self) -> dict[str, Any]:
        return self.path.describe() | self.profile.describe()


class DerivedPath(PathTask):
    """A path made from ``path`` by a change of its parameter or of its values; a subclass defines :meth:`at`.

    It names the path underneath in the record of a run.
    """

    def __init__(self, path: PathTask) -> None:
        refuse_batch(f"the path of a {type(self).__name__}", path, "path")
        self.path = path
        self.keep_tool(path)

    @property
    def by_hand(self) -> bool:
        return self.path.by_hand

    def q_d(self, s: Array) -> Array:
        return self.at(s).q_d

    def dq_d(self, s: Array) -> Array:
        return self.at(s).dq_d

    def ddq_d(self, s: Array) -> Array:
        return self.at(s).ddq_d

    def theta(self, s: Array) -> Array:
        return self.at(s).theta

    def dtheta(self, s: Array) -> Array:
        return self.at(s).dtheta

    @property
    def knots(self) -> Array | None:
        return None if self.path.knots is None else self._map_knots(self.path.knots)

    @property
    def profile_knots(self) -> Array | None:
        return None if self.path.profile_knots is None else self._map_knots(self.path.profile_knots)

    def _map_knots(self, knots: Array) -> Array:
        """Return the knots (K,) of the path underneath in the parameter of this one."""
        return knots

    def _keep_domain(self) -> None:
        """Take over the domain of the path underneath."""
        self.s0 = self.path.s0
        if self.path.period is not None:
            self.period = self.path.period
        elif np.isfinite(self.path.s_end):
            self.s_end = self.path.s_end

    def __repr__(self) -> str:
        own = super().__repr__().partition("(")[2]
        return f"{type(self).__name__}({self.path!r}{', ' if own != ')' else ''}{own}"

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"path": self.path.describe()}


class ReversedPath(DerivedPath):
    """A path taken backwards, q_d(s) = path.q_d(m − s) and ϑ(s) = path.ϑ(m − s).

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

    def at(self, s: Array) -> PathPoint:
        point = self.path.at(self._mirror - s)
        return point._replace(dq_d=-point.dq_d, dtheta=-point.dtheta)

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        if near is not None:
            return self._mirror - self.path.sigma_bar(q, self._mirror - as_array("near", near))
        s = self._mirror - self.path.sigma_bar(q)
        return s if self.period is None else wrap(s, self.s0, self.period)

    def _map_knots(self, knots: Array) -> Array:
        return self._mirror - knots[::-1] + (self.period or 0.0)


class _SameParameter(DerivedPath):
    """A path with the parameter of the one underneath, and so with its ϑ."""

    def theta(self, s: Array) -> Array:
        return self.path.theta(s)

    def dtheta(self, s: Array) -> Array:
        return self.path.dtheta(s)


class _MovedPath(_SameParameter):
    """An affine image of a path, joint by joint: q_d(s) = a ∘ path.q_d(s) + b."""

    def __init__(self, path: PathTask, factor: Array, offset: Array) -> None:
        super().__init__(path)
        self._keep_domain()
        self._factor, self._offset = factor, offset

    def at(self, s: Array) -> PathPoint:
        q_d, dq_d, ddq_d, theta, dtheta = self.path.at(s)
        return PathPoint(self._factor * q_d + self._offset, self._factor * dq_d, self._factor * ddq_d, theta, dtheta)

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        if not np.ptp(np.abs(self._factor), axis=-1).any():  # similar figures have the same nearest point
            return self.path.sigma_bar((as_array("q", q) - self._offset) / self._factor, near)
        return super().sigma_bar(q, near)


class ShiftedPath(_MovedPath):
    """A path moved by an ``offset`` [rad], (n,)."""

    def __init__(self, path: PathTask, offset: ArrayLike) -> None:
        self.offset = freeze(check_finite("offset", as_array("offset", offset)))
        if self.offset.shape != (path.n,):
            raise InputError(
                f"offset has shape {self.offset.shape}, expected ({path.n},): the path has {path.n} joints",
                argument="offset",
                value=offset,
            )
        super().__init__(path, np.ones(path.n), self.offset)


class ScaledPath(_MovedPath):
    """A path scaled by a ``factor``, for all joints or (n,), ``about`` a posture [rad], (n,).

    The parameter keeps its rate ϑ, so that the joints move faster by the factor.
    """

    def __init__(self, path: PathTask, factor: ArrayLike, about: ArrayLike | None = None) -> None:
        self.factor = freeze(check_finite("factor", as_array("factor", factor)))
        if self.factor.shape not in ((), (path.n,)) or not self.factor.all():
            raise InputError(
                f"factor = {self.factor.tolist()}, expected a number other than 0, or {path.n} of them",
                argument="factor",
                value=factor,
            )
        centre = path.q_d(np.asarray(path.s0)) if about is None else about
        self.about = freeze(check_finite("about", as_array("about", centre)))
        if self.about.shape != (path.n,):
            raise InputError(
                f"about has shape {self.about.shape}, expected ({path.n},): the path has {path.n} joints",
                argument="about",
                value=about,
            )
        factors = np.broadcast_to(self.factor, path.n)
        super().__init__(path, factors, (1 - factors) * self.about)


class PathSection(_SameParameter):
    """The stretch of a path between two of its parameters, as an open path with the same parameter.

    Of a closed path it may be any stretch, of several laps too.
    """

    def __init__(self, path: PathTask, s0: float, s_end: float) -> None:
        super().__init__(path)
        self.s0, self.s_end = as_scalar("s0", s0), as_scalar("s_end", s_end)
        slack = 1e-12 * (1 + abs(self.s0) + abs(self.s_end))
        inside = path.closed or (self.s0 >= path.s0 - slack and self.s_end <= path.s_end + slack)
        if not (self.s0 < self.s_end and inside):
            whole = "" if path.closed else f", both from {path.s0:g} to {path.s_end:g}"
            raise InputError(
                f"s0 = {self.s0:g} and s_end = {self.s_end:g}, expected s0 < s_end{whole}",
                argument="s_end",
                value=self.s_end,
            )

    def at(self, s: Array) -> PathPoint:
        return self.path.at(s)

    def q_d(self, s: Array) -> Array:  # the nearest point is searched by q_d and its derivatives alone
        return self.path.q_d(s)

    def dq_d(self, s: Array) -> Array:
        return self.path.dq_d(s)

    def ddq_d(self, s: Array) -> Array:
        return self.path.ddq_d(s)

    def _map_knots(self, knots: Array) -> Array:
        """Return the knots of the path within the stretch, of a closed one those of each lap, and the ends."""
        if self.path.period is not None:
            first, last_one = np.floor((np.array([self.s0, self.s_end]) - self.path.s0) / self.path.period)
            self._check_count((last_one + 1 - first) * len(knots))
            # a lap ends with the first knot of the next
            knots = (np.arange(first, last_one + 1)[:, None] * self.path.period + knots[:-1]).ravel()
        within = knots[(knots > self.s0) & (knots < self.s_end)]
        return np.unique(np.concatenate([[self.s0], within, [self.s_end]]))

    def _check_count(self, pieces: float) -> None:
        """Check that the pieces of all laps can be listed."""
        if pieces > _MOST_PIECES:
            raise InputError(
                f"the stretch from s0 = {self.s0:g} to s_end = {self.s_end:g} of a path with the period "
                f"{self.path.period:g} has {pieces:.3g} pieces, expected at most {_MOST_PIECES}; take fewer laps, or "
                "simulate the closed path itself",
                argument="s_end",
                value=self.s_end,
            )


class ArcLengthPath(DerivedPath):
    """A path with its arc length as parameter, ‖q_d'‖ = 1, from s = 0; made by :meth:`PathTask.by_arc_length`.

    With u the parameter of ``path`` and L(u) its arc length, q_d(s) = path.q_d(L⁻¹(s)). The joints move as before:
    ϑ(s) = ϑ(u)‖q_d'(u)‖ is the path speed [rad/s].

    Raises:
        TaskError: the path neither ends nor repeats, stands still somewhere, or turns back, as at a cusp.
    """

    def __init__(self, path: PathTask) -> None:
        super().__init__(path)
        if not np.isfinite(last_parameter(path)):
            raise TaskError(
                f"{type(path).__name__} neither ends nor repeats, expected a path of finite length; cut a stretch "
                "of it, as in task.between(0.0, 10.0).by_arc_length()"
            )
        self._length = length_along(path, path.s0, last_parameter(path))
        check_moves(path)
        self.s0 = 0.0
        if path.closed:
            self.period = self._length.total
        else:
            self.s_end = self._length.total

    def at(self, s: Array) -> PathPoint:
        point = self.path.at(self._parameter(s))
        squared = (point.dq_d * point.dq_d).sum(-1)
        stretch = (point.dq_d * point.ddq_d).sum(-1) / squared
        return PathPoint(
            point.q_d,
            point.dq_d / np.linalg.norm(point.dq_d, axis=-1, keepdims=True),
            curvature_vector(point.dq_d, point.ddq_d),
            point.theta * np.sqrt(squared),
            point.dtheta + point.theta * stretch,
        )

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        return self._length(self.path.sigma_bar(q, None if near is None else self._parameter(as_array("near", near))))

    def _map_knots(self, knots: Array) -> Array:
        """Return the arc lengths of the knots, without those that coincide."""
        return drop_coincident(self._length(knots)) if len(knots) else knots

    def _parameter(self, s: Array) -> Array:
        """Return the parameter u of the path underneath."""
        s = np.asarray(s, dtype=np.float64)
        return self._length.inverse(s if self.closed else np.clip(s, 0.0, self.s_end))
