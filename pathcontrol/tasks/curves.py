"""Curves in joint space, taken at a constant path speed ‖q̇‖ unless given another profile."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol.arguments import Form, Posture, Speed, Unit
from pathcontrol.errors import InputError
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.profile import ConstantSpeed
from pathcontrol.tasks.task import PathTask

_HIGHEST = 1000  # frequency: from there on a path is not resolved by the samples that search and check it


class JointCurve(PathTask):
    """A curve given by closed forms of q_d, q_d' and q_d'', at the path speed ``speed`` = ‖q_d'‖ϑ [rad/s]."""

    def __init__(self, speed: float) -> None:
        self.speed = as_scalar("speed", speed, positive=True)
        self._profile = ConstantSpeed(self.speed)

    @abstractmethod
    def dq_d(self, s: Array) -> Array:
        """Return q_d'(s), (*batch, n)."""

    @abstractmethod
    def ddq_d(self, s: Array) -> Array:
        """Return q_d''(s), (*batch, n)."""

    def theta(self, s: Array) -> Array:
        return self._profile.theta(self, s)

    def dtheta(self, s: Array) -> Array:
        return self._profile.dtheta(self, s)

    def at(self, s: Array) -> PathPoint:
        dq_d, ddq_d = self.dq_d(s), self.ddq_d(s)
        theta, dtheta = self._profile.at(dq_d, ddq_d, self, s)
        return PathPoint(self.q_d(s), dq_d, ddq_d, theta, dtheta)


class Ellipse(JointCurve):
    """An ellipse drawn by two joints, the others holding still.

    q_d(s) = c + (a cos s) e_i ± (b sin s) e_j,  s ∈ [s0, ∞), period 2π.

    Args:
        semi_axes: (a, b) [rad] along the two joints.
        speed: path speed ‖q̇‖ [rad/s].
        center: posture c [rad], shape (n,); by default the origin of a 2-joint arm.
        joints: indices (i, j) of the two joints.
        clockwise: the sense of rotation in the plane of (q_i, q_j).
    """

    period = 2 * np.pi
    kept_by_arguments = True

    def __init__(
        self,
        semi_axes: Annotated[Sequence[float], Form.POSITIVES, Unit("rad")],
        speed: Speed,
        center: Posture = (0.0, 0.0),
        joints: Annotated[Sequence[int], Form.WHOLES] = (0, 1),
        clockwise: bool = False,
    ) -> None:
        super().__init__(speed)
        axes = check_finite("semi_axes", as_array("semi_axes", semi_axes))
        if axes.shape != (2,) or (axes <= 0).any():
            raise InputError(
                f"semi_axes = {semi_axes!r}, expected two lengths greater than 0", argument="semi_axes", value=semi_axes
            )
        self.semi_axes = freeze(axes)
        self.center = _posture("center", center)
        self.joints = _two_joints(joints, len(self.center))
        self.clockwise = bool(clockwise)
        self._a, self._b = axes[0], -axes[1] if clockwise else axes[1]

    def q_d(self, s: Array) -> Array:
        return self.center + self._outward(s)

    def dq_d(self, s: Array) -> Array:
        return self._in_plane(-self._a * np.sin(s), self._b * np.cos(s))

    def ddq_d(self, s: Array) -> Array:
        return -self._outward(s)

    def _outward(self, s: Array) -> Array:
        """Return the vector from the centre to the path, (*batch, n)."""
        return self._in_plane(self._a * np.cos(s), self._b * np.sin(s))

    def _in_plane(self, x: Array, y: Array) -> Array:
        """Return the vectors, (*batch, n), with components x and y (*batch,) along the two joints."""
        vector = np.zeros((*x.shape, self.center.shape[-1]))
        vector[..., self.joints[0]], vector[..., self.joints[1]] = x, y
        return vector


class Circle(Ellipse):
    """The paper's task, eqs. (9) and (10): a circle of radius r₀ [rad] at the path speed v₀ [rad/s].

    q_d(s) = c + r₀ (cos s e_i ± sin s e_j),  ϑ = v₀/r₀,  σ̄(q) = atan2(±(q_j − c_j), q_i − c_i).

    The projection is (30) with the two-argument arctangent, defined everywhere but at the centre.

    Args:
        radius: r₀ [rad].
        speed: v₀ [rad/s].
        center: posture c [rad], shape (n,); by default the origin of a 2-joint arm.
        joints: indices (i, j) of the joints that draw it.
        clockwise: the sense of rotation in the plane of (q_i, q_j).
    """

    def __init__(
        self,
        radius: Annotated[float, Form.POSITIVE, Unit("rad")],
        speed: Speed,
        center: Posture = (0.0, 0.0),
        joints: Annotated[Sequence[int], Form.WHOLES] = (0, 1),
        clockwise: bool = False,
    ) -> None:
        self.radius = as_scalar("radius", radius, positive=True)
        super().__init__((self.radius, self.radius), speed, center, joints, clockwise)
        self._rate = np.array(self.speed / self.radius)

    def theta(self, s: Array) -> Array:
        return np.zeros(np.shape(s)) + self._rate

    def dtheta(self, s: Array) -> Array:
        return np.zeros(np.shape(s))

    def at(self, s: Array) -> PathPoint:
        a, b, cos, sin = self._a, self._b, np.cos(s), np.sin(s)
        outward, dq_d = self._in_plane(a * cos, b * sin), self._in_plane(-a * sin, b * cos)
        return PathPoint(self.center + outward, dq_d, -outward, self.theta(s), self.dtheta(s))

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        i, j = self.joints
        x = as_array("q", q) - self.center
        angle = np.arctan2(-x[..., j] if self.clockwise else x[..., j], x[..., i])
        reference = self.s0 + np.pi if near is None else near
        return angle + self.period * np.round((reference - angle) / self.period)


class Lissajous(JointCurve):
    """A Lissajous curve, each joint at its own frequency: q_{d,i}(s) = c_i + a_i sin(f_i s + φ_i).

    With whole frequencies the path closes after 2π; frequencies (1, 2) draw a figure of eight.

    Args:
        amplitudes: a [rad], shape (n,).
        frequencies: f, whole numbers ≥ 0, shape (n,).
        speed: path speed ‖q̇‖ [rad/s].
        phases: φ [rad], shape (n,); default 0.
        center: c [rad], shape (n,); default 0.
    """

    kept_by_arguments = True

    def __init__(
        self,
        amplitudes: Posture,
        frequencies: Annotated[ArrayLike, Form.WHOLES],
        speed: Speed,
        phases: Posture = 0.0,
        center: Posture = 0.0,
    ) -> None:
        super().__init__(speed)
        given = {"amplitudes": amplitudes, "frequencies": frequencies, "phases": phases, "center": center}
        arrays = [_posture(name, value) for name, value in given.items()]
        try:
            arrays = [freeze(a) for a in np.broadcast_arrays(*arrays)]
        except ValueError as error:
            shapes = ", ".join(f"{name} {a.shape}" for name, a in zip(given, arrays, strict=True))
            raise InputError(
                f"one value per joint is needed of each; got {shapes}",
                value={name: array.shape for name, array in zip(given, arrays, strict=True)},
            ) from error
        self.amplitudes, self.frequencies, self.phases, self.center = arrays
        whole = self.frequencies == np.round(self.frequencies)
        if not whole.all() or (self.frequencies < 0).any() or not self.frequencies.any():
            raise InputError(
                f"frequencies = {self.frequencies.tolist()}, expected whole numbers ≥ 0, not all 0",
                argument="frequencies",
                value=frequencies,
            )
        if self.frequencies.max() > _HIGHEST:
            raise InputError(
                f"frequencies = {self.frequencies.tolist()}, expected whole numbers up to {_HIGHEST}: no samples are "
                "as dense as such a path; divide them by a common factor, or lower them",
                argument="frequencies",
                value=frequencies,
                limit=_HIGHEST,
            )
        self.period = 2 * np.pi / float(np.gcd.reduce(self.frequencies.astype(int)))
        slowest = np.linalg.norm(self.dq_d(np.linspace(0, self.period, 4097)), axis=-1).min()
        if slowest < 1e-6 * np.abs(self.amplitudes * self.frequencies).max():
            raise InputError(
                f"this Lissajous figure turns back on itself (‖q_d'‖ falls to {slowest:.1e}), so a constant speed is "
                f"impossible; change phases = {self.phases.tolist()}",
                argument="phases",
                value=phases,
            )

    def q_d(self, s: Array) -> Array:
        return self.center + self.amplitudes * np.sin(self._angle(s))

    def dq_d(self, s: Array) -> Array:
        return self.amplitudes * self.frequencies * np.cos(self._angle(s))

    def ddq_d(self, s: Array) -> Array:
        return -self.amplitudes * self.frequencies**2 * np.sin(self._angle(s))

    def at(self, s: Array) -> PathPoint:
        angle = self._angle(s)
        sin, dq_d = np.sin(angle), self.amplitudes * self.frequencies * np.cos(angle)
        ddq_d = -self.amplitudes * self.frequencies**2 * sin
        theta, dtheta = self._profile.at(dq_d, ddq_d, self, s)
        return PathPoint(self.center + self.amplitudes * sin, dq_d, ddq_d, theta, dtheta)

    def _angle(self, s: Array) -> Array:
        return self.frequencies * np.asarray(s)[..., None] + self.phases


class Line(JointCurve):
    """The straight line from ``start`` to ``end`` in joint space, with its arc length as parameter.

    q_d(s) = start + s u,  u = (end − start)/‖end − start‖,  s ∈ [0, ‖end − start‖],  ϑ = ``speed``.

    Args:
        start: first posture [rad], shape (n,).
        end: last posture [rad], shape (n,).
        speed: path speed ‖q̇‖ [rad/s].
    """

    kept_by_arguments = True

    def __init__(self, start: Posture, end: Posture, speed: Speed) -> None:
        super().__init__(speed)
        self.start, self.end = _posture("start", start), _posture("end", end)
        if self.start.shape != self.end.shape:
            raise InputError(
                f"start has shape {self.start.shape} and end {self.end.shape}, expected the same (n,)",
                argument="end",
                value=end,
            )
        self.s_end = float(np.linalg.norm(self.end - self.start))
        if self.s_end == 0:
            raise InputError(
                f"start and end are the same posture {self.start.tolist()}; a line needs a length",
                argument="end",
                value=end,
            )
        self._direction = (self.end - self.start) / self.s_end

    def q_d(self, s: Array) -> Array:
        return self.start + np.asarray(s)[..., None] * self._direction

    def dq_d(self, s: Array) -> Array:
        return np.zeros_like(s, dtype=np.float64)[..., None] + self._direction

    def ddq_d(self, s: Array) -> Array:
        return np.zeros_like(self.dq_d(s))

    def sigma_bar(self, q: ArrayLike, near: ArrayLike | None = None) -> Array:
        return np.clip(np.vecdot(as_array("q", q) - self.start, self._direction), 0.0, self.s_end)


def _posture(name: str, given: ArrayLike) -> Array:
    """Check that there is one finite value for each joint, (n,)."""
    posture = check_finite(name, np.atleast_1d(as_array(name, given)))
    if posture.ndim != 1:
        raise InputError(
            f"{name} has shape {posture.shape}, expected (n,): one value for each joint", argument=name, value=given
        )
    return freeze(posture)


def _two_joints(joints: Sequence[int], n: int) -> tuple[int, int]:
    try:
        i, j = (int(k) for k in joints)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"joints = {joints!r}, expected two joint indices such as (0, 1)", argument="joints", value=joints
        ) from error
    if i == j or not (0 <= i < n and 0 <= j < n):
        raise InputError(
            f"joints = ({i}, {j}), expected two different indices from 0 to {n - 1}: center has {n} joints",
            argument="joints",
            value=joints,
            limit=(0, n - 1),
        )
    return i, j
