"""Paths and velocity profiles known by samples, as saved runs keep them of their task."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol.errors import InputError, TaskError
from pathcontrol.geometry.closest_point import ClosestPoint, Curve
from pathcontrol.geometry.hermite import hermite_polynomials, sample_adaptively
from pathcontrol.geometry.periodic import wrap
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.profile import ConstantRate, ConstantSpeed, Path, VelocityProfile
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

_CELLS = 256  # first cells of a path of one piece
_CONSTANT = 1e-13  # relative variation of a profile that counts as constant
_MARGIN = 0.1  # recorded beyond the used part of an endless path, as a share of it


class RecordedProfile(VelocityProfile):
    """A profile ϑ(s) by cubics between samples of ϑ and ϑ'; constant beyond them, or periodic.

    Args:
        s: increasing parameters, (m,); of a closed path from s0 to s0 + period.
        jets: ϑ and ϑ' there, (2, m).
        period: the period of a closed path, else ``None``.
    """

    def __init__(self, s: ArrayLike, jets: ArrayLike, period: float | None = None) -> None:
        self.s, self.jets = _check_samples(s, jets, 2)
        self.period = _check_period(self.s, period)
        self._rate = hermite_polynomials(self.s, self.jets[..., None])

    def theta(self, path: Path, s: Array) -> Array:
        return self._rate(self._wrap(s))[..., 0]

    def dtheta(self, path: Path, s: Array) -> Array:
        return self._rate(self._wrap(s), 1)[..., 0]

    def knots(self, path: Path) -> Array | None:
        return self.s

    def describe(self) -> dict[str, Any]:
        return {"profile": "RecordedProfile", "samples": len(self.s)}

    def _wrap(self, s: Array) -> Array:
        return _wrap(np.asarray(s, dtype=np.float64), self.s, self.period)


def recorded_profile(task: PathTask, upto: float | None = None) -> VelocityProfile:
    """Record ϑ(s) of a task: as a constant rate or path speed, or by samples within 1e-9 of its range.

    ``upto`` is the largest s that was used of an endless path.
    """

    def jet(s: Array) -> Array:
        return np.stack([task.theta(s) + 0.0 * s, task.dtheta(s) + 0.0 * s])[..., None]

    s = _first_cells(task, upto, _CELLS)
    probes = np.concatenate([s, 0.63 * s[:-1] + 0.37 * s[1:]])
    theta = task.theta(probes) + 0.0 * probes
    speed = theta * np.linalg.norm(task.dq_d(probes), axis=-1)
    if np.ptp(theta) <= _CONSTANT * theta.max():
        return ConstantRate(float(theta[0]))
    if np.ptp(speed) <= _CONSTANT * speed.max():
        return ConstantSpeed(float(np.median(speed)))
    s, jets = sample_adaptively(jet, s)
    return RecordedProfile(s, jets[..., 0], task.period)


class RecordedPath(PathTask):
    """A path by quintics between samples of q_d, q_d' and q_d''; exact for splines of up to that degree.

    What :meth:`of` makes of a smooth path differs from it by 1e-11 of its extent, and its q_d' by 1e-9 of the largest;
    the projection is the nearest point on it, whatever formula the original has. An endless path is known as far as
    it was used.

    Args:
        samples: increasing parameters [rad or -], (m,), from s0 on; of a closed path up to s0 + period.
        jets: q_d, q_d' and q_d'' there [rad], (3, m, n).
        profile: ϑ(s).
        period: the period of a closed path.
        endless: whether the path goes on beyond the last sample, where nothing is known of it.
        projects: whether an endless path has a projection.
        knots: where the pieces of a path made of pieces meet, (K,).
        original: the name of the class it was.
        frame: the frame of the arm that it was made for.
        tool_pose: pose in that frame of what follows it, (4, 4).
        rotations: how many of its rotations the path prescribes; older files do not say.
        polyline: the points of the polyline that it stands for, (k, d); ``None`` for none, or where a file is older.

    Raises:
        InputError: wrong shapes, values that are not finite, parameters that do not increase.
    """

    def __init__(
        self,
        samples: ArrayLike,
        jets: ArrayLike,
        profile: VelocityProfile,
        *,
        period: float | None = None,
        endless: bool = False,
        projects: bool = True,
        knots: ArrayLike | None = None,
        original: str = "",
        frame: str | None = None,
        tool_pose: ArrayLike | None = None,
        rotations: int = 0,
        polyline: ArrayLike | None = None,
    ) -> None:
        self.samples, self.jets = _check_samples(samples, jets, 3)
        self.profile, self.endless, self.projects, self.original = profile, endless, projects, original
        self.s0, self._last = float(self.samples[0]), float(self.samples[-1])
        self.period = _check_period(self.samples, period)
        self.s_end = np.inf if endless or period is not None else self._last
        self.frame, self.tool_pose = _check_tool(frame, tool_pose)
        self.rotations = _check_rotations(rotations)
        self._knots = None if knots is None else _check_knots(knots)
        self._polyline = None if polyline is None else _check_polyline(polyline)

    @classmethod
    def of(cls, task: PathTask, profile: VelocityProfile | None = None, upto: float | None = None) -> RecordedPath:
        """Record a task by samples.

        Args:
            task: any path.
            profile: its ϑ(s); by default samples of it.
            upto: the largest s that was used of an endless path; it is recorded a tenth further, or up to s0 + 2π.
        """
        endless = task.period is None and not np.isfinite(task.s_end)
        return cls(
            *sample_path(task, upto),
            recorded_profile(task, upto) if profile is None else profile,
            period=task.period,
            endless=endless,
            projects=not endless or type(task).sigma_bar is not PathTask.sigma_bar,
            knots=task.knots,
            original=type(task).__name__,
            frame=task.frame,
            tool_pose=task.tool_pose,
            rotations=task.rotations,
            polyline=task.polyline,
        )

    @property
    def polyline(self) -> Array | None:
        return self._polyline

    @property
    def n(self) -> int:
        return self.jets.shape[-1]

    @property
    def knots(self) -> Array | None:
        return self._knots

    @property
    def profile_knots(self) -> Array | None:
        return self.profile.knots(self)

    def q_d(self, s: Array) -> Array:
        return self._curves[0](self._wrap(s))

    def dq_d(self, s: Array) -> Array:
        return self._curves[1](self._wrap(s))

    def ddq_d(self, s: Array) -> Array:
        return self._curves[2](self._wrap(s))

    def theta(self, s: Array) -> Array:
        return self.profile.theta(self, s)

    def dtheta(self, s: Array) -> Array:
        return self.profile.dtheta(self, s)

    def at(self, s: Array) -> PathPoint:
        q_d, dq_d, ddq_d = (curve(self._wrap(s)) for curve in self._curves)
        return PathPoint(q_d, dq_d, ddq_d, *self.profile.at(dq_d, ddq_d, self, s))

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        return self._recorded_point(q, near) if self.endless and self.projects else super().sigma_bar(q, near)

    def describe(self) -> dict[str, Any]:
        described = {"task": "RecordedPath", "original": self.original, "samples": len(self.samples)}
        return described | self.profile.describe()

    @cached_property
    def _curves(self) -> list[PPoly]:
        curve = hermite_polynomials(self.samples, self.jets)
        return [curve, curve.derivative(1), curve.derivative(2)]

    @cached_property
    def _recorded_point(self) -> ClosestPoint:
        return ClosestPoint(Curve(self.q_d, self.dq_d, self.ddq_d), self.s0, self._last, False, self.knots)

    def _wrap(self, s: Array) -> Array:
        s = np.asarray(s, dtype=np.float64)
        if self.endless and (s > self._last).any():
            raise TaskError(
                f"the endless {self.original or 'path'} is known up to s = {self._last:g}, a little further than its "
                f"run went, not at s = {s.max():g}; make the task anew to go on",
                value=s.max(),
                limit=self._last,
                s=float(s.max()),
            )
        return s if self.period is None else _wrap(s, self.samples, self.period)


def sample_path(task: PathTask, upto: float | None = None) -> tuple[Array, Array]:
    """Return the parameters, (m,), at which :meth:`RecordedPath.of` keeps a task, and its jets there, (3, m, n).

    Raises:
        InputError: they are not finite.
    """

    def jet(s: Array) -> Array:
        return np.stack([task.q_d(s), task.dq_d(s), task.ddq_d(s)])

    def compared(s: Array) -> Array:
        return np.stack([task.q_d(s), task.dq_d(s)])

    s, jets = sample_adaptively(jet, _first_cells(task, upto, _CELLS if task.knots is None else 1), compared)
    return _check_samples(s, jets, 3)


def _first_cells(task: PathTask, upto: float | None, cells: int) -> Array:
    """Return the ends of at least ``cells`` cells, each within one piece of the path."""
    lower, upper = task.sampled_interval
    if upto is not None and task.period is None and not np.isfinite(task.s_end):
        upper = max(upper, upto + _MARGIN * (upto - lower))
    knots, margin = np.empty(0) if task.knots is None else task.knots, 1e-12 * (upper - lower)
    inside = knots[(knots > lower + margin) & (knots < upper - margin)]
    pieces = np.unique(np.concatenate([[lower], inside, [upper]]))
    counts = np.ceil(np.diff(pieces) * cells / (upper - lower) - 1e-6).clip(1)
    return np.interp(np.arange(counts.sum() + 1), np.append(0, np.cumsum(counts)), pieces)


def _wrap(s: Array, knots: Array, period: float | None) -> Array:
    """Move ``s`` into the first lap of a closed path, or between the ends of an open one."""
    if period is None:
        return np.clip(s, knots[0], knots[-1])
    return wrap(s, knots[0], period)


def _check_period(s: Array, period: float | None) -> float | None:
    """Check that the samples of a closed path reach from s0 to s0 + period."""
    if period is None:
        return None
    if not np.isclose(s[-1] - s[0], as_scalar("period", period, positive=True), rtol=1e-6, atol=0):
        raise InputError(
            f"period = {period:g}, but the samples span {s[-1] - s[0]:g}, expected them over one period",
            argument="period",
            value=period,
        )
    return float(period)


def _check_knots(given: ArrayLike) -> Array:
    """Check that the knots are a finite array (K,)."""
    knots = check_finite("knots", as_array("knots", given))
    if knots.ndim != 1:
        raise InputError(f"knots have shape {knots.shape}, expected (K,)", argument="knots", value=given)
    return freeze(knots)


def _check_rotations(rotations: int) -> int:
    """Check that 0, 2 or 3 rotations of the tool are prescribed."""
    if rotations not in (0, 2, 3):
        raise InputError(f"rotations = {rotations!r}, expected 3, 2 or 0", argument="rotations", value=rotations)
    return rotations


def _check_polyline(polyline: ArrayLike) -> Array:
    """Check the points of a polyline; return them read-only."""
    points = freeze(check_finite("polyline", as_array("polyline", polyline)))
    if points.ndim != 2:
        raise InputError(f"polyline has shape {points.shape}, expected (k, d)", argument="polyline", value=polyline)
    return points


def _check_tool(frame: str | None, tool_pose: ArrayLike | None) -> tuple[str | None, Array | None]:
    """Check the frame of the tool and its pose."""
    if not isinstance(frame, str | None):
        raise InputError(f"frame = {frame!r}, expected the name of a frame, or None", argument="frame", value=frame)
    if tool_pose is None:
        return frame, None
    pose = check_finite("tool_pose", as_array("tool_pose", tool_pose))
    if pose.shape != (4, 4):
        raise InputError(f"tool_pose has shape {pose.shape}, expected (4, 4)", argument="tool_pose", value=tool_pose)
    return frame, freeze(pose)


def _check_samples(s: ArrayLike, jets: ArrayLike, order: int) -> tuple[Array, Array]:
    """Check that parameters increase and that jets have their shape."""
    knots, values = check_finite("s", as_array("s", s)), check_finite("jets", as_array("jets", jets))
    if knots.ndim != 1 or len(knots) < 2 or not (np.diff(knots) > 0).all():
        raise InputError(
            f"s has shape {knots.shape}, expected two or more increasing parameters", argument="s", value=s
        )
    if values.ndim != order or values.shape[:2] != (order, len(knots)):
        raise InputError(
            f"jets have shape {values.shape}, expected ({order}, {len(knots)}{', n' * (order == 3)})",
            argument="jets",
            value=jets,
        )
    return freeze(knots), freeze(values)
