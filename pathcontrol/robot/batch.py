"""Arms that differ from rollout to rollout, as the simulated plant of a batch."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, merge_rows
from pathcontrol._expect import expect
from pathcontrol.errors import InputError
from pathcontrol.robot.actuation import Actuation, Limits
from pathcontrol.robot.friction import FrictionLaw, friction_of_each, levels_of, select_rollout, viscous_of
from pathcontrol.robot.model import RobotModel


class RobotBatch:
    """One arm for each of N rollouts, all with the same joints: masses, payloads, friction and limits may differ.

    Each rigid body that differs is asked once, for all rows that have it. A row has the same result to the last bit as
    if it were alone.

    Attributes:
        robots: the arms.
        bodies: the rigid bodies that differ among them.
        body: which of these each arm has, (N,).

    Args:
        robots: the arms, one for each rollout.
        friction: the friction of all of them, with coefficients (n,) or (N, n); default that of each.

    Raises:
        InputError: the arms have different joints.
    """

    def __init__(self, robots: Sequence[RobotModel], friction: FrictionLaw | None = None) -> None:
        self.robots = (robots,) if isinstance(robots, RobotModel) else tuple(robots)
        if not self.robots:
            raise InputError(
                "robots is an empty list, expected a RobotModel for each rollout", argument="robots", value=[]
            )
        for i, robot in enumerate(self.robots):
            expect(f"robots[{i}]", robot, RobotModel)
        first = self.robots[0]
        for i, robot in enumerate(self.robots):
            if robot is not first and robot.joint_names != first.joint_names:
                raise InputError(
                    f"plant[{i}] has the joints {robot.joint_names}, plant[0] {first.joint_names}",
                    argument=f"plant[{i}]",
                    value=robot,
                )
        self.n, self.name, self.joint_names = first.n, first.name, first.joint_names
        self.position_units = first.position_units
        law = friction_of_each([robot.friction for robot in self.robots]) if friction is None else friction
        self.actuation = Actuation(_limits(self.robots), law, _encoder_counts(self.robots))
        self.bodies, self.body = _distinct_bodies(self.robots)
        # the rows of each body
        self._rows = np.split(np.argsort(self.body, kind="stable"), np.cumsum(np.bincount(self.body))[:-1])

    def __len__(self) -> int:
        return len(self.robots)

    @property
    def friction(self) -> FrictionLaw:
        """The friction of all arms; coefficients that differ are (N, n)."""
        return self.actuation.friction

    @property
    def limits(self) -> Limits:
        """The limits of the joints; those that differ are (N, n)."""
        return self.actuation.limits

    def with_armature(self, armature: Array) -> RobotBatch:
        """Return the same arms with rotor inertia [kg m²], (n,) or (N, n), added to the diagonals of their M."""
        made: dict[tuple[int, bytes], RobotModel] = {}
        arms = []
        for body, added in zip(self.body.tolist(), np.broadcast_to(armature, (len(self), self.n)), strict=True):
            key = body, added.tobytes()
            if key not in made:
                made[key] = self.bodies[body].with_armature(added)
            arms.append(made[key])
        return RobotBatch(arms, self.friction)

    def forward_dynamics(self, q: Array, qd: Array, tau: Array) -> Array:
        """Return q̈ [rad/s²], (N, n), at (q, q̇) under τ, each (N, n); see :meth:`RobotModel.forward_dynamics`."""
        qdd = np.empty_like(tau)
        for body, rows in zip(self.bodies, self._rows, strict=True):
            qdd[rows] = body.forward_dynamics(q[rows], qd[rows], tau[rows])
        return qdd

    def mass_matrix(self, q: Array, rows: NDArray[np.intp]) -> Array:
        """Return M(q) [kg m²], (k, n, n), of the arms of the ``rows`` (k,), at q (k, n)."""
        each = [self.bodies[body].mass_matrix(one) for body, one in zip(self.body[rows].tolist(), q, strict=True)]
        return np.reshape(each, (len(rows), self.n, self.n))


def select_friction(robot: RobotModel, row: int) -> RobotModel:
    """Return an arm with the friction of one rollout, from one with a row of coefficients for each."""
    law = robot.friction
    if all(part.ndim < 2 for part in (viscous_of(law), *levels_of(law, np.zeros(robot.n)))):
        return robot
    return robot.with_friction(select_rollout(law, row))


def _distinct_bodies(robots: Sequence[RobotModel]) -> tuple[list[RobotModel], NDArray[np.intp]]:
    """Return the distinct rigid bodies, and the index of the one that each arm has, (N,)."""
    found: list[RobotModel] = []
    known: dict[int, int] = {}  # by the identity of a model
    by_origin: dict[Hashable, list[int]] = defaultdict(list)
    for robot in robots:
        model = robot.pinocchio_model
        if id(model) not in known:
            same = by_origin[robot.source, json.dumps(robot.steps, sort_keys=True)]
            which = next((k for k in same if found[k].pinocchio_model == model), len(found))
            if which == len(found):
                found.append(robot)
                same.append(which)
            known[id(model)] = which
    return found, np.array([known[id(robot.pinocchio_model)] for robot in robots])


def _limits(robots: Sequence[RobotModel]) -> Limits:
    """Return the limits of all arms, merged where they are the same."""
    names = ("lower", "upper", "velocity", "effort")
    return Limits(*(merge_rows([getattr(robot.limits, name) for robot in robots]) for name in names))


def _encoder_counts(robots: Sequence[RobotModel]) -> Array | None:
    """Return the encoder resolutions of all arms, ``None`` if an arm has no encoders."""
    counts: list[Any] = [robot.actuation.encoder_counts for robot in robots]
    return None if any(count is None for count in counts) else merge_rows(counts)
