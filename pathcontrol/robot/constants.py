"""The constants of an arm's rigid-body dynamics as plain arrays, from its Pinocchio model.

Dynamics of the joints do not depend on the choice of body frames, so each body's frame is turned until the axis of its
joint is z: one kind of revolute and one kind of prismatic joint is left.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.robot.model import RobotModel


class ArmConstants(NamedTuple):
    """Rigid-body constants of a tree of n bodies; joint i carries body i, whose frame has the joint's axis as z.

    Attributes:
        parent: the body that carries each joint, −1 for the base, (n,).
        slides: 1 for prismatic joints, 0 for revolute ones, (n,).
        rotation: orientation of each body's frame in its parent's at q = 0, (n, 3, 3).
        origin: origin of each body's frame in its parent's at q = 0 [m], (n, 3).
        mass: [kg], (n,).
        moment: mass times centre of mass, in the body's frame [kg m], (n, 3).
        inertia: about the frame's origin [kg m²], xx xy xz yy yz zz, (n, 6).
        armature: rotor inertia [kg m²], (n,).
        gravity: acceleration of gravity in the base's axes [m/s²], (3,).
        turn: orientation of each body's frame in Pinocchio's frame of that joint, (n, 3, 3).
    """

    parent: NDArray[np.int32]
    slides: NDArray[np.int32]
    rotation: Array
    origin: Array
    mass: Array
    moment: Array
    inertia: Array
    armature: Array
    gravity: Array
    turn: Array


def arm_constants(robot: RobotModel) -> ArmConstants:
    """Return the constants of ``robot``; they give its dynamics and kinematics exactly."""
    model = robot.pinocchio_model
    axes, slides = _joint_axes(model)
    turn = np.stack([np.eye(3), *map(_frame_with_z, axes)])  # of the base first
    parents = [int(model.parents[k]) for k in range(1, model.njoints)]
    placements = [model.jointPlacements[k] for k in range(1, model.njoints)]
    bodies = [_turned_body(model.inertias[k], turn[k]) for k in range(1, model.njoints)]
    mass, moment, inertia = (np.array(part, dtype=np.float64) for part in zip(*bodies, strict=True))
    return ArmConstants(
        np.array(parents, dtype=np.int32) - 1,
        np.array(slides, dtype=np.int32),
        np.array([turn[p].T @ m.rotation @ own for p, m, own in zip(parents, placements, turn[1:], strict=True)]),
        np.array([turn[p].T @ m.translation for p, m in zip(parents, placements, strict=True)]),
        mass,
        moment,
        inertia,
        np.array(model.armature),
        np.array(model.gravity.linear),
        turn[1:],
    )


def frame_placement(robot: RobotModel, frame: str) -> tuple[int, Array]:
    """Return the index of the body that carries ``frame`` (−1: the base), and the frame's pose in it [m], (4, 4)."""
    found = robot.pinocchio_model.frames[robot.frame_id(frame)]
    body, pose = int(found.parentJoint) - 1, np.array(found.placement.homogeneous)
    if body >= 0:
        pose[:3] = arm_constants(robot).turn[body].T @ pose[:3]
    return body, pose


def frame_carrier(robot: RobotModel, frame: str) -> tuple[int, Array]:
    """Return the index of the body that carries ``frame`` (−1: the base), and the frame's origin in it [m], (3,)."""
    body, pose = frame_placement(robot, frame)
    return body, pose[:3, 3]


def _joint_axes(model: Any) -> tuple[list[Array], list[int]]:
    """Return the axis of each joint in its own frame, and 1 for each joint that slides, else 0."""
    axes, slides = [], []
    for joint in list(model.joints)[1:]:
        kind = joint.shortname()  # JointModelRX, JointModelPZ, JointModelRevoluteUnaligned, …
        slides.append(int(kind.startswith("JointModelP")))
        if kind[-1] in "XYZ":
            axes.append(np.eye(3)["XYZ".index(kind[-1])])
        else:
            axes.append(np.asarray(joint.extract().axis, dtype=np.float64).reshape(3))
    return axes, slides


def _frame_with_z(axis: Array) -> Array:
    """Return a rotation whose third column is the unit vector ``axis``; exact for coordinate axes."""
    z = axis if abs(axis @ axis - 1) <= 1e-15 else axis / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _turned_body(body: pin.Inertia, turn: Array) -> tuple[float, Array, Array]:
    """Return mass, moment and inertia about the origin of a body, in a frame turned by ``turn``."""
    centre, about_centre = turn.T @ body.lever, turn.T @ body.inertia @ turn
    about_origin = about_centre + body.mass * ((centre @ centre) * np.eye(3) - np.outer(centre, centre))
    return body.mass, body.mass * centre, about_origin[np.triu_indices(3)]
