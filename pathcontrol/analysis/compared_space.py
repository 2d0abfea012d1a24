"""The space in which an arm is compared with its path: of a tool, or of the joints."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.tool import Tool
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask


class ComparedSpace(NamedTuple):
    """The space of a tool, or of the joints where there is none, with the unit of their positions."""

    tool: Tool | None
    joint_unit: str = "rad"

    @classmethod
    def of(cls, run: Run, path: PathTask, frame: str | None) -> ComparedSpace:
        """Return the space of a ``frame``, or else of the tool that a path was made for, or else of the joints.

        Raises:
            InputError: the run does not know its arm.
            UnknownNameError: the arm has no such frame.
        """
        if frame is not None:
            return cls(Tool(run.robot, frame))
        return cls(None if path.frame is None else Tool(run.robot, path.frame, path.tool_pose), run.unit("q"))

    def is_made_for(self, path: PathTask) -> bool:
        """Return whether the space is that of what a path was made for: its tool, or the joints."""
        if self.tool is None or path.frame is None:
            return self.tool is None and path.frame is None
        mine, its = (np.eye(4) if pose is None else pose for pose in (self.tool.pose, path.tool_pose))
        return self.tool.frame == path.frame and np.array_equal(mine, its)

    @property
    def unit(self) -> str:
        """The unit of positions."""
        return self.joint_unit if self.tool is None else "m"

    def move(self, q: Array, qd: Array) -> tuple[Array, Array, Array | None]:
        """Return positions and velocities (K, d), and of a tool its rotations (K, 3, 3), for q and q̇ (K, n)."""
        if self.tool is None:
            return q, qd, None
        there = self.tool.kinematics(q)
        return there.position, (there.jacobian[..., :3, :] @ qd[..., None])[..., 0], there.rotation
