"""A mass that the arm picks up, and may put down again."""

from __future__ import annotations

from copy import copy
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array, check_physical, freeze
from pathcontrol.arguments import Form, Point, Unit
from pathcontrol.errors import InputError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Begin, Span, TimedDisturbance, check_rollouts, check_vectors


class PickUp(TimedDisturbance):
    """A point mass that belongs to the arm from a time on, and of which the law does not know.

    Momentum is conserved when it is picked up: with J the Jacobian of the point and v the velocity of the mass before,
    M₊(q̇₊ − q̇) = m Jᵀ(v − Jq̇), which is M₊q̇₊ = Mq̇ for a mass at rest. When it is put down, after ``duration``, the
    velocity of the arm stays. Both happen at a tick of the loop, that of the period whose middle is the first that the
    time covers; the sample at this tick is that before it. Continuous time does not know it.

    Args:
        mass: m [kg], or for each rollout, (N,).
        frame: name of the frame that it is fixed to, such as the tool's.
        time: when it is picked up [s], or for each rollout, (N,); before 0 it is carried from the start on.
        duration: how long it is carried [s], or for each rollout, (N,).
        offset: its place in the frame [m], (3,), or for each rollout, (N, 3).
        velocity: its velocity before it is picked up, in axes of the base [m/s], likewise.

    Raises:
        InputError: a mass is not above 0, or a number or a shape is not one.
    """

    def __init__(
        self,
        mass: Annotated[ArrayLike, Form.POSITIVE, Unit("kg")],
        frame: str,
        time: Begin,
        duration: Span = np.inf,
        offset: Point = (0.0, 0.0, 0.0),
        velocity: Annotated[ArrayLike, Form.NUMBERS, Unit("m/s")] = (0.0, 0.0, 0.0),
    ) -> None:
        super().__init__(time, duration, "time")
        self.time = self.start
        if not isinstance(frame, str):
            raise InputError(
                f"frame = {frame!r}, expected the name of a frame, such as 'tool'", argument="frame", value=frame
            )
        self.frame = frame
        self.mass = freeze(check_physical("mass", as_array("mass", mass)))
        if self.mass.ndim > 1 or not (self.mass > 0).all():
            raise InputError(
                f"mass = {self.mass.tolist()}, expected numbers above 0 [kg], one or (N,)",
                argument="mass",
                value=self.mass,
                limit=0.0,
            )
        self.offset, self.velocity = check_vectors("offset", offset), check_vectors("velocity", velocity)
        places = {"offset": self.offset.shape[:-1], "velocity": self.velocity.shape[:-1]}
        check_rollouts(time=self.start.shape, duration=self.duration.shape, mass=self.mass.shape, **places)
        self._robot: RobotModel | None = None
        self._carried: dict[tuple[RobotModel, int], RobotModel] = {}

    @property
    def _rows(self) -> tuple[int, ...]:
        """The number of rollouts that its arguments have, () where they have none."""
        parts = (self.start, self.duration, self.mass)
        return np.broadcast_shapes(*map(np.shape, parts), self.offset.shape[:-1], self.velocity.shape[:-1])

    def torque(self, t: float, q: Array, qd: Array) -> Array:
        """Return zeros: the mass is a part of the arm."""
        return np.zeros((*self._rows, q.shape[-1]))

    @property
    def arm_change_times(self) -> Array:
        return self.jumps

    def change_arm(self, t: float, arm: RobotModel | RobotBatch) -> RobotModel | RobotBatch:
        """Return the arm, or the arms of all rollouts, with the mass where it is carried at t [s]."""
        carried = self._carries(t)
        if not carried.any():
            return arm
        if not carried.ndim and not self._rows and isinstance(arm, RobotModel):
            return self._load(arm, 0)
        rows = len(arm) if isinstance(arm, RobotBatch) else self._rows[0]
        robots = arm.robots if isinstance(arm, RobotBatch) else [arm] * rows
        on = np.broadcast_to(carried, rows)
        return RobotBatch([self._load(one, i) if on[i] else one for i, one in enumerate(robots)], arm.friction)

    def strike(self, before: float, now: float, q: Array, qd: Array) -> Array:
        """Return the impulse m Jᵀ(v − Jq̇) [N m s] on the joints of rollouts that pick it up, (N, n)."""
        picked = np.broadcast_to(self._carries(now) & ~self._carries(before), len(q))
        impulse = np.zeros(q.shape)
        for row in np.flatnonzero(picked).tolist():
            J = self._jacobian(q[row], _row_of(self.offset, row))
            mass = float(np.ravel(self.mass)[row % self.mass.size])
            impulse[row] = mass * J.T @ (_row_of(self.velocity, row) - J @ qd[row])
        return impulse

    def find_names(self, robot: RobotModel) -> PickUp:
        """Return it for a frame of an arm.

        Raises:
            UnknownNameError: the arm has no such frame.
        """
        robot.frame_pose(np.zeros(robot.n), self.frame)  # raises where there is no such frame
        found = copy(self)
        found._robot, found._carried = robot, {}
        return found

    def describe(self) -> dict[str, Any]:
        """Return name and public parameters."""
        return {name: value for name, value in super().describe().items() if name != "start"}

    def _carries(self, t: float) -> NDArray[np.bool_]:
        """Return whether it is carried at t [s], (), or (N,)."""
        share = self.share(t)
        return np.asarray((share[..., 0] if share.ndim else share) > 0)

    def _load(self, robot: RobotModel, row: int) -> RobotModel:
        """Return the arm of a rollout with the mass; the same object for the same arm and mass."""
        number = row if self.mass.ndim or self.offset.ndim > 1 else 0
        if (robot, number) not in self._carried:
            mass = float(np.ravel(self.mass)[number % self.mass.size])
            self._carried[robot, number] = robot.with_payload(mass, self.frame, _row_of(self.offset, number))
        return self._carried[robot, number]

    def _jacobian(self, q: Array, offset: Array) -> Array:
        """Return the Jacobian of the mass, (3, n), at q (n,)."""
        if self._robot is None:
            raise InputError(
                f"the arm of frame {self.frame!r} is not known: use PickUp(...).find_names(robot), as simulate does",
                value=self.frame,
            )
        J, turn = self._robot.frame_jacobian(q, self.frame), self._robot.frame_pose(q, self.frame)[:3, :3]
        return np.asarray(J[:3] + np.cross(J[3:].T, turn @ offset).T)


def _row_of(vectors: Array, row: int) -> Array:
    """Return the vector of a rollout."""
    return vectors if vectors.ndim == 1 else vectors[row % len(vectors)]
