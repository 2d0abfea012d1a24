"""A grid of cells on a path, fine enough for a function of s, with values whose chords stay below it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.tasks.base import Task
from pathcontrol.tasks.profile import Path
from pathcontrol.tasks.regularity import check_regular
from pathcontrol.tasks.values_check import check_path

_SHARES = np.linspace(0, 1, 5)
_PEAK = 4.0
_HALVINGS = 12


def edges(path: Path, cells: int) -> Array:
    """Return the edges of at least ``cells`` cells over one traverse of a path, each within one piece of it.

    Raises:
        TaskError: the path neither ends nor closes, returns a wrong shape or NaN at the edges, or is not regular.
    """
    lower, upper = path.s0, path.s_end if path.period is None else path.s0 + path.period
    if not np.isfinite(upper):
        raise TaskError(
            f"{type(path).__name__} neither ends nor closes, so ϑ cannot be tabulated; give it an s_end", value=upper
        )
    knots = np.empty(0) if path.knots is None else path.knots
    margin = 1e-9 * (upper - lower)
    pieces = np.concatenate([[lower], knots[(knots > lower + margin) & (knots < upper - margin)], [upper]])
    counts = np.ceil(np.diff(pieces) * cells / (upper - lower) - 1e-6).clip(1)
    s = np.interp(np.arange(counts.sum() + 1), np.append(0, np.cumsum(counts)), pieces)
    check_path(path, s)  # where q_d' is NaN no cell would ever be small enough
    if isinstance(path, Task):
        check_regular(path)  # nor beside a corner
    return s


def quarters(edges: Array) -> Array:
    """Return the ends and the quarters of the cells between the ``edges`` (cells + 1,), (cells, 5)."""
    return edges[:-1, None] + np.diff(edges)[:, None] * _SHARES


def refine(resolved: Callable[[Array], NDArray[np.bool_]], edges: Array) -> Array:
    """Halve cells, at most 12 times, until their points (cells, 5) are ``resolved``; return all edges."""
    left, right, kept = edges[:-1], edges[1:], []
    for _ in range(_HALVINGS):
        coarse = ~resolved(left[:, None] + (right - left)[:, None] * _SHARES)
        kept.append(left[~coarse])
        middle = 0.5 * (left + right)[coarse]
        left, right = np.concatenate([left[coarse], middle]), np.concatenate([middle, right[coarse]])
    return np.append(np.sort(np.concatenate([*kept, left])), edges[-1])


def keep_below(values: Array) -> Array:
    """Return values at the edges, (cells + 1,), not above a function known at the ``quarters`` (cells, 5).

    They are lowered where a chord would exceed the function at a quarter.
    """
    cells = _cut_peaks(values)
    cells = cells / np.maximum(excess(values), 1.0)[:, None]
    return np.minimum(np.append(cells[:, 0], np.inf), np.append(np.inf, cells[:, -1]))


def excess(values: Array) -> Array:
    """Return the largest ratio of the chord between the ends to the ``values`` (cells, 5), (cells,)."""
    values = _cut_peaks(values)
    with np.errstate(invalid="ignore"):
        chord = values[:, :1] + (values[:, -1:] - values[:, :1]) * _SHARES
        # an end is infinite only where all is
        return np.where(np.isfinite(chord), chord / values, 1.0).max(-1)


def _cut_peaks(values: Array) -> Array:
    """Lower ends far above the values inside, so that no lone peak lowers the other end of its cell."""
    return np.minimum(values, _PEAK * values[:, 1:-1].min(-1, keepdims=True))
