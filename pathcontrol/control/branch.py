"""The choice of the branch for the projection, where a path crosses itself or passes close by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._expect import expect_choice
from pathcontrol.tasks.batch.task_batch import select_rows
from pathcontrol.tasks.task import PathTask

Branch = Literal["follow", "nearest", "local"]

_NEARER = 0.5  # share of the distance from the present branch within which another branch must lie


@dataclass(frozen=True)
class BranchPolicy:
    """The rule by which the projection leaves the branch of the path that it is on.

    ``"local"``
        Never: σ̄ changes continuously with q as long as its branch has a nearest point, and else goes on downhill.
    ``"nearest"``
        Whenever another branch is nearer: σ̄ is always the global minimum, and jumps where two are equally near.
    ``"follow"``
        Only when the arm has been pushed away, farther than ``capture`` from its branch, and another one is less than
        half as far. It does not jump back and forth, since the branch that it leaves is then more than twice as far.
        As long as the arm is within ``capture`` no other branch is looked for, at no cost, and the passes of a path may
        lie as close together as they like.

    Args:
        branch: the policy.
        capture: distance ‖q_d(σ̄) − q‖ [rad] from which the arm counts as pushed away. The default, 0.1 rad = 5.7 deg,
            is four times the largest error of the paper's experiments in steady state: well above what tracking leaves,
            well below what a person or a collision does. Choose it above the largest tracking error that is normal.
    """

    branch: Branch = "follow"
    capture: float = 0.1

    def __post_init__(self) -> None:
        expect_choice("branch", self.branch, get_args(Branch))
        object.__setattr__(self, "capture", as_scalar("capture", self.capture, positive=True))

    def sigma_bar(self, task: PathTask, q: Array, last: Array) -> Array:
        """Return σ̄ (*batch,) for the arm at q (*batch, n), before a push to another branch is considered."""
        return shift_to_lap(task, task.sigma_bar(q), last) if self.branch == "nearest" else task.sigma_bar(q, near=last)

    def captured(self, task: PathTask, q: Array, s: Array, q_d: Array) -> Array:
        """Return σ̄ on the branch that the arm was pushed to, or ``s``, with q_d = q_d(s), where there is none."""
        error = q_d - q
        # the first test is a quick one for all rollouts together
        if self.branch != "follow" or np.vdot(error, error) <= self.capture**2:
            return s
        distance = np.sqrt((error * error).sum(-1))
        away = distance > self.capture
        if not away.any():
            return s
        there = select_rows(task, away)
        other = there.sigma_bar(q[away])
        jumps = np.linalg.norm(there.q_d(other) - q[away], axis=-1) < _NEARER * distance[away]
        s = np.array(s)
        s[away] = np.where(jumps, shift_to_lap(there, other, s[away]), s[away])
        return s


def shift_to_lap(task: PathTask, s: Array, near: Array) -> Array:
    """Return ``s`` in the lap in which it is nearest to ``near``."""
    return s if task.period is None else s + task.period * np.round((near - s) / task.period)
