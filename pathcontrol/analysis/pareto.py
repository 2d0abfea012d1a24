"""The non-dominated set of many choices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array
from pathcontrol.errors import InputError

_BLOCK = 256  # points compared with all others at once


def non_dominated(values: ArrayLike) -> NDArray[np.bool_]:
    """Return which rows of ``values`` (N, d), d quantities that are to be small, no other row dominates, (N,).

    A row dominates another that it is nowhere larger than, and somewhere smaller. So of equal rows all are dominated
    or none is. Rows with a value that is not finite neither dominate nor are they in the set. With d = 2 it takes a
    sort; else N times the size of the set at worst.

    Raises:
        InputError: ``values`` is no table.
    """
    table = as_array("values", values)
    if table.ndim != 2 or not table.shape[1]:
        raise InputError(
            f"values has shape {table.shape}, expected (N, d): a row for each choice", argument="values", value=values
        )
    found = np.zeros(len(table), dtype=bool)
    known = np.flatnonzero(np.isfinite(table).all(1))
    points, which = np.unique(table[known], axis=0, return_inverse=True)  # in lexicographic order
    best = _sweep_front(points) if points.shape[1] <= 2 else _filter_blocks(points)
    found[known] = best[which.reshape(-1)]
    return found


def _sweep_front(points: Array) -> NDArray[np.bool_]:
    """Return the non-dominated ones of different points in lexicographic order, at most two columns."""
    last = points[:, -1]
    before = np.minimum.accumulate(last)[:-1]
    first = np.ones(min(1, len(points)), dtype=bool)
    return np.concatenate([first, last[1:] < before if points.shape[1] == 2 else np.zeros(len(before), dtype=bool)])


def _filter_blocks(points: Array) -> NDArray[np.bool_]:
    """Return the non-dominated ones of different points, block by block, the most promising first."""
    found = np.zeros(len(points), dtype=bool)
    spread = np.ptp(points, axis=0) if len(points) else np.ones(points.shape[1])
    left = np.argsort((points / np.where(spread > 0, spread, 1.0)).sum(1), kind="stable")
    while len(left):
        block = points[left[:_BLOCK]]
        within = np.all(block[:, None] >= block, axis=-1)
        np.fill_diagonal(within, False)
        best = ~np.any(within, axis=1)
        found[left[:_BLOCK][best]] = True  # a point that dominates another comes before it
        left = left[_BLOCK:]
        left = left[~_find_dominated(points[left], block[best])]
    return found


def _find_dominated(points: Array, others: Array) -> NDArray[np.bool_]:
    """Return which ``points`` are nowhere below one of the ``others``, all different from them."""
    columns = np.ascontiguousarray(points.T)
    above = np.zeros(len(points), dtype=bool)
    for other in others:
        one = columns[0] >= other[0]
        for column, least in zip(columns[1:], other[1:], strict=True):
            one &= column >= least
        above |= one
    return above
