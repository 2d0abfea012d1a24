"""What is likely a slip, told before a simulation begins: degrees for radians, limits passed, arms too weak."""

from __future__ import annotations

import warnings

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import PathControlWarning
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.simulation.checks.weight import Along, weight_slip
from pathcontrol.simulation.loops import Arm
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

_TURNS = 4 * np.pi  # rad, beyond which a joint without limits hardly starts
_FAR = 10.0  # rad, beyond which an angle outside its limits is rather one in degrees
_MOVED, _LONG = 1e-9, 0.25  # rad, s: an arm that has not moved so much in so long


def warn_of_slips(robot: Arm, task: PathTask, q: Array, first: int = 0) -> str:
    """Warn of a start (N, n) or a path outside position limits, and of an arm that cannot hold its own weight on it.

    All arms and tasks of a batch are looked at; the worst is told. Of a larger batch the
    part with the ``first`` rollout 0 speaks for all.

    Returns:
        What is wrong with the start, in words, or nothing: if the arm diverges, that is why.
    """
    if first:
        return ""
    start, along = _of_start(robot, q), Along.of(task)
    for sentence in (start, _of_path(robot, along), weight_slip(robot, along, q)):
        if sentence:
            warnings.warn(sentence, PathControlWarning, stacklevel=3)
    return start


def warn_if_still(run: Run, robot: Arm, friction: str) -> None:
    """Warn of an arm that has not moved at all, held by dry friction that its law does not compensate."""
    arm = robot.robots[0] if isinstance(robot, RobotBatch) else robot
    dry = any(bool(np.any(level > 0)) for level in arm.friction.levels(np.zeros(arm.n)))
    if not dry or friction == "full" or run.time[-1] < _LONG or (run.status != "running").any():
        return
    if (np.ptp(run.array("q"), axis=1) <= _MOVED).all():
        warnings.warn(
            f"the arm did not move in {run.time[-1]:g} s: its dry friction holds it, which the law does not "
            'compensate; give the controller friction="full"',
            PathControlWarning,
            stacklevel=3,
        )


def _of_start(robot: Arm, q: Array) -> str:
    beyond = _beyond(robot, q)
    row, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
    if beyond[row, joint] > 0:
        return _outside("the start has", robot, int(row), int(joint), q[min(int(row), len(q) - 1)], "")
    turns = np.where(np.array(robot.position_units) == "rad", np.abs(q), 0.0)
    row, joint = np.unravel_index(int(turns.argmax()), turns.shape)
    if turns[row, joint] <= _TURNS:
        return ""
    name, value = robot.joint_names[int(joint)], q[row, joint]
    return f"the start has {name} at {value:.4g} rad, which is {abs(value) / 2 / np.pi:.3g} turns{_DEGREES}"


def _of_path(robot: Arm, along: Along) -> str:
    beyond = _beyond(robot, along.q)
    sample, row, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
    if beyond[sample, row, joint] <= 0:
        return ""
    path = min(int(row), along.q.shape[1] - 1)
    of = f" of rollout {row}" if beyond.shape[1] > 1 else ""
    where = f" at s = {along.s[sample, path]:.4g}"
    return _outside(f"the path{of} has", robot, int(row), int(joint), along.q[sample, path], where)


_DEGREES = "; did you mean degrees? Then give np.deg2rad(…)"


def _outside(begin: str, robot: Arm, row: int, joint: int, q: Array, where: str) -> str:
    lower, upper = ((ends if ends.ndim == 1 else ends[row])[joint] for ends in _range(robot))
    unit = robot.position_units[joint]
    return (
        f"{begin} {robot.joint_names[joint]} at {q[joint]:.4g} {unit}{where}, outside its limits of {lower:.4g} to "
        f"{upper:.4g} {unit}{_DEGREES if _as_degrees(robot, q) else ''}"
    )


def _range(robot: Arm) -> tuple[Array, Array]:
    """The lower and the upper limits of the joints [rad], (n,), or (N, n) of arms that differ."""
    return robot.limits.lower, robot.limits.upper


def _beyond(robot: Arm, q: Array) -> Array:
    """By how much positions (*batch, N, n) are outside their limits [rad]; not above 0 inside, or without limits."""
    lower, upper = _range(robot)
    limited = lower < upper
    return np.where(limited, np.maximum(lower - q, q - upper), 0.0) - 1e-9


def _as_degrees(robot: Arm, q: Array) -> bool:
    """Whether a posture (n,) would be within all limits if its angles were in degrees, and is far from it so."""
    turning = np.array(robot.position_units) == "rad"
    meant = np.where(turning, np.deg2rad(q), q)
    return bool(np.abs(q[turning]).max(initial=0.0) > _FAR and (_beyond(robot, meant[None]) <= 0).all())
