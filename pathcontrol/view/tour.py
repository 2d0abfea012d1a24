"""The motion of each joint of an arm in turn, to look at the arm without a simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.urdf import parse_urdf
from pathcontrol.robot.urdf.elements import MOVABLE_TYPES
from pathcontrol.simulation.run import Run

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel

_TIME = 2.0  # s for a joint
_SAMPLES = 60  # for a joint
_SWING = (np.pi / 3, 0.2)  # rad and m, at most, to either side


def tour(robot: RobotModel) -> Run:
    """Return a run of kinematics alone: each joint swings to both sides of its rest, one after another.

    A joint rests at 0, or where that is outside its limits in their middle, and swings by 60 deg or 0.2 m at most.
    """
    low, high = robot.limits.lower, robot.limits.upper
    with np.errstate(invalid="ignore"):
        middle = np.where(np.isfinite(low + high), (low + high) / 2, np.clip(0.0, low, high))
    rest = np.where((low <= 0) & (high >= 0), 0.0, middle)
    most = np.where(np.array(robot.position_units) == "m", _SWING[1], _SWING[0])
    phase = np.linspace(0, 2 * np.pi, _SAMPLES, endpoint=False)
    parts = [_swing(rest, i, phase, (low[i], high[i]), most[i]) for i in range(robot.n)]
    q = np.concatenate([*parts, rest[None]])
    time = np.arange(len(q)) * _TIME / _SAMPLES
    units = dict(zip(robot.joint_names, robot.position_units, strict=True))
    return Run.from_arrays(
        time, units, {"q": q[None]}, {"controller": {"controller": "each joint in turn"}}, robot=robot
    )


def joints_to_show(text: str) -> list[str]:
    """Return the joints of a URDF that neither follow another nor lead one, and so can move alone."""
    root = parse_urdf(text)
    movable = [joint for joint in root.iterfind("joint") if joint.get("type") in MOVABLE_TYPES]
    bound = {mimic.get("joint") for mimic in root.iterfind("joint/mimic")}
    return [joint.get("name") for joint in movable if joint.find("mimic") is None and joint.get("name") not in bound]


def _swing(rest: Array, i: int, phase: Array, limits: tuple[float, float], most: float) -> Array:
    """Return postures in which joint ``i`` goes up, down and back within its limits, (samples, n)."""
    q = np.tile(rest, (len(phase), 1))
    room = np.where(np.sin(phase) > 0, limits[1] - rest[i], rest[i] - limits[0])
    q[:, i] += np.sin(phase) * np.minimum(room, most)
    return q
