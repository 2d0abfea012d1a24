"""Rigid bodies as numbers: mass, centre of mass and inertia."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array

SLENDERNESS = 0.15  # radius of a rod, of its length
SMALLEST = 0.03  # m, least radius of a rod


class Lump(NamedTuple):
    """A rigid body: its mass [kg], centre of mass [m], (3,), and inertia about that [kg m²], (3, 3)."""

    mass: float
    com: Array
    inertia: Array


def combine(lumps: Iterable[Lump]) -> Lump:
    """Combine bodies that are rigidly attached to each other into one, by the parallel axis theorem."""
    parts = list(lumps)
    mass = sum(part.mass for part in parts)
    com = np.sum([part.mass * part.com for part in parts], axis=0) / mass
    return Lump(mass, com, np.sum([part.inertia + _steiner(part.mass, part.com - com) for part in parts], axis=0))


def ball(mass: float, radius: float) -> Lump:
    """Return a solid ball about the origin: I = 2/5 m r²."""
    return Lump(mass, np.zeros(3), 0.4 * mass * radius**2 * np.eye(3))


def rod(mass: float, end: Array) -> Lump:
    """Return a solid cylinder from the origin to ``end`` [m], (3,), or a ball of its radius if the end is nearer.

    Along its axis I = m r²/2, across it m (3 r² + l²)/12.
    """
    length = float(np.linalg.norm(end))
    radius = max(SLENDERNESS * length, SMALLEST)
    if length < radius:
        return ball(mass, radius)
    axis = end / length
    across, along = mass * (3 * radius**2 + length**2) / 12, mass * radius**2 / 2
    return Lump(mass, end / 2, across * np.eye(3) + (along - across) * np.outer(axis, axis))


def _steiner(mass: float, arm: Array) -> Array:
    """Return the term m (aᵀa I − a aᵀ) of the parallel axis theorem for an offset a."""
    return mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
