"""Which frame of an arm is its tool, unless somebody says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.view.bodies.visuals import leaf_links

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.tasks.base import PathTask


def default_tool(robot: RobotModel, task: PathTask | None = None) -> str:
    """The frame that follows the drawing, or else the last of the robot's frames that is a link carrying no other."""
    if isinstance(task, ToolpathTask) and task.frame in robot.frame_names:
        return task.frame
    leaves = leaf_links(robot.source)
    return [name for name in robot.frame_names if name in leaves][-1]
