"""The regularity of a path: it neither stands still nor turns back."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.tasks.base import Task

_SAMPLES = 129
_HALVINGS = 20  # of the stretch between two samples, to 1e-8 of the domain: nearer to a tip, computed q_d' is rounding
_OPPOSITE = -0.99  # cosine of an angle
_TINY = np.finfo(np.float64).tiny


def check_moves(task: Task) -> None:
    """Check that a path is regular on its domain: it neither stands still nor turns back.

    Raises:
        TaskError: it does, and where.
    """
    name, s = type(task).__name__, np.linspace(*task.sampled_interval, _SAMPLES)
    tangent = np.asarray(task.dq_d(s))
    length = np.linalg.norm(tangent, axis=-1)
    _check_regular(name, s, length)
    _check_cusps(task, name, s, tangent / np.maximum(length[:, None], _TINY))


def _check_regular(name: str, s: Array, length: Array) -> None:
    """Check that the path never stands still: q_d' vanishes nowhere."""
    if not length.min() > 1e-9 * length.max():
        raise TaskError(
            f"{name}.dq_d(s={s[int(np.argmin(length))]:g}) has length {length.min():.1e}, expected a path that moves "
            "with s everywhere: q_d' = 0 is a cusp or a standstill",
            s=float(s[int(np.argmin(length))]),
        )


def _check_cusps(task: Task, name: str, s: Array, directions: Array) -> None:
    """Check that the path turns back nowhere: its ``directions`` (k, n) at s do not reverse between samples."""
    turns = np.flatnonzero((directions[1:] * directions[:-1]).sum(-1) < 0)
    if not turns.size:
        return
    left, right, before = s[turns], s[turns + 1], directions[turns]
    for _ in range(_HALVINGS):
        middle = 0.5 * (left + right)
        ahead = (_directions(task, middle) * before).sum(-1) > 0
        left, right = np.where(ahead, middle, left), np.where(ahead, right, middle)
    beside = right - left  # at the tip itself a direction is rounding
    left, right = np.maximum(left - beside, s[0]), np.minimum(right + beside, s[-1])
    cosine = (_directions(task, left) * _directions(task, right)).sum(-1)
    # between the paths of a sequence the arm comes to rest, and may turn round
    rests = np.asarray(getattr(task, "starts", ()))
    cosine[((rests >= left[:, None]) & (rests <= right[:, None])).any(-1)] = 1.0
    if cosine.min() < _OPPOSITE:
        raise TaskError(
            f"{name} turns back at s = {left[int(np.argmin(cosine))]:g}, expected a path without cusps: no arm that "
            "moves can turn round at once; end the path there, or round the tip",
            s=float(left[int(np.argmin(cosine))]),
        )


def _directions(task: Task, s: Array) -> Array:
    """Return the unit tangents q_d'/‖q_d'‖, (*batch, n)."""
    tangent = np.asarray(task.dq_d(s))
    return tangent / np.maximum(np.linalg.norm(tangent, axis=-1, keepdims=True), _TINY)
