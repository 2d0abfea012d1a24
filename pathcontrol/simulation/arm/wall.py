"""Walls that a point of the arm may touch."""

from __future__ import annotations

from copy import copy
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array, freeze
from pathcontrol._expect import expect
from pathcontrol.arguments import Direction, Form, Point, Unit
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.contact import Meeting
from pathcontrol.simulation.arm.disturbance import Begin, Span, TimedDisturbance, check_rollouts, check_vectors

_RELAXATION = 1e-3  # s, damping over stiffness by default


class Wall(TimedDisturbance):
    """A half-space that the origin of a frame cannot enter: it pushes along its normal, never pulls, and grips.

    A compliant wall is a spring and a damper, f = k·depth − c·(speed along the normal) while that is positive. A rigid
    one is not entered at all, and an impact on it is inelastic. The force acts on the frame's origin; along the wall
    Coulomb friction of the coefficient ``friction`` holds against slip, and the point sticks while that suffices. The
    wall is there in the steps of the plant whose middle the time covers. No step is too long for a stiff wall: what the
    step does not resolve is inelastic. Continuous time does not know it.

    Args:
        frame: name of the frame whose origin is kept out, such as the tool's.
        point: a point of the wall in the base frame [m], (3,), or for each rollout, (N, 3).
        normal: direction out of the wall, towards the arm, of any length but 0, likewise.
        stiffness: k [N/m], or for each rollout, (N,); inf is a rigid wall.
        friction: coefficient μ, 0 or more, likewise.
        rigid: True instead of a stiffness.
        damping: c [N s/m], likewise; default 1 ms times the stiffness.
        start: when it comes [s], or for each rollout, (N,).
        duration: how long it is there [s], or for each rollout, (N,).

    Raises:
        InputError: a normal is 0, there is no stiffness and it is not rigid, or a number is out of range.
    """

    def __init__(
        self,
        frame: str,
        point: Point,
        normal: Direction,
        stiffness: Annotated[ArrayLike, Form.POSITIVE_OR_INF, Unit("N/m")] | None = None,
        friction: Annotated[ArrayLike, Form.NUMBER] = 0.0,
        rigid: bool = False,
        damping: Annotated[ArrayLike, Form.NUMBER, Unit("N s/m")] | None = None,
        start: Begin = 0.0,
        duration: Span = np.inf,
    ) -> None:
        super().__init__(start, duration)
        if not isinstance(frame, str):
            raise InputError(
                f"frame = {frame!r}, expected the name of a frame, such as 'tool'", argument="frame", value=frame
            )
        expect("rigid", rigid, bool, np.bool_, also=" for all rollouts; a stiffness of inf is rigid for one")
        self.frame, self.rigid = frame, bool(rigid)
        self._robot: RobotModel | None = None
        self.point, self.normal = check_vectors("point", point), check_vectors("normal", normal)
        largest = np.abs(self.normal).max(-1, keepdims=True)  # whose square may be no number
        if (largest == 0).any():
            raise InputError(
                "normal = [0, 0, 0], expected the direction out of the wall, of any other length",
                argument="normal",
                value=normal,
            )
        if stiffness is None and not rigid:
            raise InputError(
                "a wall has nothing to push with, expected a stiffness: give stiffness=1e5 [N/m] or rigid=True",
                argument="stiffness",
            )
        if stiffness is not None and rigid:
            raise InputError(
                f"stiffness = {stiffness!r} and rigid = True, expected a stiffness [N/m] or rigid=True",
                argument="stiffness",
                value=stiffness,
            )
        self.stiffness = None if stiffness is None else _check_each("stiffness", stiffness, np.inf)
        self.friction = _check_each("friction", friction)
        self.damping = None if damping is None else _check_each("damping", damping)
        if self.stiffness is not None and (self.stiffness == 0).any():
            raise InputError(
                f"stiffness = {self.stiffness.tolist()}, expected numbers greater than 0 [N/m]",
                argument="stiffness",
                value=stiffness,
                limit=0.0,
            )
        numbers = {"stiffness": self.stiffness, "friction": self.friction, "damping": self.damping}
        counts = {name: value.shape for name, value in numbers.items() if value is not None}
        check_rollouts(
            start=self.start.shape,
            duration=self.duration.shape,
            point=self.point.shape[:-1],
            normal=self.normal.shape[:-1],
            **counts,
        )
        direction = self.normal / largest
        self._axes = _axes_of(direction / np.linalg.norm(direction, axis=-1, keepdims=True))

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        """Return zeros: what a wall pushes with is not known before."""
        stiffness, damping = self.springs
        parts = (self.start, self.duration, stiffness, damping, self.friction)
        rows = np.broadcast_shapes(*map(np.shape, parts), self.point.shape[:-1], self.normal.shape[:-1])
        return np.zeros((*rows, q.shape[-1]))

    @property
    def springs(self) -> tuple[Array, Array]:
        """Stiffness k [N/m], inf where it is rigid, and damping c [N s/m], (), or (N,)."""
        if self.stiffness is None:
            return np.array(np.inf), np.array(0.0)
        own = np.where(np.isfinite(self.stiffness), _RELAXATION * self.stiffness, 0.0)
        return self.stiffness, own if self.damping is None else self.damping

    @property
    def axes(self) -> Array:
        """The unit normal and two directions along the wall, (3, 3), or for each rollout, (N, 3, 3), row by row."""
        return self._axes

    @property
    def robot(self) -> RobotModel:
        """The arm whose frame it is.

        Raises:
            InputError: it has not been looked for in an arm.
        """
        if self._robot is None:
            raise InputError(
                f"the arm of frame {self.frame!r} is not known: use Wall(...).find_names(robot), as simulate does",
                value=self.frame,
            )
        return self._robot

    def find_names(self, robot: RobotModel) -> Wall:
        """Return the wall for a frame of an arm.

        Raises:
            UnknownNameError: the arm has no such frame.
        """
        robot.frame_pose(np.zeros(robot.n), self.frame)  # raises where there is no such frame
        found = copy(self)
        found._robot = robot
        return found

    def stands(self, t: float, rollouts: int) -> NDArray[np.bool_]:
        """Return for which rollouts it is there at t [s], (N,)."""
        return np.broadcast_to(np.ravel(self.share(t) > 0), rollouts)

    def gap(self, q: Array) -> Array:
        """Return the distance of the frame's origin from the wall [m], below 0 beyond it, (N,), for q (N, n)."""
        origin = self.robot.frame_pose(q, self.frame)[..., :3, 3]
        return np.asarray(((origin - self.point) * self._axes[..., 0, :]).sum(-1))

    def jacobian(self, q: Array) -> Array:
        """Return the rows of the origin's Jacobian along normal and wall [m/rad], (N, 3, n)."""
        return np.asarray(self._axes @ self.robot.frame_jacobian(q, self.frame)[..., :3, :])

    def meet(self, gap: Array, jacobian: Array, row: int) -> Meeting:
        """Return a rollout before the wall; ``gap`` (N,) and ``jacobian`` (N, 3, n) are those of all."""
        k, c, friction = (float(np.ravel(part)[row % np.size(part)]) for part in (*self.springs, self.friction))
        return Meeting(float(gap[row]), jacobian[row], k, c, friction)


def _check_each(name: str, value: ArrayLike, most: float = np.finfo(np.float64).max) -> Array:
    """Check a number from 0 to ``most``, or one for each rollout, (N,); return it read-only."""
    array = freeze(as_array(name, value))
    if array.ndim > 1 or not ((array >= 0) & (array <= most)).all():
        raise InputError(
            f"{name} = {array.tolist()}, expected a number not below 0, or one for each rollout, (N,)",
            argument=name,
            value=value,
            limit=(0.0, most),
        )
    return array


def _axes_of(normal: Array) -> Array:
    """Return unit normals (…, 3) and two directions that are normal to each and to one another, (…, 3, 3)."""
    least = np.eye(3)[np.abs(normal).argmin(-1)]
    first = np.cross(normal, least)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return freeze(np.stack([normal, first, np.cross(normal, first)], axis=-2))
