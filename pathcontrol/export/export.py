"""Files of trajectories."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

from pathcontrol._expect import expect, expect_choice
from pathcontrol._files import as_path, write_whole
from pathcontrol.errors import InputError, warn
from pathcontrol.export.formats import FORMATS, Format
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.trajectory import Trajectory

Limits = Literal["refuse", "warn"]


def export_trajectory(
    trajectory: Trajectory,
    path: str | Path,
    format: Format = "csv",  # noqa: A002 (what users call it)
    robot: RobotModel | None = None,
    limits: Limits = "refuse",
) -> Path:
    """Write a trajectory for a controller of an arm, whole or not at all.

    ``"csv"`` is a table of times, positions, velocities and accelerations. ``"ros"`` is a ROS 2 message
    ``trajectory_msgs/msg/JointTrajectory`` as JSON, which is YAML, too: ``ros2 topic pub --once TOPIC
    trajectory_msgs/msg/JointTrajectory "$(cat FILE)"``. ``"urscript"`` is a program for arms of Universal Robots.

    Args:
        trajectory: from :meth:`Run.to_trajectory` or :func:`plan_trajectory`.
        path: the file; a name without a suffix gets that of the format.
        format: which of them.
        robot: the arm, whose limits are checked first.
        limits: ``"refuse"`` a trajectory beyond a limit of the robot, or ``"warn"`` and write it.

    Returns:
        The file.

    Raises:
        InputError: a limit is passed, or the format cannot hold such a trajectory.
        StorageError: the file cannot be written; what was there before stays.
    """
    expect("trajectory", trajectory, Trajectory)
    expect_choice("format", format, get_args(Format))
    expect_choice("limits", limits, get_args(Limits))
    if robot is not None:
        _check_limits(trajectory, robot, limits)
    write, suffix = FORMATS[format]
    path = as_path("path", path)
    path = path if path.suffix else path.with_suffix(suffix)
    write_whole(path, write(trajectory).encode())
    return path


def _check_limits(trajectory: Trajectory, robot: RobotModel, limits: Limits) -> None:
    """Refuse a trajectory beyond the limits of its robot, or warn of it."""
    try:
        trajectory.check_limits(robot)
    except InputError as error:
        if limits == "refuse" or error.joint is None:
            raise
        warn(str(error))
