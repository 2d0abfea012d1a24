"""The frame that follows the curve: a frame of the arm, or a tool that it carries."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, check_finite, freeze
from pathcontrol.engine.frame_kinematics import frame_kinematics
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel


class ToolKinematics(NamedTuple):
    """Position [m] (N, 3), rotation (N, 3, 3) and Jacobian (N, 6, n): linear, then angular, in the base's axes."""

    position: Array
    rotation: Array
    jacobian: Array


@dataclass(frozen=True, eq=False)
class Tool:
    """The tool of an arm: a frame and a pose in it.

    Args:
        robot: the arm.
        frame: name of the frame that carries the tool.
        offset: pose of the tool in that frame, (4, 4), or its tip [m], (3,); by default the frame itself.
    """

    robot: RobotModel
    frame: str
    offset: ArrayLike | None = None
    _offset: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_offset", freeze(_transform(self.offset)))
        self.robot.frame_pose(np.zeros(self.robot.n), self.frame)  # raises for an unknown frame

    @property
    def pose(self) -> Array | None:
        """Pose of the tool in its frame, (4, 4); None for the frame itself."""
        return None if self.offset is None else self._offset

    def kinematics(self, q: Array) -> ToolKinematics:
        """Return pose and Jacobian at q (N, n)."""
        pose, jacobian = frame_kinematics(self.robot, q, self.frame, self.pose)
        return ToolKinematics(pose[..., :3, 3], pose[..., :3, :3], jacobian)


def _transform(offset: ArrayLike | None) -> Array:
    """Return the transform of an offset, a position or a pose."""
    transform = np.eye(4)
    if offset is None:
        return transform
    given = check_finite("tool", as_array("tool", offset))
    if given.shape == (3,):
        transform[:3, 3] = given
        return transform
    turn = given[:3, :3] if given.shape == (4, 4) else np.zeros((3, 3))
    if not (np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0):
        raise InputError(
            f"tool has shape {given.shape}, expected its tip (3,), or a pose (4, 4) without scale or mirror",
            argument="tool",
            value=offset,
        )
    return given
