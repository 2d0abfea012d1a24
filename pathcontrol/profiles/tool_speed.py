"""A profile of constant tool speed: the feed rate."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.arguments import Form, Unit
from pathcontrol.errors import TaskError
from pathcontrol.profiles.motion import ToolMotion, growth
from pathcontrol.robot.extent import question_speed
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.profile import Path, VelocityProfile

_STANDSTILL = 1e-7  # m/rad


class ToolSpeed(VelocityProfile):
    """The profile ϑ(s) = v₀/‖p'(s)‖: the origin p of ``frame`` moves at the constant speed v₀ = ``speed`` [m/s].

    With p' = J_v q_d' and p'' = J_v q_d'' + J̇_v q_d',  ϑ' = −v₀ p'ᵀp''/‖p'‖³.

    Neither acceleration nor joint velocity is limited: they grow without bound where the frame is hardly moved by the
    path. :func:`limited` keeps a feed within limits. Kinematics are evaluated arm by arm, some 10 µs each; for
    thousands of rollouts tabulate the feed with ``limited(path, MotionLimit(ToolMotion(robot, frame), speed))``.

    Args:
        robot: the arm whose joints the path is for.
        frame: name of the tool's frame.
        speed: v₀ [m/s].

    Raises:
        TaskError: on evaluation, where the path does not move the frame's origin.
    """

    def __init__(self, robot: RobotModel, frame: str, speed: Annotated[float, Form.POSITIVE, Unit("m/s")]) -> None:
        self.motion, self.frame = ToolMotion(robot, frame), frame
        self.speed = as_scalar("speed", speed, positive=True)
        question_speed("speed", self.speed, robot, frame)

    def theta(self, path: Path, s: Array) -> Array:
        return self.at(path.dq_d(s), path.ddq_d(s), path, s)[0]

    def dtheta(self, path: Path, s: Array) -> Array:
        return self.at(path.dq_d(s), path.ddq_d(s), path, s)[1]

    def at(self, dq_d: Array, ddq_d: Array, path: Path, s: Array) -> tuple[Array, Array]:
        dp, ddp = self.motion.of(path.q_d(s), dq_d, ddq_d)
        length = np.linalg.norm(dp, axis=-1)
        self._check_moving(length, np.linalg.norm(dq_d, axis=-1), np.asarray(s))
        theta = self.speed / length
        return theta, -theta * growth(dp, ddp)

    def _check_moving(self, length: Array, joints: Array, s: Array) -> None:
        still = length <= _STANDSTILL * joints
        if still.any():
            raise TaskError(
                f"the path does not move the origin of {self.frame!r} at s = {s[still].flat[0]:g}, so its speed cannot "
                f"be {self.speed:g} m/s; name a frame that moves there, or limit the joints: ConstantSpeed, limited",
                value=self.speed,
                s=float(s[still].flat[0]),
            )
