"""The arms of a batch that are most sensitive to the length of a step of the plant."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import levels_vary, select_rollout, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.checks.fast_modes import steepest_fall
from pathcontrol.simulation.loops import Arm


def arm_of(robot: Arm, rollout: int) -> RobotModel:
    """Return the arm of a rollout, with the friction of that rollout."""
    if not isinstance(robot, RobotBatch):
        return robot
    return robot.robots[rollout].with_friction(select_rollout(robot.friction, rollout))


def find_extreme_arms(robot: Arm, q: Array) -> list[int]:
    """Return the rollouts whose arms have the extreme mobility or damping of a joint at q (1, n).

    The mobility is the acceleration for a unit torque. Also those in which dry friction that falls with speed
    accelerates a joint most; rollout 0 if all have one arm.
    """
    if not isinstance(robot, RobotBatch):
        return [0]
    mobility = _mobility(robot, q)
    viscous = np.broadcast_to(np.atleast_2d(viscous_of(robot.friction)), mobility.shape)
    felt = [mobility, viscous * mobility, -viscous]
    if levels_vary(robot.friction):
        felt.append(steepest_fall(robot.friction) * mobility)
    return np.unique([np.argmax(values, axis=0) for values in felt]).tolist()


def _mobility(robot: RobotBatch, q: Array) -> Array:
    """Return the diagonals of M⁻¹ of all arms at q, (N, n)."""
    of_body: dict[int, Array] = {}
    rows = []
    for arm in robot.robots:
        if id(arm) not in of_body:
            of_body[id(arm)] = np.diagonal(np.linalg.inv(arm.mass_matrix(q)[0]))
        rows.append(of_body[id(arm)])
    return np.array(rows)
