"""Lines thick enough to see: WebGL draws lines one pixel wide, so a path is drawn as a tube."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.shapes import Mesh


def simplified(points: Array, tolerance: float, most: int = 400) -> Array:
    """A polyline through fewer of the points [m], (k, 3), at most ``most`` segments.

    Ramer, Douglas and Peucker's algorithm: no point is farther than ``tolerance`` [m] from the result. The
    tolerance grows if that is what it takes to stay within ``most``.
    """
    while np.count_nonzero(kept := _outline(points, tolerance)) > most + 1:
        tolerance *= 1.5
    return points[kept]


def tube(points: Array, radius: float, sides: int = 6) -> Mesh:
    """An open tube of ``radius`` [m] around a polyline of two or more distinct points [m], (k, 3)."""
    normals = _transported(_tangents(points))
    angles = 2 * np.pi * np.arange(sides) / sides
    rings = np.cos(angles)[:, None] * normals[:, 0, None] + np.sin(angles)[:, None] * normals[:, 1, None]
    vertices = points[:, None] + radius * rings
    return Mesh(vertices.reshape(-1, 3), _tube_faces(len(points), sides))


def distinct(points: Array) -> Array:
    """The points without those that repeat their predecessor."""
    moved = np.linalg.norm(np.diff(points, axis=0), axis=-1) > 1e-9
    return points[np.concatenate([[True], moved])]


def _outline(points: Array, tolerance: float) -> np.ndarray:
    """Which points stay, (k,) bool."""
    kept = np.zeros(len(points), dtype=bool)
    kept[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        away = _distance(points[first + 1 : last], points[first], points[last])
        farthest = int(away.argmax())
        if away[farthest] > tolerance:
            middle = first + 1 + farthest
            kept[middle] = True
            spans += [(first, middle), (middle, last)]
    return kept


def _distance(points: Array, start: Array, end: Array) -> Array:
    """Distance of points from the segment between start and end [m], (k,)."""
    along = end - start
    share = np.clip((points - start) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * along, axis=-1)


def _tangents(points: Array) -> Array:
    """Unit tangent at each point, (k, 3): the mean of both segments, the later if they are opposite."""
    segments = np.diff(points, axis=0)
    segments /= np.linalg.norm(segments, axis=-1, keepdims=True)
    before, after = np.vstack([segments[:1], segments]), np.vstack([segments, segments[-1:]])
    mean = before + after
    length = np.linalg.norm(mean, axis=-1, keepdims=True)
    return np.where(length > 1e-6, mean / np.maximum(length, 1e-6), after)


def _transported(tangents: Array) -> Array:
    """Two normals at each point, (k, 2, 3), that turn as little as they can along the line."""
    normals = np.empty((len(tangents), 2, 3))
    normal = np.eye(3)[np.abs(tangents[0]).argmin()]
    for i, tangent in enumerate(tangents):
        flat = normal - (normal @ tangent) * tangent
        if flat @ flat < 1e-12:  # the line turned by a right angle into the last normal
            flat = np.cross(tangent, np.eye(3)[np.abs(tangent).argmin()])
        normal = flat / np.linalg.norm(flat)
        normals[i] = normal, np.cross(tangent, normal)
    return normals


def _tube_faces(rings: int, sides: int) -> np.ndarray:
    ring, side = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    here, beside = ring * sides + side, ring * sides + (side + 1) % sides
    pairs = [[here, beside, beside + sides], [here, beside + sides, here + sides]]
    return np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in pairs])
