"""The poses and Jacobians of frames at many configurations by the engine; Pinocchio is asked where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import addressof
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array
from pathcontrol.engine.arm_constants import fill_arm
from pathcontrol.engine.library import load_library
from pathcontrol.engine.structs import MOST_JOINTS, Arm, address_of
from pathcontrol.errors import EngineError
from pathcontrol.robot.constants import arm_constants, frame_placement
from pathcontrol.robot.model import RobotModel

_FARTHEST_ANGLE = 1e6  # rad, as in src/lanes.hpp
_STATES = 8  # random configurations at which the engine is compared with Pinocchio
_CLOSE = 1e-11  # difference that counts as rounding, of the largest number


@dataclass
class _Frames:
    """The struct of an arm, and bodies and places of those frames that were asked for; no struct: Pinocchio is asked.

    A place is the orientation, row by row, and the origin of a frame in its body, (12,).
    """

    arm: Arm | None
    known: dict[str, tuple[Array, Array]] = field(default_factory=dict)

    def of(self, robot: RobotModel, frame: str) -> tuple[Array, Array]:
        """Return the body of a frame, (1,), and its place, (12,)."""
        found = self.known.get(frame)
        if found is None:
            body, pose = frame_placement(robot, frame)
            found = self.known[frame] = np.array([body], dtype=np.int32), _place(pose)
        return found


_READY: WeakKeyDictionary[RobotModel, _Frames] = WeakKeyDictionary()


def frame_poses(robot: RobotModel, q: ArrayLike, frames: Sequence[str]) -> Array:
    """Return what :meth:`RobotModel.frame_poses` does, (*batch, len(frames), 4, 4), up to rounding."""
    known, array = _frames_of(robot), as_joint_array("q", q, robot.n, robot.joint_names)
    if known.arm is None or not frames:
        return robot.frame_poses(array, frames)
    batch, rows = array.shape[:-1], _rows(array)
    poses = np.empty((len(rows), len(frames), 4, 4))
    if _evaluate(known.arm, *_several(known, robot, frames), rows, poses):
        far = _far(rows)
        poses[far] = robot.frame_poses(rows[far], frames)
    return poses.reshape(*batch, len(frames), 4, 4)


def frame_kinematics(robot: RobotModel, q: ArrayLike, frame: str, offset: Array | None = None) -> tuple[Array, Array]:
    """Return what :meth:`RobotModel.frame_kinematics` does, (*batch, 4, 4) and (*batch, 6, n), up to rounding.

    With an ``offset`` (4, 4) they are those of a frame that has this pose in ``frame``.
    """
    known, array = _frames_of(robot), as_joint_array("q", q, robot.n, robot.joint_names)
    if known.arm is None:
        return _by_pinocchio(robot, array, frame, offset)
    (body, place), batch, rows = known.of(robot, frame), array.shape[:-1], _rows(array)
    if offset is not None:
        turn = place[:9].reshape(3, 3)
        place = np.concatenate([(turn @ offset[:3, :3]).ravel(), turn @ offset[:3, 3] + place[9:]])
    poses, jacobians = np.empty((len(rows), 4, 4)), np.empty((len(rows), 6, robot.n))
    if _evaluate(known.arm, body, place, rows, poses, jacobians):
        far = _far(rows)
        poses[far], jacobians[far] = _by_pinocchio(robot, rows[far], frame, offset)
    return poses.reshape(*batch, 4, 4), jacobians.reshape(*batch, 6, robot.n)


def _by_pinocchio(robot: RobotModel, q: Array, frame: str, offset: Array | None) -> tuple[Array, Array]:
    """Return the pose and the Jacobian of a frame with an offset by Pinocchio."""
    pose, jacobian = robot.frame_kinematics(q, frame)
    if offset is not None:
        lever = pose[..., :3, :3] @ offset[:3, 3]
        pose = pose @ offset
        jacobian[..., :3, :] += np.cross(jacobian[..., 3:, :], lever[..., :, None], axis=-2)
    return pose, jacobian


def _frames_of(robot: RobotModel) -> _Frames:
    """Return the frames of an arm, whose struct is compared with Pinocchio once."""
    known = _READY.get(robot)
    if known is None:
        known = _READY[robot] = _Frames(_arm_of(robot))
    return known


def _arm_of(robot: RobotModel) -> Arm | None:
    """Return the struct of an arm; None where there is no engine, or where it does not agree with Pinocchio."""
    if robot.n > MOST_JOINTS:
        return None
    try:
        load_library()
    except EngineError:
        return None
    arm, frames = fill_arm(arm_constants(robot)), robot.joint_names
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (_STATES, robot.n))
    expected, found = robot.frame_poses(q, frames), np.empty((_STATES, len(frames), 4, 4))
    _evaluate(arm, *_several(_Frames(arm), robot, frames), q, found)
    return arm if np.abs(found - expected).max() <= _CLOSE * np.abs(expected).max() else None


def _several(known: _Frames, robot: RobotModel, frames: Sequence[str]) -> tuple[Array, Array]:
    """Return the bodies (F,) and places (F, 12) of several frames."""
    bodies, places = zip(*(known.of(robot, frame) for frame in frames), strict=True)
    return np.concatenate(bodies), np.array(places)


def _evaluate(arm: Arm, bodies: Array, places: Array, q: Array, poses: Array, jacobians: Array | None = None) -> int:
    """Fill poses and Jacobians at q (N, n) but for the rows that are :func:`_far`; return how many those are."""
    filled = None if jacobians is None else address_of(jacobians)
    return load_library().pathcontrol_frames(
        addressof(arm),
        len(bodies),
        address_of(bodies),
        address_of(places),
        len(q),
        address_of(q),
        address_of(poses),
        filled,
    )


def _place(pose: Array) -> Array:
    """Return a pose (4, 4) as the engine takes it, (12,)."""
    return np.concatenate([pose[:3, :3].ravel(), pose[:3, 3]])


def _rows(q: Array) -> Array:
    """Return q (*batch, n) as rows (N, n), one after the other."""
    return np.ascontiguousarray(q).reshape(-1, q.shape[-1])


def _far(q: Array) -> Array:
    """Return which rows of q (N, n) have a position that is not finite, or too large for the sines of the engine."""
    return np.asarray(~(np.abs(q) < _FARTHEST_ANGLE).all(-1))
