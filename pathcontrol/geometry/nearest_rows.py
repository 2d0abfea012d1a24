"""The nearest of many points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array

_PAIRS = 20_000_000  # up to which these searches take less time than loading the search tree
_FEW = 100_000  # pairs, of which all distances take less time than to look which of them may be the least
_ROWS, _POINTS = 16, 32  # neighbours along curves, looked at together


def nearest_rows(x: Array, points: Array) -> NDArray[np.intp]:
    """Return the index of the nearest of some ``points`` (t, m) to each of x (k, m), (k,), the first of equal ones.

    It takes the least time where rows that follow one another are near to each other, as along curves.
    """
    pairs = len(x) * len(points)
    if pairs > _PAIRS:
        from scipy.spatial import cKDTree  # takes a fifth of a second to load

        return np.asarray(cKDTree(points, balanced_tree=False).query(x)[1])
    if pairs <= _FEW:
        return _squares(x, np.ascontiguousarray(points.T)).argmin(-1)
    return _search_boxes(x, points)


def _search_boxes(x: Array, points: Array) -> NDArray[np.intp]:
    """Return the nearest points, looked for only among those in boxes that may hold the nearest one.

    Boxes are around a few neighbours. Rounding is monotone, so that no computed distance is below the computed one of
    the boxes, and the result is that of all distances to the last bit.
    """
    count = -(-len(points) // _POINTS)
    whole = np.concatenate([points, np.repeat(points[-1:], count * _POINTS - len(points), axis=0)])
    boxes = np.ascontiguousarray(whole.T).reshape(points.shape[1], count, _POINTS)
    starts, found = np.arange(0, len(x), _ROWS), np.empty(len(x), dtype=np.intp)
    for start, near in zip(starts.tolist(), _may_be_nearest(x, starts, boxes), strict=True):
        rows, which = slice(start, start + _ROWS), near.nonzero()[0]
        nearest = _squares(x[rows], boxes[:, which].reshape(len(boxes), -1)).argmin(-1)
        found[rows] = which[nearest // _POINTS] * _POINTS + nearest % _POINTS
    return found


def _may_be_nearest(x: Array, starts: Array, boxes: Array) -> NDArray[np.bool_]:
    """Return which boxes (m, b, points) may hold the nearest point of a row of x from each start on, (starts, b)."""
    least, most = np.zeros((2, len(starts), boxes.shape[1]))
    lows, highs = np.minimum.reduceat(x, starts).T[..., None], np.maximum.reduceat(x, starts).T[..., None]
    for low, high, floor, ceiling in zip(lows, highs, boxes.min(-1), boxes.max(-1), strict=True):
        gap = np.maximum(np.maximum(floor - high, low - ceiling), 0.0)
        least += gap * gap
        span = np.maximum(ceiling - low, high - floor)
        most += span * span
    return least <= most.min(-1, keepdims=True)


def _squares(x: Array, columns: Array) -> Array:
    """Return squared distances of x (k, m) and points given by their coordinates (m, t), (k, t)."""
    squares = np.zeros((len(x), columns.shape[1]))
    for own, others in zip(x.T, columns, strict=True):
        away = own[:, None] - others
        squares += away * away
    return squares
