"""A bounding-volume hierarchy over consecutive items, to find those that may lie closer than a given distance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pathcontrol._arrays import Array

_BRANCHES = 8
_PAIRS = 1 << 19  # of points and boxes, looked at at once


class BoxHierarchy:
    """A hierarchy of bounding boxes: of the items, of eight consecutive boxes each, and so on up to a few at the top.

    Args:
        lower: lower corners of the boxes of the things [m], (k, 3).
        upper: upper corners, (k, 3).
    """

    def __init__(self, lower: Array, upper: Array) -> None:
        self._levels = [(lower, upper)]
        while len(lower) > _BRANCHES:
            first = np.arange(0, len(lower), _BRANCHES)
            lower, upper = np.minimum.reduceat(lower, first), np.maximum.reduceat(upper, first)
            self._levels.append((lower, upper))

    def nearer(self, x: Array, bound: Array) -> Iterator[tuple[Array, Array]]:
        """Yield pairs of a row of x (N, 3) and an item whose box is nearer to it than ``bound`` (N,) [m], in blocks.

        The bound may be lowered between them.
        """
        rows = np.flatnonzero(bound > 0)
        count = len(self._levels[-1][0])
        stack = [(len(self._levels) - 1, part, np.zeros(len(part), dtype=int)) for part in _split(rows, count)]
        while stack:
            level, row, group = stack.pop()
            lower, upper = self._levels[level]
            row, box = np.repeat(row, _BRANCHES), (group[:, None] * _BRANCHES + np.arange(_BRANCHES)).reshape(-1)
            row, box = row[box < len(lower)], box[box < len(lower)]
            here = x[row]
            outside = np.maximum(np.maximum(lower[box] - here, here - upper[box]), 0.0)
            near = (outside * outside).sum(-1) < bound[row] ** 2
            row, box = row[near], box[near]
            if level == 0:
                yield row, box
            else:
                stack += [(level - 1, row[part], box[part]) for part in _split(np.arange(len(row)), _BRANCHES)]


def _split(index: Array, count: int) -> list[Array]:
    """Split ``index`` into parts that make a bounded number of pairs each."""
    return np.array_split(index, len(index) * count // _PAIRS + 1)
