"""Tubes for lines: WebGL draws lines one pixel wide, so that a visible path is drawn as a tube."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.body_shapes import Mesh

SIDES = 6


def simplify(points: Array, tolerance: float, most: int = 400) -> Array:
    """Return a polyline through fewer of the points [m], (k, 3), at most ``most`` segments.

    Ramer, Douglas and Peucker's algorithm, the farthest point first: no point is farther than ``tolerance`` [m]
    from the result, if that is within ``most``.
    """
    kept, spans = {0, len(points) - 1}, [_farthest(points, 0, len(points) - 1)]
    while len(kept) <= most:
        away, first, middle, last = heapq.heappop(spans)
        if -away <= tolerance:
            break
        kept.add(middle)
        for span in ((first, middle), (middle, last)):
            heapq.heappush(spans, _farthest(points, *span))
    return points[sorted(kept)]


def tube(points: Array, radius: float, sides: int = SIDES) -> Mesh:
    """Return an open tube of ``radius`` [m] around a polyline of two or more distinct points [m], (k, 3)."""
    normals = _transport_normals(_tangents(points))
    angles = 2 * np.pi * np.arange(sides) / sides
    rings = np.cos(angles)[:, None] * normals[:, 0, None] + np.sin(angles)[:, None] * normals[:, 1, None]
    vertices = points[:, None] + radius * rings
    return Mesh(vertices.reshape(-1, 3), _tube_faces(len(points), sides))


def distinct(points: Array) -> Array:
    """Return the points without those that repeat their predecessor."""
    return points[distinct_rows(points)]


def distinct_rows(points: Array) -> NDArray[np.bool_]:
    """Return which of the points differ from their predecessor, (k,)."""
    return np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=-1) > 1e-9])


def join_meshes(parts: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + offset for part, offset in zip(parts, offsets[:-1], strict=True)]
    return Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def dashes(points: Array, length: float) -> Array:
    """Return every other piece of ``length`` [m] of a polyline, (k, 2, 3), from its first point on."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1))])
    count = max(int(np.round((along[-1] / length - 1) / 2)), 0)
    ends = along[-1] / (2 * count + 1) * np.arange(2 * count + 2)  # begins and ends with a dash
    at = np.stack([np.interp(ends, along, axis) for axis in points.T], axis=-1)
    return at.reshape(-1, 2, 3)


def _farthest(points: Array, first: int, last: int) -> tuple[float, int, int, int]:
    """Return the point of a span farthest from its chord: its distance, negative, and (first, farthest, last)."""
    if last - first < 2:
        return 0.0, first, first, last
    away = _distance(points[first + 1 : last], points[first], points[last])
    farthest = int(away.argmax())
    return -float(away[farthest]), first, first + 1 + farthest, last


def _distance(points: Array, start: Array, end: Array) -> Array:
    """Return the distance of points from the segment between start and end [m], (k,)."""
    along = end - start
    share = np.clip((points - start) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * along, axis=-1)


def _tangents(points: Array) -> Array:
    """Return the unit tangent at each point, (k, 3): the mean of both segments, the later if they are opposite."""
    segments = np.diff(points, axis=0)
    segments /= np.linalg.norm(segments, axis=-1, keepdims=True)
    before, after = np.vstack([segments[:1], segments]), np.vstack([segments, segments[-1:]])
    mean = before + after
    length = np.linalg.norm(mean, axis=-1, keepdims=True)
    return np.where(length > 1e-6, mean / np.maximum(length, 1e-6), after)


def _transport_normals(tangents: Array) -> Array:
    """Return two normals at each point, (k, 2, 3), that turn as little as they can along the line."""
    normals, (x, y, z) = [], np.eye(3)[np.abs(tangents[0]).argmin()].tolist()
    for a, b, c in tangents.tolist():  # numbers one by one: each depends on the one before, and arrays are slow at that
        along = x * a + y * b + z * c
        x, y, z = x - along * a, y - along * b, z - along * c
        length = math.hypot(x, y, z)
        if length < 1e-6:  # the line turned by a right angle into the last normal
            x, y, z = np.cross([a, b, c], np.eye(3)[np.abs([a, b, c]).argmin()]).tolist()
            length = math.hypot(x, y, z)
        x, y, z = x / length, y / length, z / length
        normals.append((x, y, z))
    return np.stack([normals, np.cross(tangents, normals)], axis=1)


def _tube_faces(rings: int, sides: int) -> np.ndarray:
    """Return triangles from ring to ring, in order, so that a tube can be drawn as it grows."""
    ring, side = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    here, beside = ring * sides + side, ring * sides + (side + 1) % sides
    pairs = [[here, beside, beside + sides], [here, beside + sides, here + sides]]
    return np.stack([np.stack(corners, axis=-1) for corners in pairs], axis=2).reshape(-1, 3)
