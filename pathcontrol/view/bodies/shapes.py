"""The shapes a scene is made of, in metres, each centred on or given in a frame of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from pathcontrol._arrays import Array


@dataclass(frozen=True, eq=False)
class Box:
    """A box of edge lengths ``size`` [m], shape (3,), centred on the origin."""

    size: Array

    @property
    def bounds(self) -> Array:
        """Lower and upper corner [m], (2, 3)."""
        return np.outer([-0.5, 0.5], self.size)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z, centred on the origin [m]."""

    radius: float
    length: float

    @property
    def bounds(self) -> Array:
        """Lower and upper corner [m], (2, 3)."""
        return np.outer([-1.0, 1.0], [self.radius, self.radius, self.length / 2])


@dataclass(frozen=True)
class Sphere:
    """A sphere centred on the origin [m]."""

    radius: float

    @property
    def bounds(self) -> Array:
        """Lower and upper corner [m], (2, 3)."""
        return np.outer([-1.0, 1.0], np.full(3, self.radius))


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: ``vertices`` [m], (k, 3), and ``faces``, three indices into them each, (m, 3)."""

    vertices: Array
    faces: np.ndarray

    @property
    def bounds(self) -> Array:
        """Lower and upper corner [m], (2, 3)."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])


Shape: TypeAlias = Box | Cylinder | Sphere | Mesh

#: red, green, blue and opacity, each from 0 to 1
Color: TypeAlias = tuple[float, float, float, float]
