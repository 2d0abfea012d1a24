"""Arms that differ from rollout to rollout, as the simulated arm of a batch."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, as_slice, in_common
from pathcontrol._expect import expect
from pathcontrol.errors import InputError
from pathcontrol.robot.actuation import Actuation, Limits
from pathcontrol.robot.friction import FrictionLaw, friction_of_each
from pathcontrol.robot.model import RobotModel

_FEW = 4  # rows of one rigid body, below which Pinocchio's batched call does not pay


class RobotBatch:
    """One arm for each of N rollouts, all with the same joints: masses, payloads, friction and limits may differ.

    Friction costs nothing more than for one arm, whatever differs. Rows with the same rigid body and the same rotor
    inertia go through one batched call together; for others the articulated-body algorithm is called row by row.
    Either way a row has the same result to the last bit as if it were alone.

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
            raise InputError("robots is an empty list, expected a RobotModel for each rollout")
        for i, robot in enumerate(self.robots):
            expect(f"robots[{i}]", robot, RobotModel)
        first = self.robots[0]
        for i, robot in enumerate(self.robots):
            if robot is not first and robot.joint_names != first.joint_names:
                raise InputError(f"plant[{i}] has the joints {robot.joint_names}, plant[0] {first.joint_names}")
        self.n, self.name, self.joint_names = first.n, first.name, first.joint_names
        self.position_units = first.position_units
        law = friction_of_each([robot.friction for robot in self.robots]) if friction is None else friction
        self.actuation = Actuation(_limits(self.robots), law, _encoder_counts(self.robots))
        self.bodies, self.body = _grouped(self.robots, _same_body)
        self._parts = self._divided(np.zeros(self.n))

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
        """The same arms with rotor inertia [kg m²], (n,) or (N, n), added to the diagonals of their M."""
        batch = object.__new__(RobotBatch)
        batch.__dict__ |= self.__dict__
        batch._parts = self._divided(armature)
        return batch

    def forward_dynamics(self, q: Array, qd: Array, tau: Array) -> Array:
        """q̈ [rad/s²], (N, n), of the arms at (q, q̇) under τ, each (N, n); :meth:`RobotModel.forward_dynamics`."""
        qdd = np.empty_like(tau)
        for robot, rows in self._parts.together:
            qdd[rows] = robot.forward_dynamics(q[rows], qd[rows], tau[rows])
        for robot, i, armature in self._parts.alone:
            qdd[i] = robot.forward_dynamics_row(q[i], qd[i], tau[i], armature)
        return qdd

    def mass_matrix(self, q: Array, rows: Array) -> Array:
        """M(q) [kg m²], (k, n, n), of the arms of some ``rows`` (k,), at q (k, n)."""
        M, parts = np.empty((len(q), self.n, self.n)), self._parts
        which = parts.part[rows]
        for part in np.unique(which):
            if part >= 0:
                found = which == part
                M[found] = parts.together[part][0].mass_matrix(q[found])
        for k in np.flatnonzero(which < 0):
            row = rows[k]
            M[k] = self.bodies[self.body[row]].mass_matrix_row(q[k], parts.armature[row])
        return M

    def _divided(self, added: Array) -> _Parts:
        """The rows by the calls that are made for them, with rotor inertia ``added`` to their own."""
        armature = np.stack([body.armature for body in self.bodies])[self.body] + added
        parts, order = _Parts(armature), np.argsort(self.body, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(self.body[order])) + 1):
            body = self.bodies[self.body[rows[0]]]
            if len(rows) >= _FEW and (armature[rows] == armature[rows[0]]).all():
                extra = np.broadcast_to(added, armature.shape)[rows[0]]
                parts.part[rows] = len(parts.together)
                parts.together.append((body.with_armature(extra) if extra.any() else body, as_slice(rows)))
            else:
                parts.alone.extend((body, int(i), armature[i]) for i in rows)
        return parts


class _Parts:
    """Rows with one rigid body and rotor inertia, and rows that have theirs alone."""

    def __init__(self, armature: Array) -> None:
        self.armature = armature  # (N, n)
        self.part = np.full(len(armature), -1)  # (N,), −1 for a row alone
        self.together: list[tuple[RobotModel, NDArray[np.intp] | slice]] = []
        self.alone: list[tuple[RobotModel, int, Array]] = []


def _grouped(
    robots: Sequence[RobotModel], same: Callable[[RobotModel, RobotModel], bool]
) -> tuple[list[RobotModel], NDArray[np.intp]]:
    """The robots that differ, and which of them each one is, (N,)."""
    found: list[RobotModel] = []
    by_identity: dict[int, int] = {}
    alike: dict[Hashable, list[int]] = defaultdict(list)
    which = np.empty(len(robots), dtype=np.intp)
    for i, robot in enumerate(robots):
        model = id(robot.pinocchio_model)
        if model not in by_identity:
            candidates = alike[(robot.source, json.dumps(robot.steps, sort_keys=True))]
            match = next((k for k in candidates if same(found[k], robot)), None)
            if match is None:
                match = len(found)
                found.append(robot)
                candidates.append(match)
            by_identity[model] = match
        which[i] = by_identity[model]
    return found, which


def _same_body(a: RobotModel, b: RobotModel) -> bool:
    return a.pinocchio_model == b.pinocchio_model


def _limits(robots: Sequence[RobotModel]) -> Limits:
    names = ("lower", "upper", "velocity", "effort")
    return Limits(*(in_common([getattr(robot.limits, name) for robot in robots]) for name in names))


def _encoder_counts(robots: Sequence[RobotModel]) -> Array | None:
    counts: list[Any] = [robot.actuation.encoder_counts for robot in robots]
    return None if any(count is None for count in counts) else in_common(counts)
