"""The shapes of a scene, in metres, each in a frame of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array


def directions(count: int) -> Array:
    """Return evenly spread unit vectors, (count, 3), on a golden spiral."""
    height = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * np.sqrt(1 - height**2)[:, None]
    return np.column_stack([circle, height])


def outermost(points: Array, count: int) -> NDArray[np.intp]:
    """Return the indices of those points (k, 3) that are farthest out in some of ``count`` directions, in order."""
    columns = np.ascontiguousarray(points.T)
    return np.unique([(direction @ columns).argmax() for direction in directions(count)])


_OUTLINE = 60  # points of an outline, at most


@dataclass(frozen=True, eq=False)
class Box:
    """A box of edge lengths ``size`` [m], shape (3,), centred on the origin."""

    size: Array

    @property
    def bounds(self) -> Array:
        """The lower and upper corner [m], (2, 3)."""
        return np.outer([-0.5, 0.5], self.size)

    @property
    def outline(self) -> Array:
        """The corners [m], (8, 3)."""
        return np.stack(np.meshgrid(*self.bounds.T), axis=-1).reshape(8, 3)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z, centred on the origin [m]."""

    radius: float
    length: float

    @property
    def bounds(self) -> Array:
        """The lower and upper corner [m], (2, 3)."""
        return np.outer([-1.0, 1.0], [self.radius, self.radius, self.length / 2])

    @property
    def outline(self) -> Array:
        """The points of both rims [m], (32, 3)."""
        angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        rim = self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.concatenate([np.insert(rim, 2, end, axis=1) for end in (-self.length / 2, self.length / 2)])


@dataclass(frozen=True)
class Sphere:
    """A sphere centred on the origin [m]."""

    radius: float

    @property
    def bounds(self) -> Array:
        """The lower and upper corner [m], (2, 3)."""
        return np.outer([-1.0, 1.0], np.full(3, self.radius))

    @property
    def outline(self) -> Array:
        """Points all over the sphere [m], (k, 3)."""
        return self.radius * directions(_OUTLINE)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: ``vertices`` [m], (k, 3), and ``faces``, three indices into them each, (m, 3)."""

    vertices: Array
    faces: np.ndarray

    @property
    def bounds(self) -> Array:
        """The lower and upper corner [m], (2, 3)."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def outline(self) -> Array:
        """The outermost vertices [m], (k, 3)."""
        return self.vertices[outermost(self.vertices, _OUTLINE)]


Shape: TypeAlias = Box | Cylinder | Sphere | Mesh

#: red, green, blue and opacity, each from 0 to 1
Color: TypeAlias = tuple[float, float, float, float]
