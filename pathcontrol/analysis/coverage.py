"""The coverage of a path: the share of its length that the arm or its tool passed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.geometry.closest_point.cells import FARTHEST
from pathcontrol.geometry.nearest_rows import nearest_rows
from pathcontrol.tasks.task import PathTask

_POINTS = 1000  # points of a path, at least
_MOST = 200_000  # limit of points of a refined trace
_FINER = 0.5  # distance between points of a trace, as a share of the tolerance


class Points(NamedTuple):
    """Points (k, m) on a curve, and the length of the curve that each represents, (k,)."""

    at: Array
    length: Array


class Coverage(NamedTuple):
    """The coverage of a curve by a trace: the share of its length within a tolerance, and its farthest distance."""

    share: float
    farthest: float


def path_points(task: PathTask) -> Points:
    """Return points of one traverse of a path in joint space, its knots among them.

    Raises:
        TaskError: the path goes on for ever without repeating.
    """
    return even_points(task.q_d(traverse(task)))


def traverse(task: PathTask) -> Array:
    """Return increasing parameters (k,) of one traverse of a path: a thousand, and its knots.

    Raises:
        TaskError: the path goes on for ever without repeating.
    """
    lower, upper = task.one_traverse
    s = np.linspace(lower, upper, _POINTS + 1)
    if task.knots is not None and len(task.knots) <= _MOST:
        s = np.union1d(s, task.knots[(task.knots > lower) & (task.knots < upper)])
    return s


def even_points(at: Array) -> Points:
    """Return the points (k, m) of a curve in order, each with half of the chords to its neighbours.

    Raises:
        TaskError: one of them is not finite, or too far away for its square to be.
    """
    if not (known := (np.abs(at) < FARTHEST).all(-1)).all():
        raise TaskError(
            f"the curve passes {at[np.argmin(known)].tolist()}, expected numbers below {FARTHEST:g}",
            value=at[np.argmin(known)],
            limit=FARTHEST,
        )
    chord = np.linalg.norm(np.diff(at, axis=0), axis=-1)
    return Points(at, 0.5 * (np.append(chord, 0.0) + np.append(0.0, chord)))


def measure_coverage(points: Points, trace: Array, tolerance: float) -> Coverage:
    """Return the coverage of a curve by a ``trace`` (t, m), straight between its samples."""
    distance = distance_to_trace(points.at, trace, tolerance)
    total = points.length.sum()
    share = points.length[distance <= tolerance].sum() / total if total else float((distance <= tolerance).all())
    return Coverage(float(share), float(distance.max()))


def distance_to_trace(x: Array, trace: Array, resolution: float) -> Array:
    """Return the distance of points (k, m) from a trace (t, m), straight between its samples, (k,).

    The trace is refined until its points are half of the ``resolution`` apart; then the straight lines on either side
    of the nearest point count.
    """
    fine = refine(trace[(np.abs(trace) < FARTHEST).all(-1)], _FINER * resolution)
    if not len(fine):
        return np.full(len(x), np.inf)
    nearest = nearest_rows(x, fine)
    sides = [(np.maximum(nearest - 1, 0), nearest), (nearest, np.minimum(nearest + 1, len(fine) - 1))]
    return np.min([_line_distance(x, fine[a], fine[b]) for a, b in sides], axis=0)


def refine(trace: Array, step: float) -> Array:
    """Add points on the straight lines of a trace (t, m), so that points are at most ``step`` apart."""
    chord = np.linalg.norm(np.diff(trace, axis=0), axis=-1)
    if not len(chord):
        return trace
    step = max(step, float(chord.sum()) / _MOST)
    place = np.append(0, np.cumsum(np.maximum(np.ceil(chord / step), 1)))
    wanted = np.arange(place[-1] + 1)
    return np.stack([np.interp(wanted, place, column) for column in trace.T], axis=-1)


def _line_distance(x: Array, start: Array, end: Array) -> Array:
    """Return the distance from points (k, m) to straight lines between two points (k, m) each."""
    line = end - start
    square = np.maximum((line * line).sum(-1), np.finfo(float).tiny)
    share = np.clip(((x - start) * line).sum(-1) / square, 0.0, 1.0)
    return np.linalg.norm(start + share[:, None] * line - x, axis=-1)
