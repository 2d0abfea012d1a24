"""The default tool frame of an arm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.body_visuals import leaf_links

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.tasks.task import PathTask

_MOVES = 1e-9  # m or rad of a frame or a joint; less is rounding
_SAMPLES = 64  # samples of the path


def default_tool(robot: RobotModel, task: PathTask | None = None) -> str:
    """Return the frame that the task was made for, or else the end of the robot's longest limb.

    An end is a link that carries no other. Of several the one counts that the most joints move, of those that the path
    moves if there is one, and the last of equals.
    """
    if task is not None and task.frame in robot.frame_names:
        return str(task.frame)
    leaves = leaf_links(robot.source)
    ends = [name for name in robot.frame_names if name in leaves]
    moved = _moved_joints(task) if task is not None and task.n == robot.n else np.ones(robot.n, dtype=bool)
    counts = [(_movers(robot, name) & moved).sum() for name in ends]
    return ends[len(ends) - 1 - int(np.argmax(counts[::-1]))]


def with_tool(robot: RobotModel, task: PathTask | None, tool: str | None) -> tuple[RobotModel, str]:
    """Return the robot and the frame that is shown: ``tool``, or the frame that follows the path.

    A tool that a path was made for need be no frame of the robot; then the robot that is returned has one more.
    """
    frame = default_tool(robot, task) if tool is None else tool
    if tool is not None or task is None or task.tool_pose is None or frame != task.frame:
        return robot, frame
    name = f"tool in {frame}"
    return robot if name in robot.frame_names else robot.with_frame(name, frame, task.tool_pose), name


def _moved_joints(task: PathTask) -> Array:
    """Return which joints the path moves, (n,); all where it stands still."""
    q = task.q_d(np.linspace(*task.sampled_interval, _SAMPLES))
    moved = np.ptp(q, axis=0) > _MOVES
    return moved if moved.any() else ~moved


def _movers(robot: RobotModel, frame: str) -> Array:
    """Return which joints move a frame, (n,)."""
    limits = robot.limits
    q = np.clip(0.5 + 0.1 * np.arange(robot.n), limits.lower, limits.upper)  # nothing lines up there
    return np.abs(robot.frame_jacobian(q, frame)).max(0) > _MOVES
