"""The ground z = 0 of the base frame, as a round patch of grid under the scene."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array

CELLS = 8  # at least so many, and at most 2.5 times as many, from the middle to the rim
_STEPS = np.array([1.0, 0.5, 0.2, 0.1])


def ground_grid(points: Array) -> Array:
    """Return grid lines [m], (k, 2, 3), one segment for each side of a cell, under and around points (m, 3)."""
    lower, upper = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    radius = max(0.8 * float(np.linalg.norm(upper - lower)), 1e-3)
    pitch = _pitch(radius)
    middle = np.round((lower + upper) / 2 / pitch) * pitch
    steps = pitch * np.arange(-np.ceil(radius / pitch), np.ceil(radius / pitch) + 1)
    along, across = (a.reshape(-1) for a in np.meshgrid(steps[:-1], steps))
    segments = np.zeros((2, len(along), 2, 3))
    for direction in range(2):
        segments[direction, :, :, direction] = np.stack([along, along + pitch], axis=-1)
        segments[direction, :, :, 1 - direction] = across[:, None]
    inside = (np.linalg.norm(segments, axis=-1) <= radius).all(axis=-1)
    return segments[inside] + np.append(middle, 0.0)


def _pitch(radius: float) -> float:
    """Return the coarsest of …, 0.1, 0.2, 0.5, 1, 2, … m that gives enough cells."""
    power = 10.0 ** np.ceil(np.log10(radius / CELLS))
    return float(power * _STEPS[power * _STEPS <= radius / CELLS * (1 + 1e-9)][0])
