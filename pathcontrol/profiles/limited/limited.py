"""The fastest profile within limits on speed, curvature and acceleration of the joints and of tools."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_joint_array, as_scalar, as_whole
from pathcontrol._expect import expect
from pathcontrol.arguments import Form, Rate, Unit
from pathcontrol.errors import InputError
from pathcontrol.profiles.limited.grid import edges, excess, keep_below, quarters, refine
from pathcontrol.profiles.limited.known_motion import KnownMotion
from pathcontrol.profiles.limited.motion_limit import MotionLimit
from pathcontrol.profiles.limited.tangential import Tangential, all_steps
from pathcontrol.profiles.limited.two_pass import largest_sequence
from pathcontrol.profiles.motion import JointMotion, ToolMotion, growth
from pathcontrol.profiles.tabulated import MOST_POINTS, TabulatedProfile
from pathcontrol.profiles.topp.joint_limits import VelocityLimit, joint_values
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.profile import Path
from pathcontrol.tasks.task import PathTask

_START, _END = (
    2.5e-3,
    2.5e-4,
)  # s, of acceleration from rest before the start, and of deceleration after the end, of an open path
_MAX_EXCESS = 1.05  # of a chord over a ceiling that it resolves


def limited(
    path: Path,
    *limits: MotionLimit,
    velocity: ArrayLike | None = None,
    points: int = 1000,
    start_rate: Rate | None = None,
) -> TabulatedProfile:
    """Return the largest ϑ(s) that keeps every limit: on speed, on curvature and on acceleration.

    Speed and curvature cap ϑ at every s; a forward and a backward sweep lower it until |v̇| is within the tangential
    limits, with ϑ² linear in each cell of a table. All limits hold at the quarters of every cell, and between these to
    second order in their width; cells are halved where a cap or ‖p'‖ changes much, as in a rounded corner.

    With a tangential limit an open path begins with the speed that the limit builds up in 2.5 ms, and ends with the
    speed that it takes away in 0.25 ms: never 0, where the motion plan ṡ = ϑ(s) would stop. The controllers take this
    last bit of speed away exponentially and hold the arm at s_end, where ``simulate`` reports it as finished.

    Args:
        path: a path that ends or closes.
        limits: on the motion of the joints and of tools; see :class:`MotionLimit`.
        velocity: |q̇_i| ≤ ``velocity`` [rad/s] for each joint, (n,), as ``robot.limits.velocity``; ``inf`` for none.
        points: cells of the table, or more where they are halved.
        start_rate: largest ϑ at the start of an open path [1/s], if not what the tangential limits build up. Laws that
            see only where the arm is, as ``Projection``, need more where dry friction that they do not compensate holds
            it at first.

    Raises:
        InputError: a value is not positive, or nothing limits the speed somewhere.
        TaskError: the path neither ends nor closes, or leaves a tool standing whose tangential acceleration is limited.
    """
    expect("path", path, PathTask)
    for i, limit in enumerate(limits):
        expect(f"limits[{i}]", limit, MotionLimit)
    cells = edges(path, as_whole("points", points, 1, MOST_POINTS))
    demands = Demands(path, limits, velocity, start_rate)
    s = refine(demands.resolved, cells)
    ceiling, tangential = demands.at(quarters(s))
    squared = largest_sequence(keep_below(ceiling), *all_steps(tangential, len(s) - 1), closed=path.period is not None)
    if not np.isfinite(squared).all():
        raise InputError(
            f"nothing limits the speed at s = {s[np.argmax(squared)]:g}; give a MotionLimit with a speed",
            s=float(s[np.argmax(squared)]),
        )
    return TabulatedProfile(s, squared, path.period)


def limited_motion(
    robot: RobotModel,
    path: Path,
    frame: str | None = None,
    *,
    speed: Annotated[float, Form.POSITIVE, Unit("rad/s", tool="m/s")] | None = None,
    tangential: Annotated[float, Form.POSITIVE, Unit("rad/s^2", tool="m/s^2")] | None = None,
    normal: Annotated[float, Form.POSITIVE, Unit("rad/s^2", tool="m/s^2")] | None = None,
    chord_error: Annotated[float, Form.POSITIVE, Unit("rad", tool="m")] | None = None,
    control_period: Annotated[float, Form.POSITIVE, Unit("s")] = 2.5e-3,
    velocity: VelocityLimit = None,
    points: int = 1000,
    start_rate: Rate | None = None,
) -> TabulatedProfile:
    """Return the profile of :func:`limited` with a single :class:`MotionLimit`, given by its parts.

    Args:
        robot: the arm.
        path: a path that ends or closes.
        frame: name of the frame whose motion is limited; left out, the limits are on the joints.
        speed: largest speed [rad/s or m/s].
        tangential: largest acceleration along the path [rad/s² or m/s²].
        normal: largest acceleration across the path [rad/s² or m/s²].
        chord_error: largest distance of the path from its chord over one control period [rad or m].
        control_period: that period [s].
        velocity: largest velocity of each joint [rad/s], (n,), or ``True`` for the limits of the URDF.
        points: cells of the table.
        start_rate: largest ϑ at the start of an open path [1/s].
    """
    motion = JointMotion() if frame is None else ToolMotion(robot, frame)
    most = joint_values("velocity", velocity, robot.limits.velocity, robot)
    given = (speed, tangential, normal, chord_error)
    limits = [] if np.isfinite(most).any() and not any(given) else [MotionLimit(motion, *given, control_period)]
    return limited(path, *limits, velocity=most, points=points, start_rate=start_rate)


class Demands:
    """Ceilings of ϑ² and tangential limits along a path; see :func:`limited` for the arguments."""

    def __init__(
        self, path: Path, limits: Sequence[MotionLimit], velocity: ArrayLike | None, start_rate: float | None
    ) -> None:
        self.path, self.limits = path, limits
        self._motions = [KnownMotion(limit.motion, path) for limit in limits]
        self.velocity = _check_velocity(velocity, path.dq_d(np.asarray(path.s0)).shape[-1])
        self.first, self.last = np.inf, np.inf
        if path.period is None:
            first = self._rate_after(_START, path.s0)
            self.first = first if start_rate is None else as_scalar("start_rate", start_rate, positive=True)
            self.last = self._rate_after(_END, path.s_end)

    def at(self, s: Array) -> tuple[Array, list[Tangential]]:
        """Return the largest ϑ² [1/s²] for speeds, curvatures and ends, (cells, k), and the tangential limits."""
        dq = self.path.dq_d(s)
        rates = np.select([s == self.path.s0, s == self.path.s_end], [self.first, self.last], np.inf)
        with np.errstate(divide="ignore"):
            rates = np.minimum(rates, (self.velocity / np.abs(dq)).min(-1))
        ceilings, tangential = [rates**2], []
        for limit, motion in zip(self.limits, self._motions, strict=True):
            dp, ddp = motion.at(s)
            ceilings.append(limit.ceiling(dp, ddp))
            if limit.tangential is not None:
                length = np.linalg.norm(dp, axis=-1)
                tangential.append(Tangential(limit.motion, limit.tangential, s, length, growth(dp, ddp)))
        return np.minimum.reduce(ceilings), tangential

    def resolved(self, s: Array) -> NDArray[np.bool_]:
        """Return whether cells with the points s (cells, 5) are small enough for all limits, (cells,)."""
        ceiling, tangential = self.at(s)
        return np.logical_and.reduce([excess(ceiling) <= _MAX_EXCESS, *(limit.resolved for limit in tangential)])

    def _rate_after(self, time: float, s: float) -> float:
        """Return the ϑ [1/s] that is reached from rest at s in a ``time`` [s]; ``inf`` without tangential limits."""
        _, limits = self.at(np.full((1, 1), s))
        with np.errstate(divide="ignore"):
            return min((float(limit.largest * time / limit.length[0, 0]) for limit in limits), default=np.inf)


def _check_velocity(velocity: ArrayLike | None, n: int) -> Array:
    """Check the velocity limits of the joints, (n,); ``inf`` for none."""
    fastest = as_joint_array("velocity", np.full(n, np.inf) if velocity is None else velocity, n)
    if not (fastest > 0).all():
        raise InputError(
            f"velocity = {fastest.tolist()}, expected speeds greater than 0; inf for no limit",
            argument="velocity",
            value=velocity,
        )
    return fastest
