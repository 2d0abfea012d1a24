"""Arcs of circles, ellipses and helices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array, as_array, finite, readonly, scalar
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.segments import Segment


@dataclass(frozen=True, eq=False)
class Arc(Segment):
    """p(u) = c + cos φ x + sin φ y + u h,  φ = φ₀ + u Δφ.

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
            array = finite(name, as_array(name, getattr(self, name)))
            if array.shape != (3,):
                raise InputError(f"{name} has shape {array.shape}, expected (3,)")
            object.__setattr__(self, name, readonly(array))
        scalar("start", self.start)
        if scalar("sweep", self.sweep) == 0 or not np.linalg.norm(np.cross(self.x, self.y)) > 0:
            raise InputError(f"an arc with x = {self.x}, y = {self.y} and sweep = {self.sweep:g} has no length")

    @property
    def circular(self) -> bool:
        """Whether it is an arc of a circle, or a helix over one."""
        size = float(self.x @ self.x)
        return bool(abs(self.x @ self.y) <= 1e-12 * size and abs(self.y @ self.y - size) <= 1e-12 * size)

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
