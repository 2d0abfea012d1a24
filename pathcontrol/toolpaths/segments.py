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
_PIECES = 16  # times as many as edges
_NEAREST = 4  # pieces looked at first
_PAIRS = 1 << 20  # of points and pieces, held at once


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

    @property
    def first(self) -> Array:
        """First point [m], (3,)."""
        return self.point(np.array(0.0))

    @property
    def last(self) -> Array:
        """Last point [m], (3,)."""
        return self.point(np.array(1.0))

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

    @property
    def first(self) -> Array:
        return self.points[0]

    @property
    def last(self) -> Array:
        return self.points[-1]

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
        best, count = np.full(len(flat), np.nan), _NEAREST
        rows = np.flatnonzero(np.isfinite(flat).all(-1))
        while rows.size:
            blocks = np.array_split(rows, rows.size * count // _PAIRS + 1)
            rows = np.concatenate([self._look(best, block, flat[block], count) for block in blocks])
            count *= 4
        return best.reshape(x.shape[:-1])

    def _look(self, best: Array, rows: Array, x: Array, count: int) -> Array:
        """Write the distance to the ``count`` nearest pieces to ``best``; the rows where another may be nearer."""
        (start, step), (tree, half) = self._pieces, self._tree
        count = min(count, len(start))
        away, piece = tree.query(x, np.arange(1, count + 1))
        offset, step = x[:, None] - start[piece], step[piece]
        share = np.clip((offset * step).sum(-1) / (step * step).sum(-1), 0.0, 1.0)
        best[rows] = np.linalg.norm(offset - share[..., None] * step, axis=-1).min(-1)
        return rows[away[:, -1] < best[rows] + half] if count < len(start) else rows[:0]

    @cached_property
    def _pieces(self) -> tuple[Array, Array]:
        """The edges cut into pieces of similar length: starts and steps."""
        most = _PIECES * max(64, len(self.edges))
        parts = np.ceil(self.edges * (most / self.length)).astype(int)
        edge = np.repeat(np.arange(len(parts)), parts)
        rank = np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)
        step = np.diff(self.points, axis=0)[edge] / parts[edge, None]
        return self.points[edge] + rank[:, None] * step, step

    @cached_property
    def _tree(self) -> tuple[cKDTree, float]:
        """The middles of the pieces, and half the length of the longest [m]."""
        start, step = self._pieces
        return cKDTree(start + 0.5 * step), 0.5 * float(np.linalg.norm(step, axis=-1).max())

    def _locate(self, u: Array) -> tuple[Array, Array]:
        """The edge that u lies on, and how far along it [m]."""
        s = np.asarray(u) * self.length
        edge = np.clip(np.searchsorted(self.stations, s, side="right") - 1, 0, len(self.edges) - 1)
        return edge, s - self.stations[edge]
