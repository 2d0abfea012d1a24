"""The nearest of many points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array

_PAIRS = 20_000_000  # up to which all distances take less time than loading the search tree
_BLOCK = 20_000  # pairs at once: they stay in the cache of a core


def nearest_rows(x: Array, points: Array) -> NDArray[np.intp]:
    """Return the index of the nearest of some ``points`` (t, m) to each of x (k, m), (k,)."""
    if len(x) * len(points) > _PAIRS:
        from scipy.spatial import cKDTree  # takes a fifth of a second to load

        return np.asarray(cKDTree(points, balanced_tree=False).query(x)[1])
    count = max(1, _BLOCK // len(points))
    columns = np.ascontiguousarray(points.T)
    return np.concatenate([_squares(x[k : k + count], columns).argmin(-1) for k in range(0, len(x), count)])


def _squares(x: Array, columns: Array) -> Array:
    """Return squared distances of x (k, m) and points given by their coordinates (m, t), (k, t)."""
    squares = np.zeros((len(x), columns.shape[1]))
    for own, others in zip(x.T, columns, strict=True):
        away = own[:, None] - others
        squares += away * away
    return squares
