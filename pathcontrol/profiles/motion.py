"""The motions whose speed along a path can be prescribed: of the joints, or of a tool."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.profile import Path


class Motion(ABC):
    """The curve p(s) of a part of the arm while q = q_d(s); its speed is ‖p'(s)‖ϑ(s)."""

    @abstractmethod
    def of(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        """Return p' and p'', (*batch, m), given q_d, q_d' and q_d'' of the path, (*batch, n)."""

    def along(self, path: Path, s: Array) -> tuple[Array, Array]:
        """Return p'(s) and p''(s), (*batch, m), for s (*batch,)."""
        return self.of(path.q_d(s), path.dq_d(s), path.ddq_d(s))

    def stretch(self, path: Path, s: Array) -> tuple[Array, Array]:
        """Return ‖p'(s)‖ and d ln‖p'‖/ds, (*batch,): v = ‖p'‖ϑ and v̇ = ‖p'‖ (s̈ + ϑ² d ln‖p'‖/ds)."""
        dp, ddp = self.along(path, s)
        return np.linalg.norm(dp, axis=-1), growth(dp, ddp)


@dataclass(frozen=True)
class JointMotion(Motion):
    """The motion of the joints, p = q_d(s); its speed is the path speed ‖q̇‖ [rad/s]."""

    def __str__(self) -> str:
        return "the arm"

    def of(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        return dq, ddq


@dataclass(frozen=True)
class ToolMotion(Motion):
    """The motion of the origin of a frame in the base frame [m]: p' = J_v q_d' and p'' = J_v q_d'' + J̇_v q_d'.

    Args:
        robot: the arm.
        frame: the name of the frame.
    """

    robot: RobotModel
    frame: str

    def __post_init__(self) -> None:
        expect("robot", self.robot, RobotModel)
        self.robot.frame_pose(np.zeros(self.robot.n), self.frame)  # refuses a frame that does not exist

    def __str__(self) -> str:
        return f"the origin of {self.frame!r}"

    def of(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        velocity, acceleration = self.robot.frame_motion(q, dq, ddq, self.frame)
        return velocity[..., :3], acceleration[..., :3]


def growth(dp: Array, ddp: Array) -> Array:
    """Return d ln‖p'‖/ds = p'ᵀp''/‖p'‖², (*batch,); 0 where p' = 0."""
    return (dp * ddp).sum(-1) / np.maximum((dp * dp).sum(-1), np.finfo(float).tiny)
