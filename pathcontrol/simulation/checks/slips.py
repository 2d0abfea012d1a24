"""Warnings of likely slips before a simulation: degrees for radians, limits passed, arms that are too weak."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.errors import warn
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.simulation.arm.disturbance import Disturbance, list_terms
from pathcontrol.simulation.arm.friction_change import FrictionChange
from pathcontrol.simulation.arm.torque_limit_drop import TorqueLimitDrop
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.checks.friction_knowledge import advise_on_dry_friction
from pathcontrol.simulation.checks.position_range import describe_excess, describe_turns, find_excess
from pathcontrol.simulation.checks.weight import PathPostures, check_weight
from pathcontrol.simulation.loops import Arm, torque_limits
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.run_arguments import Loop
from pathcontrol.tasks.task import PathTask

_AWAY = 10.0  # m, beyond which a point of a wall is probably in millimetres
_MOVED, _LONG = 1e-9, 0.25  # rad, s: an arm is still if it moves by less in a longer time


def warn_of_slips(robot: Arm, task: PathTask, q: Array, first: int = 0) -> str:
    """Warn of a start (N, n) or a path outside position limits, and of an arm that cannot hold its own weight on it.

    All arms and tasks of a batch are checked, and the worst is reported; of a larger batch only the part with the
    ``first`` rollout 0.

    Returns:
        What is wrong with the start, in words, or an empty text; if the arm diverges, this is the likely cause.
    """
    if first:
        return ""
    start, along = _check_start(robot, q), PathPostures.of(task)
    for sentence in (start, _check_path(robot, along, _is_bounded(task)), check_weight(robot, along, q)):
        if sentence:
            warn(sentence)
    return start


def warn_if_still(run: Run, robot: Arm, controller: Controller) -> None:
    """Warn of an arm that has not moved at all, held by dry friction that its law does not compensate."""
    arm = robot.robots[0] if isinstance(robot, RobotBatch) else robot
    advice = advise_on_dry_friction([controller.friction], controller.robot.friction, arm.friction)
    if not advice or run.time[-1] < _LONG or (run.status != "running").any():
        return
    q = run.array("q")
    if (np.abs(q[:, -1] - q[:, 0]) > _MOVED).any():  # as most do, found without a look at all samples
        return
    if (np.ptp(q, axis=1) <= _MOVED).all():
        warn(f"the arm did not move in {run.time[-1]:g} s: {advice}")


def warn_of_idle_changes(robot: Arm, loop: Loop, disturbance: Disturbance | None, first: int = 0) -> None:
    """Warn of a multiple of friction that the arm does not have, and of a share of limits that a loop does not have.

    Of a larger batch only the part with the ``first`` rollout 0 is looked at.
    """
    for term in () if first else list_terms(disturbance):
        if isinstance(term, FrictionChange) and term.is_idle(robot.friction):
            warn(f"{robot.name} has no friction, so FrictionChange(factor=…) changes nothing; add some by coulomb=…")
        if isinstance(term, TorqueLimitDrop) and (limits := torque_limits(loop, robot)) is not None:
            idle = np.atleast_2d(np.isinf(limits) & (term.factor > 0) & (term.factor < 1))
            names = [robot.joint_names[joint] for joint in np.flatnonzero(idle.any(0)).tolist()]
            if names:
                has = "have no torque limits" if len(names) > 1 else "has no torque limit"
                warn(
                    f"{', '.join(names)} {has}, and TorqueLimitDrop leaves a share of none as it is; give numbers "
                    "[N m] by torque_limits=[…]"
                )


def warn_of_walls(disturbance: Disturbance | None, q: Array, first: int = 0) -> None:
    """Warn of walls that are there at the start with the arm (N, n) beyond them, or that are far from it."""
    for term in list_terms(disturbance):
        if not isinstance(term, Wall) or first:
            continue
        gap = term.gap(q)
        row = int(np.where(term.stands(0.0, len(q)), gap, np.inf).argmin())
        if term.stands(0.0, len(q))[row] and gap[row] < 0:
            whose = f" of rollout {row}" if len(q) > 1 else ""
            rigid = bool(np.isinf(np.broadcast_to(np.ravel(term.springs[0]), len(q))[row]))
            what = "is rigid and lets it only go out" if rigid else "will push it out"
            warn(f"the frame {term.frame!r}{whose} starts {-gap[row]:.3g} m beyond its wall, which {what}")
        elif (away := float(np.abs(gap).min())) > _AWAY:
            warn(f"the wall is {away:.3g} m from the frame {term.frame!r} at the start; points are in metres")


def _check_start(robot: Arm, q: Array) -> str:
    """Return the sentence about the worst joint at the start, or an empty text."""
    beyond = find_excess(robot, q)
    row, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
    if beyond[row, joint] > 0:
        return describe_excess("the start has", robot, int(row), int(joint), q[min(int(row), len(q) - 1)], "")
    return describe_turns("the start has", robot, q[None])


def _check_path(robot: Arm, along: PathPostures, ends: bool) -> str:
    """Return the sentence about the worst joint along a path that ends or repeats, or an empty text.

    One that goes on for ever may turn a joint as often as it likes.
    """
    beyond = find_excess(robot, along.q)
    sample, row, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
    if beyond[sample, row, joint] <= 0:
        return describe_turns("the path goes to", robot, along.q if ends else along.q[:1])
    path = min(int(row), along.q.shape[1] - 1)
    of = f" of rollout {row}" if beyond.shape[1] > 1 else ""
    where = f" at s = {along.s[sample, path]:.4g}"
    return describe_excess(f"the path{of} has", robot, int(row), int(joint), along.q[sample, path], where)


def _is_bounded(task: PathTask) -> bool:
    """Return whether a path, or each of a batch, ends or repeats."""
    return bool(np.all(task.closed | np.isfinite(task.s_end)))
