"""The rods that stand for tools: frames that were added to an arm, of which no URDF has a shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pathcontrol.view.bodies.body_links import reach
from pathcontrol.view.bodies.body_visuals import LinkVisual
from pathcontrol.view.bodies.sticks import stick

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel

_THICKNESS = 0.006  # radius of a rod, of the reach of the arm …
_SLENDERNESS = 0.08  # … and at most of its own length


def tool_rods(robot: RobotModel) -> list[LinkVisual]:
    """Return a thin rod from the parent of each frame that :meth:`RobotModel.with_frame` added to its origin.

    A frame that stands still, as that of a workpiece, is no tool, and one at the origin of its parent has no rod.
    """
    rods = []
    for name, parent, position in _added_frames(robot):
        radius = min(_THICKNESS * reach(robot.source), _SLENDERNESS * float(np.linalg.norm(position)))
        rods += stick(parent, f"tool {name}", np.zeros(3), position, radius)
    return rods


def _added_frames(robot: RobotModel) -> list[tuple[str, str, np.ndarray]]:
    """Return name, parent and position in the parent [m] of each added frame that a joint moves."""
    added = [arguments for method, arguments in robot.steps if method == "with_frame"]
    moving = {frame.name for frame in robot.pinocchio_model.frames if frame.parentJoint != 0}
    positions = [np.array(frame["pose"], dtype=np.float64) for frame in added]
    return [
        (frame["name"], frame["parent"], at if at.shape == (3,) else at[:3, 3])
        for frame, at in zip(added, positions, strict=True)
        if frame["name"] in moving
    ]
