"""Checks of the frames that disturbances name: that they move, and alike on arms that differ."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError, warn
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.simulation.arm.disturbance import Disturbance, FrameForce, list_terms
from pathcontrol.simulation.arm.pick_up import PickUp
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.loops import Arm


def check_frames(disturbance: Disturbance, arms: RobotBatch) -> None:
    """Check that the frames which walls and masses name move alike on all arms, as only the first one's are looked at.

    Raises:
        InputError: one is elsewhere on another arm.
        UnknownNameError: an arm does not have it.
    """
    posture = _general_posture(arms)
    for term in list_terms(disturbance):
        if not isinstance(term, Wall | PickUp):
            continue
        poses = [body.frame_pose(posture, term.frame) for body in arms.bodies]
        for number, pose in enumerate(poses):
            if not np.allclose(pose, poses[0], rtol=0, atol=1e-9):
                row = int((arms.body == number).argmax())
                raise InputError(
                    f"the frame {term.frame!r} of {type(term).__name__} is elsewhere on plant[{row}] than on plant[0], "
                    "expected arms of the same lengths; simulate arms of other lengths each for itself",
                    argument=f"plant[{row}]",
                    value=arms.robots[row],
                )


def warn_of_fixed_frames(disturbance: Disturbance | None, robot: Arm, first: int = 0) -> None:
    """Warn of walls, masses and forces on a frame that no joint moves.

    Of a larger batch only the part with the ``first`` rollout 0 is looked at.
    """
    arm = robot.robots[0] if isinstance(robot, RobotBatch) else robot
    for term in () if first else list_terms(disturbance):
        if isinstance(term, Wall | PickUp | FrameForce):
            jacobian = arm.frame_jacobian(_general_posture(arm), term.frame)
            if not (jacobian if isinstance(term, PickUp) else jacobian[:3]).any():  # a mass may be beside the origin
                warn(f"no joint moves the frame {term.frame!r}, so {type(term).__name__} does nothing; name the tool's")


def _general_posture(arm: Arm) -> Array:
    """Return a posture (n,) at which symmetry hides nothing."""
    return np.linspace(0.3, 1.1, arm.n)
