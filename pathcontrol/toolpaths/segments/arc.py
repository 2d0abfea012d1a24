"""Arcs of circles, ellipses and helices."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.segments.segment import Segment


@dataclass(frozen=True, eq=False)
class Arc(Segment):
    """An arc p(u) = c + cos φ x + sin φ y + u h, φ = φ₀ + u Δφ, of a circle, an ellipse or a helix.

    With x ⟂ y of the same length it is an arc of a circle, with other vectors one of an ellipse, with h ≠ 0 a helix.

    Attributes:
        center: c [m], (3,).
        x: vector to φ = 0 [m], (3,).
        y: vector to φ = π/2 [m], (3,).
        start: φ₀ [rad].
        sweep: Δφ [rad], not 0.
        rise: h [m], (3,).
    """

    center: Array
    x: Array
    y: Array
    start: float
    sweep: float
    rise: Array = (0.0, 0.0, 0.0)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for name in ("center", "x", "y", "rise"):
            array = check_finite(name, as_array(name, getattr(self, name)))
            if array.shape != (3,):
                raise InputError(f"{name} has shape {array.shape}, expected (3,)", argument=name, value=array)
            object.__setattr__(self, name, freeze(array))
        as_scalar("start", self.start)
        if as_scalar("sweep", self.sweep) == 0 or not _parallelogram(self.x.tolist(), self.y.tolist()) > 0:
            raise InputError(
                f"an arc with x = {self.x}, y = {self.y} and sweep = {self.sweep:g} has no length",
                argument="sweep",
                value=self.sweep,
            )

    @property
    def first(self) -> Array:
        return self._ends[0]

    @property
    def last(self) -> Array:
        return self._ends[1]

    @cached_property
    def _ends(self) -> Array:
        """The first and the last point [m], (2, 3)."""
        return freeze(self.point(np.array([0.0, 1.0])))

    @property
    def circular(self) -> bool:
        """True for an arc of a circle, or a helix over one."""
        size = float(self.x @ self.x)
        return bool(abs(self.x @ self.y) <= 1e-12 * size and abs(self.y @ self.y - size) <= 1e-12 * size)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        # a coordinate cᵢ + Rᵢ cos(φ − αᵢ) + u hᵢ is extreme at an end, or where sin(φ − αᵢ) = hᵢ / (Rᵢ Δφ)
        radius, alpha = np.hypot(self.x, self.y), np.arctan2(self.y, self.x)
        turn = np.arcsin(np.clip(self.rise / np.where(radius > 0, radius, np.inf) / self.sweep, -1.0, 1.0))
        angles = np.stack([alpha + turn, alpha + np.pi - turn])
        low, high = sorted((self.start, self.start + self.sweep))
        first = angles + 2 * np.pi * np.ceil((low - angles) / (2 * np.pi))
        last = angles + 2 * np.pi * np.floor((high - angles) / (2 * np.pi))
        u = (np.concatenate([first, last]).clip(low, high) - self.start) / self.sweep
        points = np.concatenate([np.diagonal(self.point(u), axis1=1, axis2=2), self._ends])
        return points.min(0), points.max(0)

    def distance(self, x: ArrayLike) -> Array:
        if not self.circular or self.rise.any():
            return super().distance(x)
        x = as_array("x", x)
        offset = (x - self.center)[..., None, :]
        angle = np.arctan2((offset * self.y).sum(-1), (offset * self.x).sum(-1))
        u = np.mod((angle - self.start) * np.sign(self.sweep), 2 * np.pi) / abs(self.sweep)
        ends = np.broadcast_to([0.0, 1.0], (*x.shape[:-1], 2))
        nearest = self.point(np.concatenate([np.where(u <= 1, u, 0.0), ends], axis=-1))
        return np.linalg.norm(nearest - x[..., None, :], axis=-1).min(-1)

    def point(self, u: Array) -> Array:
        u = np.asarray(u)[..., None]
        angle = self.start + u * self.sweep
        return self.center + np.cos(angle) * self.x + np.sin(angle) * self.y + u * self.rise

    def derivative(self, u: Array, order: int = 1) -> Array:
        angle = self.start + np.asarray(u)[..., None] * self.sweep
        cos, sin = np.cos(angle), np.sin(angle)
        if order == 1:
            return self.sweep * (cos * self.y - sin * self.x) + self.rise
        return -(self.sweep**2) * (cos * self.x + sin * self.y)

    def placed(self, pose: Array) -> Arc:
        turn = pose[:3, :3]
        center = turn @ self.center + pose[:3, 3]
        return Arc(center, turn @ self.x, turn @ self.y, self.start, self.sweep, turn @ self.rise)

    def reversed(self) -> Arc:
        return Arc(self.center + self.rise, self.x, self.y, self.start + self.sweep, -self.sweep, -self.rise)


def _parallelogram(x: list[float], y: list[float]) -> float:
    """Return the area that two vectors span, ‖x × y‖; for three numbers this is faster without NumPy."""
    return math.hypot(x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
