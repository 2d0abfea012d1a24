"""The gains that all laws of a comparison share, and what they come to for one arm and one task."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError, TaskError
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask

_RATE = 20.0  # 1/s, of the paper's plan towards the nearest point, k‖q_d'‖²
_POINTS = 256  # along the path, of means


class Gains(NamedTuple):
    """The gains that all laws of a comparison share.

    Attributes:
        K_p: position gain [1/s²], a number or (n,).
        K_v: velocity gain [1/s], a number or (n,).
        k: gain of the extended motion plan [1/(rad² s)]; ``None`` for k‖q_d'‖² = 20 1/s on average, as in the paper.
    """

    K_p: ArrayLike = 800.0
    K_v: ArrayLike = 57.0
    k: float | None = None


def make_gains(gains: Any) -> Gains:
    """Return gains that are given as :class:`Gains`, as a table by their names, or one after another.

    Raises:
        InputError: they are something else.
    """
    try:
        return Gains(**gains) if isinstance(gains, Mapping) else Gains(*gains)
    except TypeError as error:
        raise InputError(
            f"gains = {gains!r:.80}, expected K_p, K_v and, if the plan has one of its own, k: "
            '{"K_p": 800.0, "K_v": [45.0, 100.0], "k": 20.0}',
            argument="gains",
            value=gains,
        ) from error


def sample_task(task: PathTask) -> Array:
    """Return path parameters s evenly over one traverse of a path, (k,)."""
    try:
        lower, upper = task.one_traverse
    except TaskError:  # neither ends nor repeats
        lower, upper = task.sampled_interval
    return np.linspace(lower, upper, _POINTS, endpoint=not task.closed)


def mean_inertia(robot: RobotModel, task: PathTask) -> Array:
    """Return the diagonal of M(q̄) [kg m²], (n,), at the mean posture q̄ of a path."""
    return np.array(robot.mass_matrix(task.q_d(sample_task(task)).mean(0)).diagonal())


def split_damping(K_p: Array, K_v: Array) -> tuple[Array, Array]:
    """Return Λ and D = K_d/m [1/s] of Slotine and Li's law on a mass m, with ΛD = K_p and Λ + D = K_v, (n,) each.

    On that mass the law gives ë + (Λ + D)ė + ΛDe = 0. Λ is the smaller root. Where K_v² < 4K_p the roots are complex,
    as the law cannot damp less than critically: there Λ = D = √K_p, with the same stiffness and the least damping.
    """
    root = np.sqrt(np.maximum(K_v**2 - 4 * K_p, 0.0))
    fast = np.where(root > 0, 0.5 * (K_v + root), np.sqrt(K_p))
    return K_p / fast, fast


def mean_plan_gain(task: PathTask) -> float:
    """Return k [1/(rad² s)] with k‖q_d'‖² = 20 1/s, the mean over a path."""
    slopes = task.dq_d(sample_task(task))
    return float(_RATE / np.vecdot(slopes, slopes).mean())
