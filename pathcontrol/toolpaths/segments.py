"""Pieces of a contour: what a segment is, and the polyline."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from pathcontrol._arrays import Array, as_array, finite, readonly
from pathcontrol.errors import InputError
from pathcontrol.tasks.closest_point import ClosestPoint, Curve
from pathcontrol.toolpaths.lengths import ArcLength

_SAMPLES = 1025
_PAIRS = 1 << 21  # point-edge pairs held at once


class Segment(ABC):
    """A regular curve p(u) in space [m], u ∈ [0, 1]: a piece of a contour between two of its junctions."""

    @abstractmethod
    def point(self, u: Array) -> Array:
        """p(u) [m], (*batch, 3)."""

    @abstractmethod
    def derivative(self, u: Array, order: int = 1) -> Array:
        """dp/du or d²p/du² [m], (*batch, 3)."""

    @abstractmethod
    def placed(self, pose: Array) -> Segment:
        """The segment moved by a homogeneous transform (4, 4)."""

    @abstractmethod
    def reversed(self) -> Segment:
        """The same points from the end to the start."""

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of the bounding box [m], each (3,), up to a billionth of the segment's size."""
        return self._least(1.0), -self._least(-1.0)

    def speed(self, u: Array) -> Array:
        """‖dp/du‖ [m], (*batch,)."""
        return np.linalg.norm(self.derivative(u), axis=-1)

    @cached_property
    def arc_length(self) -> ArcLength:
        """Arc length as a function of u, which it is inverted from."""
        return ArcLength(self.speed)

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return self.arc_length.total

    def distance(self, x: ArrayLike) -> Array:
        """Distance from points x (*batch, 3) to the segment [m], (*batch,)."""
        x = as_array("x", x)
        return np.linalg.norm(self.point(self._closest_point(x)) - x, axis=-1)

    def _least(self, sign: float) -> Array:
        """Least value of each coordinate times ``sign`` [m], (3,): at samples, and again between those next to them."""
        u = np.linspace(0.0, 1.0, _SAMPLES)
        near = u[(sign * self.point(u)).argmin(0)]
        finer = np.clip(near + np.linspace(-1.0, 1.0, 129)[:, None] / (_SAMPLES - 1), 0.0, 1.0)
        return (sign * np.diagonal(self.point(finer), axis1=1, axis2=2)).min(0)

    @cached_property
    def _closest_point(self) -> ClosestPoint:
        curve = Curve(self.point, self.derivative, lambda u: self.derivative(u, 2))
        return ClosestPoint(curve, 0.0, 1.0, closed=False)


@dataclass(frozen=True, eq=False)
class Polyline(Segment):
    """Straight edges through points (k + 1, 3) [m]; u runs in proportion to the arc length.

    Raises:
        InputError: fewer than two points, values that are not finite, or an edge of no length.
    """

    points: Array

    def __post_init__(self) -> None:
        points = finite("points", as_array("points", self.points))
        if points.ndim != 2 or points.shape[1:] != (3,) or len(points) < 2:
            raise InputError(f"points have shape {points.shape}, expected (k, 3) with at least 2 points")
        object.__setattr__(self, "points", readonly(points))
        if (self.edges == 0).any():
            i = int(np.argmin(self.edges))
            raise InputError(f"points {i} and {i + 1} are the same, {points[i].tolist()}; leave one of them out")

    @cached_property
    def edges(self) -> Array:
        """Length of each edge [m], (k,)."""
        return np.linalg.norm(np.diff(self.points, axis=0), axis=-1)

    @cached_property
    def directions(self) -> Array:
        """Unit vector along each edge, (k, 3)."""
        return np.diff(self.points, axis=0) / self.edges[:, None]

    @cached_property
    def stations(self) -> Array:
        """Arc length at each point [m], (k + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.edges)])

    @property
    def length(self) -> float:
        return float(self.stations[-1])

    @property
    def bounds(self) -> tuple[Array, Array]:
        return self.points.min(0), self.points.max(0)

    def point(self, u: Array) -> Array:
        edge, along = self._locate(u)
        return self.points[edge] + along[..., None] * self.directions[edge]

    def derivative(self, u: Array, order: int = 1) -> Array:
        edge, _ = self._locate(u)
        return self.length * self.directions[edge] if order == 1 else np.zeros((*edge.shape, 3))

    def placed(self, pose: Array) -> Polyline:
        return Polyline(self.points @ pose[:3, :3].T + pose[:3, 3])

    def reversed(self) -> Polyline:
        return Polyline(self.points[::-1])

    def distance(self, x: ArrayLike) -> Array:
        x = as_array("x", x)
        flat = x.reshape(-1, 3)
        start, step = self._pieces
        tree, half = self._tree
        near = tree.query(flat)[1] if len(flat) else np.empty(0, dtype=int)
        best = _to_edges(flat, start[near], step[near])
        for rows in np.array_split(np.arange(len(flat)), max(1, len(flat) // 1024)):
            found = tree.query_ball_point(flat[rows], best[rows] + half, return_sorted=False)
            _improve(best, rows, found, flat, start, step)
        return best.reshape(x.shape[:-1])

    @cached_property
    def _pieces(self) -> tuple[Array, Array]:
        """The edges cut into pieces of similar length, at most twice as many as edges: starts and steps."""
        parts = np.maximum(1, np.ceil(self.edges * max(64, len(self.edges)) / self.length)).astype(int)
        edge = np.repeat(np.arange(len(parts)), parts)
        rank = np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)
        step = np.diff(self.points, axis=0)[edge] / parts[edge, None]
        return self.points[edge] + rank[:, None] * step, step

    @cached_property
    def _tree(self) -> tuple[cKDTree, float]:
        start, step = self._pieces
        return cKDTree(start + 0.5 * step), 0.5 * float(np.linalg.norm(step, axis=-1).max())

    def _locate(self, u: Array) -> tuple[Array, Array]:
        """The edge that u lies on, and how far along it [m]."""
        s = np.asarray(u) * self.length
        edge = np.clip(np.searchsorted(self.stations, s, side="right") - 1, 0, len(self.edges) - 1)
        return edge, s - self.stations[edge]


def _to_edges(x: Array, start: Array, step: Array) -> Array:
    """Distance from each x (N, 3) to the edge from start (N, 3) to start + step."""
    along = ((x - start) * step).sum(-1) / (step * step).sum(-1)
    return np.linalg.norm(x - start - np.clip(along, 0.0, 1.0)[:, None] * step, axis=-1)


def _improve(best: Array, rows: Array, found: Array, x: Array, start: Array, step: Array) -> None:
    """Lower ``best`` at ``rows`` to the distance to the nearest of the pieces ``found`` for each."""
    counts = np.array([len(f) for f in found])
    for block in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(np.cumsum(counts) // _PAIRS)) + 1):
        row = np.repeat(rows[block], counts[block])
        if row.size:
            piece = np.concatenate([np.asarray(found[i], dtype=int) for i in block])
            np.minimum.at(best, row, _to_edges(x[row], start[piece], step[piece]))
