"""The check that arms can hold their own weight, at the start and all along their paths."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.loops import Arm
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

_SAMPLES = 129  # samples of a path
_FEWEST = 3
_MOST = 1 << 16  # limit of samples of all paths together
_NO_LIMIT = 1e6  # N m: files without a limit give some huge number, or zero


class PathPostures(NamedTuple):
    """Postures along the paths of all rollouts, or along the one path that they share.

    Attributes:
        s: path parameters, (samples, N or 1).
        q: q_d(s) [rad], (samples, N or 1, n).
    """

    s: Array
    q: Array

    @classmethod
    def of(cls, task: PathTask) -> PathPostures:
        """Return postures along a task or a batch of tasks; fewer of each, the more tasks there are."""
        tasks = len(task) if isinstance(task, TaskBatch) else 1
        share = np.linspace(0.0, 1.0, int(np.clip(_MOST // tasks, _FEWEST, _SAMPLES)))[:, None]
        lower, upper = (np.broadcast_to(end, tasks) for end in task.sampled_interval)
        s = lower + share * (upper - lower)
        q = task.q_d(s if tasks > 1 or isinstance(task, TaskBatch) else s[:, 0])
        return cls(s, q.reshape(*s.shape, -1))

    def of_rows(self, rows: NDArray[np.intp]) -> PathPostures:
        """Return the postures of some rollouts."""
        return self if self.q.shape[1] == 1 else PathPostures(self.s[:, rows], self.q[:, rows])


class _Worst(NamedTuple):
    """The largest weight relative to its limit: the share, the rollout, the joint and the place in words."""

    share: float = 0.0
    rollout: int = 0
    joint: int = 0
    place: str = ""


def check_weight(robot: Arm, along: PathPostures, q: Array) -> str:
    """Return the sentence about a joint that cannot hold the weight of its arm, or an empty text.

    The start (N, n) and the path are checked.

    It names the arm and place where the torque is largest relative to its limit.
    """
    if isinstance(robot, RobotBatch):
        bodies, body = robot.bodies, robot.body
    else:
        bodies, body = [robot], np.zeros(max(len(q), along.q.shape[1]), dtype=np.intp)
    effort = np.broadcast_to(np.abs(robot.limits.effort), (len(body), robot.n))
    limits = np.where((effort > 0) & (effort < _NO_LIMIT), effort, np.inf)
    starts, worst, weak = np.broadcast_to(q, limits.shape), _Worst(), 0
    for k, arm in enumerate(bodies):
        rows = np.flatnonzero(body == k)
        found, count = _check_body(arm, along.of_rows(rows), starts[rows], limits[rows], rows)
        worst, weak = max(worst, found, key=lambda one: one.share), weak + count
    return _describe_worst(robot, worst, limits, weak) if weak else ""


def _check_body(
    arm: RobotModel, along: PathPostures, starts: Array, limits: Array, rows: NDArray[np.intp]
) -> tuple[_Worst, int]:
    """Return the worst of the ``rows`` with one rigid body, starts and limits (k, n), and the number of weak ones."""
    path = np.abs(arm.gravity(along.q))
    shares = np.stack([np.abs(arm.gravity(starts)) / limits, path.max(0) / limits])
    there, row, joint = np.unravel_index(int(shares.argmax()), shares.shape)
    column = row if path.shape[1] > 1 else 0
    place = f"at s = {along.s[path[:, column, joint].argmax(), column]:.4g} of the path" if there else "at the start"
    worst = _Worst(float(shares[there, row, joint]), int(rows[row]), int(joint), place)
    return worst, int((shares > 1).any((0, 2)).sum())


def _describe_worst(robot: Arm, worst: _Worst, limits: Array, weak: int) -> str:
    """Return the sentence about the worst joint."""
    unit, limit = "N m" if robot.position_units[worst.joint] == "rad" else "N", limits[worst.rollout, worst.joint]
    of = f" in rollout {worst.rollout}, the worst of {weak}," if len(limits) > 1 else ""
    return (
        f"{robot.joint_names[worst.joint]} needs {worst.share * limit:.4g} {unit} {worst.place}{of} to hold the arm "
        f"and its load, its limit is {limit:.4g} {unit}; check the effort limits of the URDF, and payloads [kg]"
    )
