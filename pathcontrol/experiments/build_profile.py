"""From ``profile`` of a task to a :class:`VelocityProfile`."""

from __future__ import annotations

from collections.abc import Callable

from pathcontrol.experiments.profile_sections import LimitedProfile, Profile, TimeOptimalProfile, ToolSpeedProfile
from pathcontrol.experiments.profile_sections import RateProfile as RateSection
from pathcontrol.profiles.limited.limited import limited
from pathcontrol.profiles.limited.motion_limit import MotionLimit
from pathcontrol.profiles.motion import JointMotion, ToolMotion
from pathcontrol.profiles.tool_speed import ToolSpeed
from pathcontrol.profiles.topp.time_optimal import time_optimal
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.profile import ConstantRate, ConstantSpeed, VelocityProfile
from pathcontrol.tasks.task import PathTask


def build_profile(
    section: Profile, task: PathTask, robot: RobotModel, to_radians: Callable[[float], float]
) -> VelocityProfile:
    """The profile for a task of an arm.

    Raises:
        PathControlError: a limit cannot be kept, a frame does not exist, or the path does not suit the profile.
    """
    arguments = section.arguments(to_radians)
    if isinstance(section, LimitedProfile):
        return _limited(section, task, robot, to_radians)
    if isinstance(section, TimeOptimalProfile):
        return time_optimal(robot, task, **arguments)
    if isinstance(section, ToolSpeedProfile):
        return ToolSpeed(robot, **arguments)
    return ConstantRate(**arguments) if isinstance(section, RateSection) else ConstantSpeed(**arguments)


def _limited(
    section: LimitedProfile, task: PathTask, robot: RobotModel, to_radians: Callable[[float], float]
) -> VelocityProfile:
    """Angles are converted for the joints only; those of a tool are lengths."""
    arguments = section.arguments(to_radians if section.frame is None else float)
    frame = arguments.pop("frame", None)
    return limited(task, MotionLimit(JointMotion() if frame is None else ToolMotion(robot, frame), **arguments))
