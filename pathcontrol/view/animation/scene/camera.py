"""The camera: it looks at the plane in which the tool moves, from its free side, a little from above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.body_shapes import outermost

LOWEST, HIGHEST = np.deg2rad([22.0, 42.0])
ASIDE = np.deg2rad(20.0)
LEGEND = 0.1  # room below, as a share of the visible height
SMALLEST, SMALL = 1e-4, 0.4  # shares of the picture: size of a point, and size below which there is a near view
LINE_WIDTH = 0.003  # radius of lines in the view from near, of the size of its picture
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Camera:
    """A view that shows the whole scene, in a window of any shape.

    Attributes:
        target: middle of the picture in the base frame [m], (3,).
        direction: unit vector from the target to the eye, (3,).
        outline: the outermost of what is to be seen, from the target, in the axes of the picture [m], (k, 3).
    """

    target: Array
    direction: Array
    outline: Array

    @classmethod
    def framing(cls, points: Array, direction: Array) -> Camera:
        """Return the view from ``direction`` that shows all points [m], (k, 3), above the legend."""
        axes = picture_axes(direction)
        seen = points @ axes.T
        lower, upper = seen.min(axis=0), seen.max(axis=0)
        lower[1] -= LEGEND * (upper[1] - lower[1])
        middle = (lower + upper) / 2
        bottom = [0.0, lower[1] - middle[1], 0.0]
        return cls(middle @ axes, axes[2], np.vstack([seen[outermost(seen, 200)] - middle, bottom]))

    @property
    def size(self) -> float:
        """The larger of width and height of the visible region [m]."""
        return float(np.ptp(self.outline[:, :2], axis=0).max())

    def header(self) -> dict[str, Any]:
        """Return the view for the header of a film."""
        return {name: getattr(self, name).tolist() for name in ("target", "direction", "outline")}

    def seen_from_near(self, near: Camera, width: float) -> dict[str, Any]:
        """Return the view and a near one, if that shows small details, with lines of a ``width`` [m] made as thin."""
        if not SMALLEST < near.size / self.size < SMALL:
            return self.header()
        return self.header() | {"near": near.header() | {"thickness": min(LINE_WIDTH * near.size / width, 1.0)}}


def picture_axes(direction: Array) -> Array:
    """Return rows right, up and towards the eye, unit vectors in the base frame, (3, 3); z is up in the picture."""
    right = np.cross(_UP, direction)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(direction, right), direction])


def view_direction(path: Array, scene: Array) -> Array:
    """Return the unit vector towards an eye that sees the tool's path well, (3,).

    It is normal to the plane that fits the path best (the least principal axis), on the side of the path that
    the arm is not, then raised to an elevation from 22° to 42° and turned aside by 20°, which shows depth.

    Args:
        path: points of the tool's path [m], (k, 3).
        scene: points of the arm [m], (k, 3).
    """
    normal = _normal(path - path.mean(axis=0))
    free_side = path.mean(axis=0) - (scene.min(axis=0) + scene.max(axis=0)) / 2
    if normal @ free_side < 0:
        normal = -normal
    if np.hypot(*normal[:2]) < 0.3:  # a path in a horizontal plane is seen from outside
        outwards = free_side if np.hypot(*free_side[:2]) > 1e-6 else np.array([1.0, -1.0, 0.0])
        normal = np.array([*outwards[:2] / np.hypot(*outwards[:2]) * 0.3, 1.0])
    azimuth = np.arctan2(normal[1], normal[0]) + ASIDE
    elevation = np.clip(np.arctan2(normal[2], np.hypot(*normal[:2])), LOWEST, HIGHEST)
    return np.array([*(np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])), np.sin(elevation)])


def _normal(centred: Array) -> Array:
    """Return the least principal axis of a cloud; for a straight line the horizontal direction across it."""
    _, spread, axes = np.linalg.svd(centred, full_matrices=False) if len(centred) >= 3 else (0, np.zeros(3), np.eye(3))
    if spread[1] > 1e-3 * spread[0]:
        return axes[2]
    across = np.cross(_UP, axes[0])
    length = np.linalg.norm(across)
    return across / length if length > 1e-3 else np.array([0.0, -1.0, 0.0])
