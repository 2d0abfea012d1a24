"""Knots of a spline and the points between them."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array

_GRADING = 3.0  # largest ratio of neighbouring intervals; interpolation by quintic splines is unstable far above it


def first_mesh(knots: Array, longest: float) -> Array:
    """The knots of a curve with intervals of at most ``longest``, and graded."""
    pieces = np.maximum(1, np.ceil(np.diff(knots) / longest - 1e-9)).astype(int)
    return graded(subdivided(knots, pieces))


def subdivided(mesh: Array, pieces: Array) -> Array:
    """The mesh (K,) with each of its intervals cut into as many equal ``pieces`` (K − 1,)."""
    left, step = np.repeat(mesh[:-1], pieces), np.repeat(np.diff(mesh) / pieces, pieces)
    rank = np.arange(len(left)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(left + rank * step, mesh[-1])


def graded(mesh: Array) -> Array:
    """The mesh with intervals halved until none is much longer than its neighbour."""
    while True:
        steps = np.diff(mesh)
        beside = np.minimum(np.append(steps[1:], np.inf), np.append(np.inf, steps[:-1]))
        coarse = steps > _GRADING * beside
        if not coarse.any():
            return mesh
        mesh = subdivided(mesh, 1 + coarse)


def between(mesh: Array, fractions: Array) -> Array:
    """Points at ``fractions`` (k,) of each interval, (K − 1, k)."""
    return mesh[:-1, None] + np.diff(mesh)[:, None] * fractions
