"""The postures from which a law is let go: a grid for two joints, and points around the path for more."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, qmc

from pathcontrol._arrays import Array, as_joint_array, check_finite, check_whole
from pathcontrol.errors import InputError
from pathcontrol.sweeps.space import MOST_SAMPLES
from pathcontrol.tasks.task import PathTask

_SAMPLES = 1025


def make_starts(task: PathTask, starts: ArrayLike | int, margin: float, seed: int) -> Array:
    """Return postures (N, n): those given, or at least as many as asked for, up to a margin [rad] from the path.

    Raises:
        InputError: they are for another number of joints, no numbers, none, or too many.
    """
    if np.ndim(starts):
        q = np.atleast_2d(check_finite("starts", as_joint_array("starts", starts, task.n)))
        return _check_count(q.reshape(-1, task.n))
    count = check_whole("starts", starts)
    if count > MOST_SAMPLES:
        raise InputError(
            f"starts = {count}, expected at most {MOST_SAMPLES}", argument="starts", value=count, limit=MOST_SAMPLES
        )
    return _make_grid(task, count, margin) if task.n == 2 else _scatter(task, count, margin, seed)


def _check_count(q: Array) -> Array:
    """Check that there are some starts, and not too many; return them."""
    if not 0 < len(q) <= MOST_SAMPLES:
        raise InputError(
            f"starts has {len(q)} postures, expected 1 to {MOST_SAMPLES}",
            argument="starts",
            value=len(q),
            limit=(1, MOST_SAMPLES),
        )
    return q


def _make_grid(task: PathTask, count: int, margin: float) -> Array:
    """Return a square grid of postures of two joints, over the path and a margin around it."""
    points = task.q_d(np.linspace(*task.sampled_interval, _SAMPLES))
    low, high = points.min(0) - margin, points.max(0) + margin
    sides = [np.linspace(a, b, math.ceil(math.sqrt(count))) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)


def _scatter(task: PathTask, count: int, margin: float, seed: int) -> Array:
    """Return Sobol points: anywhere along the path, in any direction from it, up to a margin."""
    power = math.ceil(math.log2(max(count, 2)))
    u = qmc.Sobol(task.n + 2, rng=np.random.default_rng(seed)).random_base2(power)[:count]
    lower, upper = task.sampled_interval
    direction = norm.ppf(np.clip(u[:, 2:], 1e-12, 1 - 1e-12))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.asarray(task.q_d(lower + u[:, 0] * (upper - lower)) + margin * u[:, 1:2] * direction)
