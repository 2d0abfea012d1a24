"""Detection of edges that a drawing has twice, which the tool would cut twice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import comb

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline, Segment

_GRID = 1e-7  # m, points in one cell of it are the same
_OFFSET = 0.3127  # of a cell, so that round coordinates lie inside cells
_MIX = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)


def note_doubled(contours: Sequence[Contour], passed: Notes) -> None:
    """Note the edges, arcs and curves that were drawn before, in either direction."""
    owners, marks = [], []
    for of, first, middle, last in _features(contours):
        owners.append(of)
        marks.append(_hash(_hash(first) + _hash(last), middle))
    owner, mark = np.concatenate(owners), np.concatenate(marks)
    order = np.argsort(owner, kind="stable")
    _, drawn_first = np.unique(mark[order], return_index=True)
    again = np.delete(owner[order], drawn_first)
    for index in again.tolist():
        passed.pass_over("an edge that was drawn before, and is cut again,", contours[index].name, "was found")


def _features(contours: Sequence[Contour]) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Yield for each kind of edge the contours (k,), and the first, middle and last points, each (k, 3)."""
    others: dict[int, list[tuple[int, Segment]]] = {}
    for index, contour in enumerate(contours):
        for segment in contour.segments:
            if isinstance(segment, Polyline):
                first, last = segment.points[:-1], segment.points[1:]
                yield np.full(len(first), index), first, 0.5 * (first + last), last
            else:
                kind = len(segment.points) if isinstance(segment, Bezier) and segment.weights is None else 0
                others.setdefault(kind, []).append((index, segment))
    for kind, found in others.items():
        owner = np.array([index for index, _ in found])
        if kind:
            points = np.array([segment.points for _, segment in found])  # type: ignore[attr-defined]
            middle = np.einsum("i,kic->kc", comb(kind - 1, np.arange(kind)) / 2.0 ** (kind - 1), points)
            yield owner, points[:, 0], middle, points[:, -1]
        else:
            points = np.array([_three_points(segment) for _, segment in found])
            yield owner, points[:, 0], points[:, 1], points[:, 2]


def _three_points(segment: Segment) -> Array:
    """Return first, middle and last point (3, 3); those of a whole circle do not depend on its start."""
    if isinstance(segment, Arc) and segment.circular and abs(abs(segment.sweep) - 2 * np.pi) < 1e-9:
        on = segment.center + np.linalg.norm(segment.x) * np.array([1.0, 0.0, 0.0])
        return np.stack([on, segment.center, on])
    return segment.point(np.array([0.0, 0.5, 1.0]))


def _hash(points: Array, middle: Array | None = None) -> Array:
    """Mix the cells of points (k, 3), or numbers (k,) and the cells of points, into numbers (k,)."""
    if middle is not None:
        return points * _MIX[0] ^ _hash(middle)
    cells = np.floor(points / _GRID + _OFFSET).astype(np.int64).astype(np.uint64)
    mixed = (cells * _MIX).sum(-1, dtype=np.uint64)
    mixed ^= mixed >> np.uint64(31)
    return mixed * _MIX[1]
