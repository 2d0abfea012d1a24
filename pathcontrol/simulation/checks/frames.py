"""The check that arms which differ have the frames of a disturbance at one place."""

from __future__ import annotations

import numpy as np

from pathcontrol.errors import InputError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.simulation.arm.disturbance import Disturbance, list_terms
from pathcontrol.simulation.arm.pick_up import PickUp
from pathcontrol.simulation.arm.wall import Wall


def check_frames(disturbance: Disturbance, arms: RobotBatch) -> None:
    """Check that the frames which walls and masses name move alike on all arms, as only the first one's are looked at.

    Raises:
        InputError: one is elsewhere on another arm.
        UnknownNameError: an arm does not have it.
    """
    posture = np.linspace(0.3, 1.1, arms.n)  # at which no difference of links is hidden by symmetry
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
