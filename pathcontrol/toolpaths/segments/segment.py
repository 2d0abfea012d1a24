"""The base class of the segments of a contour, and the polyline."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from pathcontrol._arrays import Array, as_array, check_finite, freeze
from pathcontrol.errors import InputError
from pathcontrol.geometry.arc_length import ArcLength
from pathcontrol.geometry.box_hierarchy import BoxHierarchy
from pathcontrol.geometry.closest_point import ClosestPoint, Curve

SAME_POINT = 1e-9  # m, points nearer than this are one
_SAMPLES = 1025
_SHORTEST = 1e-10  # m, edges up to this have no direction to rely on


class Segment(ABC):
    """A regular curve p(u) in space [m], u ∈ [0, 1]: a piece of a contour between two of its junctions."""

    @abstractmethod
    def point(self, u: Array) -> Array:
        """Return p(u) [m], (*batch, 3)."""

    @abstractmethod
    def derivative(self, u: Array, order: int = 1) -> Array:
        """Return dp/du or d²p/du² [m], (*batch, 3)."""

    @abstractmethod
    def placed(self, pose: Array) -> Segment:
        """Return the segment moved by a homogeneous transform (4, 4)."""

    @abstractmethod
    def reversed(self) -> Segment:
        """Return the same points from the end to the start."""

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

    @cached_property
    def arc_length(self) -> ArcLength:
        """The arc length as a function of u, and its inverse."""
        return ArcLength(self.derivative, 0.0, 1.0, cusps=True)

    @cached_property
    def length(self) -> float:
        """Arc length [m]."""
        return self.arc_length.total

    def distance(self, x: ArrayLike) -> Array:
        """Return the distance from points x (*batch, 3) to the segment [m], (*batch,)."""
        x = as_array("x", x)
        return np.linalg.norm(self.point(self._closest_point(x)) - x, axis=-1)

    def _least(self, sign: float) -> Array:
        """Return the least value of each coordinate times ``sign`` [m], (3,), searched in samples and between them."""
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
    """A polyline through points (k + 1, 3) [m]; u is proportional to the arc length.

    Raises:
        InputError: fewer than two points, values that are not finite, or an edge no longer than 0.1 nm.
    """

    points: Array

    def __post_init__(self) -> None:
        points = check_finite("points", as_array("points", self.points))
        if points.ndim != 2 or points.shape[1:] != (3,) or len(points) < 2:
            raise InputError(
                f"points have shape {points.shape}, expected (k, 3) with at least 2 points",
                argument="points",
                value=points,
            )
        object.__setattr__(self, "points", freeze(points))
        if (self.edges <= _SHORTEST).any():
            i = int(np.argmin(self.edges))
            raise InputError(
                f"points {i} and {i + 1} are the same, {points[i].tolist()}; leave one of them out",
                argument="points",
                value=points[i],
            )

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

    @cached_property
    def length(self) -> float:
        return float(self.stations[-1])

    @cached_property
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
        rows = np.flatnonzero(np.isfinite(flat).all(-1))
        best = np.full(len(flat), np.nan)
        near = self._tree.query(flat[rows])[1]
        best[rows] = np.minimum(
            self._to_edges(flat[rows], np.minimum(near, len(self.edges) - 1)),
            self._to_edges(flat[rows], np.maximum(near - 1, 0)),
        )
        for row, edge in self._boxes.nearer(flat, best):
            np.minimum.at(best, row, self._to_edges(flat[row], edge))
        return best.reshape(x.shape[:-1])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    @cached_property
    def _boxes(self) -> BoxHierarchy:
        start, end = self.points[:-1], self.points[1:]
        return BoxHierarchy(np.minimum(start, end), np.maximum(start, end))

    def _to_edges(self, x: Array, edge: Array) -> Array:
        """Return the distance from each x (N, 3) to the edge of the index ``edge`` (N,) [m]."""
        offset, direction = x - self.points[edge], self.directions[edge]
        along = np.clip((offset * direction).sum(-1), 0.0, self.edges[edge])
        return np.linalg.norm(offset - along[:, None] * direction, axis=-1)

    def _locate(self, u: Array) -> tuple[Array, Array]:
        """Return the edge that u lies on, and the length along it [m]."""
        s = np.asarray(u) * self.length
        edge = np.clip(np.searchsorted(self.stations, s, side="right") - 1, 0, len(self.edges) - 1)
        return edge, s - self.stations[edge]
