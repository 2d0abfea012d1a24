"""The constraint on the tool at each point of the curve, and the deviation of a posture from it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.joint_range import spread_postures
from pathcontrol.cartesian.orientation import Orientation
from pathcontrol.cartesian.tool import Tool
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.tool_curve import ToolCurve

_SAMPLES = 64
_NO_RANK = 1e-6  # singular values below this share of the largest count as zero


class Target(NamedTuple):
    """The position p(s) [m], (N, 3), and the frame R_d(s), (N, 3, 3), that the tool has to have."""

    position: Array
    frames: Array

    def rows(self, chosen: Array) -> Target:
        """Return the ``chosen`` rows."""
        return Target(self.position[chosen], self.frames[chosen])


@dataclass(frozen=True, eq=False)
class ToolConstraint:
    """The constraint f(q, s) = 0: the tool is on the curve and has the prescribed orientation.

    f has m = 3 + ``orientation.rows`` rows: (x(q) − p(s))/ℓ, then the rotation that is left [rad].

    Attributes:
        tool: the tool of the arm.
        curve: the curve of its origin.
        orientation: how it is turned along the curve.
        tolerance: what counts as on the curve: [m] and [rad].
        length: ℓ [m], the lever arm of the joints in the root mean square over the workspace: it makes linear and
            angular motion comparable.
        rank: rank of ∂f/∂q almost everywhere, at most min(m, n).
        moving: which joints move the tool, (n,).
    """

    tool: Tool
    curve: ToolCurve
    orientation: Orientation
    tolerance: tuple[float, float]
    length: float = 1.0
    rank: int = 0
    moving: Array = field(default_factory=lambda: np.empty(0, dtype=bool))

    @classmethod
    def of(
        cls, tool: Tool, curve: ToolCurve, orientation: Orientation, tolerance: tuple[float, float]
    ) -> ToolConstraint:
        """Build the constraint; ℓ, rank and moving joints are found on postures all over the workspace.

        Raises:
            InputError: no joint moves the tool.
        """
        postures = spread_postures(tool.robot, _SAMPLES)
        jacobian = tool.kinematics(postures).jacobian
        unranked = cls(tool, curve, orientation, tolerance)
        moving = (np.abs(jacobian) > _NO_RANK * np.abs(jacobian).max()).any((0, 1)) & ~unranked.frozen
        if not moving.any():
            raise InputError(
                f"no joint of {tool.robot.name} moves the frame {tool.frame!r}; name one at its tool",
                argument="frame",
                value=tool.frame,
            )
        linear, angular = (np.sqrt((jacobian[:, rows] ** 2).mean()) for rows in (slice(3), slice(3, 6)))
        length = float(linear / angular) if linear > 0 and angular > 0 else 1.0
        unranked = replace(unranked, length=length)
        slopes = unranked._slope(jacobian, unranked.target(np.linspace(curve.s0, curve.s_end, _SAMPLES)))
        values = np.linalg.svd(slopes, compute_uv=False)
        rank = int((values > _NO_RANK * values.max()).sum(-1).max())
        return replace(unranked, rank=rank, moving=moving)

    @property
    def frozen(self) -> Array:
        """The mask of the joints without room between their limits, (n,); they count as locked."""
        return self.tool.robot.limits.lower >= self.tool.robot.limits.upper

    @cached_property
    def _some_frozen(self) -> bool:
        return bool(self.frozen.any())

    @property
    def freedom(self) -> int:
        """The number of independent motions that leave the tool at rest: n − rank."""
        return self.tool.robot.n - self.rank

    @property
    def bases(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """The shapes (m, r) and (r, n) of bases of the ranges of ∂f/∂q and of its transpose."""
        return (3 + self.orientation.rows, self.rank), (self.rank, self.tool.robot.n)

    def seeds(self, count: int) -> Array:
        """Return postures (count, n) spread over the joint range; joints that do not move the tool are near 0."""
        robot = self.tool.robot
        still = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
        return np.where(self.moving, spread_postures(robot, count), still)

    def at(self, q: Array, s: Array) -> tuple[Array, Array]:
        """Return f (N, m) and ∂f/∂q (N, m, n) at q (N, n), s (N,)."""
        return self.towards(q, self.target(s))

    def target(self, s: Array) -> Target:
        """Return where the tool has to be at s (N,), to evaluate the constraint there at several postures."""
        return Target(self.curve.position(s), self.orientation.frames(self.curve, s))

    def towards(self, q: Array, target: Target) -> tuple[Array, Array]:
        """Return f (N, m) and ∂f/∂q (N, m, n) at q (N, n) for a target of N rows."""
        position, rotation, jacobian = self.tool.kinematics(q)
        turn = self.orientation.turn(target.frames, rotation)
        f = np.concatenate([(position - target.position) / self.length, turn], axis=-1)
        return f, self._slope(jacobian, target)

    def slope(self, q: Array, target: Target) -> Array:
        """Return ∂f/∂q (N, m, n) alone."""
        return self._slope(self.tool.kinematics(q).jacobian, target)

    def _slope(self, jacobian: Array, target: Target) -> Array:
        turning = self.orientation.turning(target.frames, jacobian[:, 3:])
        rows = np.concatenate([jacobian[:, :3] / self.length, turning], axis=-2)
        return np.where(self.frozen, 0.0, rows) if self._some_frozen else rows

    def deviation(self, f: Array) -> tuple[Array, Array]:
        """Return the distance [m] and the angle [rad] of the deviations f (N, m), each (N,)."""
        return self.length * np.linalg.norm(f[:, :3], axis=-1), np.linalg.norm(f[:, 3:], axis=-1)

    def excess(self, f: Array) -> Array:
        """Return the deviation as a multiple of the tolerance, the larger of position and angle, (N,)."""
        position, angle = self.deviation(f)
        return np.maximum(position / self.tolerance[0], angle / self.tolerance[1])
