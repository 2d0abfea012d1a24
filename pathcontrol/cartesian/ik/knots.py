"""Meshes of knots of a spline: graded, refined, and points in between."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array

_GRADING = 3.0  # largest ratio of neighbouring intervals; interpolation by quintic splines is unstable far above it


def first_mesh(knots: Array, longest: float) -> Array:
    """Return the knots of a curve, graded, with intervals of at most ``longest``."""
    pieces = np.maximum(1, np.ceil(np.diff(knots) / longest - 1e-9)).astype(int)
    return grade(subdivide(knots, pieces))


def subdivide(mesh: Array, pieces: Array) -> Array:
    """Cut each interval of a mesh (K,) into equal ``pieces`` (K − 1,)."""
    left, step = np.repeat(mesh[:-1], pieces), np.repeat(np.diff(mesh) / pieces, pieces)
    rank = np.arange(len(left)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(left + rank * step, mesh[-1])


def grade(mesh: Array) -> Array:
    """Halve intervals of a mesh until none is much longer than its neighbour."""
    while True:
        steps = np.diff(mesh)
        beside = np.minimum(np.append(steps[1:], np.inf), np.append(np.inf, steps[:-1]))
        coarse = steps > _GRADING * beside
        if not coarse.any():
            return mesh
        mesh = subdivide(mesh, 1 + coarse)


def points_between(mesh: Array, fractions: Array) -> Array:
    """Return the points at ``fractions`` (k,) of each interval, (K − 1, k)."""
    return mesh[:-1, None] + np.diff(mesh)[:, None] * fractions
