"""The reach and the speed of an arm, to warn of lengths and speeds that are far beyond them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pathcontrol.errors import warn
from pathcontrol.robot.model import RobotModel

_POSTURES = 32
_USUAL = 4 * np.pi  # rad/s, or m/s of sliding joints, where the robot states no limit of velocity
_MARGIN = 1.5  # times the speed found in the postures
FAR = 3.0  # times the reach


class Extent(NamedTuple):
    """The reach and the greatest speed of a frame of an arm, over random postures.

    Attributes:
        reach: how far its origin is from the base's [m].
        speed: how fast it is when all joints move at their limits of velocity [m/s].
    """

    reach: float
    speed: float


@lru_cache(maxsize=4)  # of the arm that a toolpath asks about for each of its contours
def extent(robot: RobotModel, frame: str) -> Extent:
    """Return the reach and the greatest speed of a frame of an arm."""
    limits = robot.limits
    lower, upper = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    share = np.random.default_rng(0).random((_POSTURES, robot.n))
    pose, jacobian = robot.frame_kinematics(lower + share * (upper - lower), frame)
    known = np.isfinite(limits.velocity) & (limits.velocity > 0) & (limits.velocity < 1e3)
    each = np.linalg.norm(jacobian[:, :3], axis=1) @ np.where(known, limits.velocity, _USUAL)
    return Extent(float(np.linalg.norm(pose[:, :3, 3], axis=1).max()), float(each.max()))


def question_speed(name: str, speed: float, robot: RobotModel, frame: str) -> None:
    """Warn of a ``speed`` of a tool [m/s] that is far beyond the arm: it is likely in millimetres per second."""
    most = extent(robot, frame).speed
    if most > 0 and speed > _MARGIN * most:
        warn(
            f"{name} = {speed:g} m/s, but {frame!r} of {robot.name} does some {most:.2g} m/s with all joints at their "
            f"limits; did you mean {speed:g} mm/s, which is {1e-3 * speed:g}?"
        )


def question_length(name: str, length: float, robot: RobotModel, frame: str, share: float = FAR) -> None:
    """Warn of a ``length`` [m] beyond a ``share`` of the reach of the arm: it is likely in millimetres."""
    reach = extent(robot, frame).reach
    if reach > 0 and length > share * reach:
        warn(
            f"{name} = {length:g} m, but {frame!r} of {robot.name} reaches some {reach:.2g} m; did you mean "
            f"{length:g} mm, which is {1e-3 * length:g}?"
        )


def question_offset(name: str, offset: Sequence[float], robot: RobotModel) -> None:
    """Warn of an ``offset`` [m] on an arm that is longer than the arm itself: it is likely in millimetres."""
    length = float(np.linalg.norm(offset))
    poses = robot.frame_poses(np.zeros(robot.n), robot.frame_names)
    size = float(np.linalg.norm(poses[..., :3, 3], axis=-1).max())
    if size > 0 and length > size:
        warn(
            f"{name} is {length:g} m long, but {robot.name} is some {size:.2g} m; did you mean {length:g} mm, which is "
            f"{1e-3 * length:g}?"
        )
