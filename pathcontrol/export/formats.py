"""Texts of trajectories: comma-separated values, ROS 2 messages, and URScript."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable
from typing import Literal

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.simulation.trajectory import Trajectory

Format = Literal["csv", "ros", "urscript"]

_DIGITS = 9  # after the point: nanoradians
_UR_JOINTS = 6
_UR_PERIODS = 0.002, 0.1  # s: what servoj keeps up with, and what does not stutter


def write_csv(trajectory: Trajectory) -> str:
    """Return a table with a row for each time, and units in its header."""
    units = [(unit, f"{unit}/s", f"{unit}/s^2") for unit in trajectory.units]
    names = ("position", "velocity", "acceleration")
    header = ["time [s]"] + [
        f"{joint} {name} [{own[k]}]"
        for k, name in enumerate(names)
        for joint, own in zip(trajectory.joints, units, strict=True)
    ]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows(map(_decimals, np.column_stack([trajectory.time, trajectory.q, trajectory.qd, trajectory.qdd])))
    return text.getvalue()


def write_ros(trajectory: Trajectory) -> str:
    """Return a ``trajectory_msgs/msg/JointTrajectory`` as JSON, which is YAML too, as ``ros2 topic pub`` takes it."""
    rows = zip(trajectory.time, trajectory.q, trajectory.qd, trajectory.qdd, strict=True)
    points = ",\n    ".join(_ros_point(*row) for row in rows)
    names = json.dumps(list(trajectory.joints))
    header = '"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}'
    return f'{{\n  {header},\n  "joint_names": {names},\n  "points": [\n    {points}\n  ]\n}}\n'


def write_urscript(trajectory: Trajectory) -> str:
    """Return a program for a Universal Robots arm: slowly to the start, then ``servoj`` at each time, then stop.

    Raises:
        InputError: the arm has other than six turning joints, or the time between samples is not from 2 to 100 ms.
    """
    if len(trajectory.joints) != _UR_JOINTS or set(trajectory.units) != {"rad"}:
        raise InputError(
            f"URScript is for arms with six joints that turn, the trajectory has {len(trajectory.joints)} "
            f"({', '.join(trajectory.joints)}); write csv or ros",
            value=len(trajectory.joints),
            limit=_UR_JOINTS,
        )
    low, high = _UR_PERIODS
    if not low * (1 - 1e-9) <= trajectory.period <= high * (1 + 1e-9):
        raise InputError(
            f"rate = {1 / trajectory.period:g} Hz, expected from {1 / high:g} to {1 / low:g} Hz for servoj",
            argument="rate",
            value=1 / trajectory.period,
            limit=(1 / high, 1 / low),
        )
    lines = [
        "def follow_path():",
        f"  movej([{_joined(trajectory.q[0])}], a=0.5, v=0.25)",
        *(f"  servoj([{_joined(q)}], t={trajectory.period:.9f}, lookahead_time=0.03, gain=500)" for q in trajectory.q),
        "  stopj(2.0)",
        "end",
        "follow_path()",
    ]
    return "\n".join(lines) + "\n"


#: what writes each format, and the suffix of its files
FORMATS: dict[str, tuple[Callable[[Trajectory], str], str]] = {
    "csv": (write_csv, ".csv"),
    "ros": (write_ros, ".json"),
    "urscript": (write_urscript, ".script"),
}


def _ros_point(time: float, q: Array, qd: Array, qdd: Array) -> str:
    """Return one point of the message."""
    nanoseconds = round(float(time) * 1e9)
    lists = zip(("positions", "velocities", "accelerations"), (q, qd, qdd), strict=True)
    fields = [f'"{name}": [{_joined(values)}]' for name, values in lists]
    when = f'{{"sec": {nanoseconds // 10**9}, "nanosec": {nanoseconds % 10**9}}}'
    return f'{{{", ".join(fields)}, "effort": [], "time_from_start": {when}}}'


def _joined(values: Array) -> str:
    return ", ".join(_decimals(values))


def _decimals(values: Iterable[float]) -> list[str]:
    """Return numbers with a point and without an exponent, which YAML 1.1 would take for text."""
    return [f"{value:.{_DIGITS}f}" for value in values]
