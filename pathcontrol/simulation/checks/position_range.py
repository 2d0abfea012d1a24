"""Sentences about positions outside the limits of joints, many turns away, or in degrees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.loops import Arm

_TURNS = 4 * np.pi  # rad, beyond which the start of a joint without limits is unlikely
_FAR = 10.0  # rad, beyond which an angle outside its limits is probably in degrees
_DEGREES = "; did you mean degrees? Then give np.deg2rad(…), or '… deg' in a file"


class Range(NamedTuple):
    """The lower and the upper limits of joints [rad], (n,), or (N, n) for arms that differ."""

    lower: Array
    upper: Array


def describe_range(robot: RobotModel | None, q: Array) -> str:
    """Return the sentence about the worst joint of a log (k, n) outside its limits, or many turns away, or ""."""
    if robot is None:
        turned = float(np.abs(q).max())
        return f"the log has a joint at {turned:.4g} rad{_DEGREES}" if turned > _TURNS else ""
    beyond = find_excess(robot, q)
    sample, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
    if beyond[sample, joint] > 0:
        return describe_excess("the log has", robot, 0, int(joint), q[sample], "")
    return describe_turns("the log has", robot, q[:, None])


def describe_posture(begin: str, robot: RobotModel, q: Array, lower: Array, upper: Array) -> str:
    """Return the sentence about a posture (n,) outside limits (n,), or many turns away, or an empty text."""
    within = Range(lower, upper)
    beyond = find_excess(robot, q, within)
    joint = int(beyond.argmax())
    if beyond[joint] > 0:
        return describe_excess(begin, robot, 0, joint, q, "", within)
    return describe_turns(begin, robot, q[None, None])


def describe_turns(begin: str, robot: Arm, q: Array) -> str:
    """Return the sentence about a joint that is many turns away in postures (samples, N, n), or an empty text."""
    turns = np.where(np.array(robot.position_units) == "rad", np.abs(q), 0.0)
    place = np.unravel_index(int(turns.argmax()), turns.shape)
    if turns[place] <= _TURNS:
        return ""
    name, value = robot.joint_names[int(place[-1])], q[place]
    return f"{begin} {name} at {value:.4g} rad, which is {abs(value) / 2 / np.pi:.3g} turns{_DEGREES}"


def describe_excess(
    begin: str, robot: Arm, row: int, joint: int, q: Array, where: str, within: Range | None = None
) -> str:
    """Return the sentence about a position outside the limits of its robot, or those ``within`` it is to stay."""
    lower, upper = ((ends if ends.ndim == 1 else ends[row])[joint] for ends in within or _range(robot))
    unit = robot.position_units[joint]
    return (
        f"{begin} {robot.joint_names[joint]} at {q[joint]:.4g} {unit}{where}, outside its limits of {lower:.4g} to "
        f"{upper:.4g} {unit}{_DEGREES if _is_in_degrees(robot, q, within) else ''}"
    )


def _range(robot: Arm) -> Range:
    """Return the limits of the joints [rad], (n,), or (N, n) for arms that differ."""
    return Range(robot.limits.lower, robot.limits.upper)


def find_excess(robot: Arm, q: Array, within: Range | None = None) -> Array:
    """Return the distance of positions (*batch, N, n) outside their limits [rad]; ≤ 0 inside, or without limits."""
    lower, upper = within or _range(robot)
    limited = lower < upper
    return np.where(limited, np.maximum(lower - q, q - upper), 0.0) - 1e-9


def _is_in_degrees(robot: Arm, q: Array, within: Range | None = None) -> bool:
    """Return whether a posture (n,) far outside its limits would be within all of them if it were in degrees."""
    turning = np.array(robot.position_units) == "rad"
    meant = np.where(turning, np.deg2rad(q), q)
    return bool(np.abs(q[turning]).max(initial=0.0) > _FAR and (find_excess(robot, meant[None], within) <= 0).all())
