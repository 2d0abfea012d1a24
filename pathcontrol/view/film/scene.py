"""A Meshcat scene without a server: the commands are kept, to be played back by a page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import meshcat
import meshcat.animation as animation
import meshcat.geometry as meshes
import numpy as np
import umsgpack

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.shapes import Box, Color, Cylinder, Shape, Sphere
from pathcontrol.view.film.motion import Track

_SKY, _GROUND = [0.99, 0.99, 1.0], [0.86, 0.88, 0.90]
_BACK, _BOTH = 1, 2  # three.js: which side of a triangle is drawn
# three.js has cylinders along y, URDF along z
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


class Scene:
    """Objects in the base frame, z up [m], and how they move.

    Objects are named by ``"group/name"`` paths; a pose belongs to a name, and what is below moves with it.

    Attributes:
        commands: what Meshcat is told, in order, each a MessagePack map.
    """

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self._root = meshcat.Visualizer(window=self)
        self._root["/Background"].set_property("top_color", _SKY)
        self._root["/Background"].set_property("bottom_color", _GROUND)
        for furniture in ("/Grid", "/Axes"):
            self._root[furniture].set_property("visible", False)

    def send(self, command: Any) -> None:
        """Take a command of Meshcat's in place of its window; WebGL draws in single precision anyway."""
        self.commands.append(umsgpack.packb(command.lower(), force_float_precision="single"))

    def add(self, name: str, shape: Shape, color: Color, pose: Array | None = None, *, lining: bool = False) -> None:
        """Put a shape at a pose in the frame of what is above it, (4, 4).

        Of a ``lining`` only the far side is seen, so that it hides nothing that is inside it.
        """
        node = self._root[name]
        side = _BACK if lining else _BOTH
        node.set_object(_geometry(shape), meshes.MeshPhongMaterial(color=_rgb(color), opacity=color[3], side=side))
        place = np.eye(4) if pose is None else pose
        node.set_transform(place @ _Y_TO_Z if isinstance(shape, Cylinder) else place)

    def add_segments(self, name: str, segments: Array, color: Color) -> None:
        """Draw line segments [m], (k, 2, 3), one pixel wide."""
        ends = meshes.PointsGeometry(segments.reshape(-1, 3).T.astype(np.float32))
        self._root[name].set_object(meshes.LineSegments(ends, meshes.LineBasicMaterial(color=_rgb(color))))

    def place(self, name: str, pose: Array) -> None:
        """Put a name, and all below it, at a pose (4, 4)."""
        self._root[name].set_transform(pose)

    def animate(self, tracks: Mapping[str, Track], fps: float) -> None:
        """Move names along tracks, at real speed, over and over."""
        clips = {self._root[name].path: _clip(track, fps) for name, track in tracks.items()}
        self._root.set_animation(animation.Animation(clips, fps), repetitions=math.inf)


def path(group: str, index: int, name: str) -> str:
    """A path for any name: the number keeps it unique and unlike JavaScript's own, and slashes would nest."""
    return f"{group}/{index} {name.replace('/', '|')}"


def _geometry(shape: Shape) -> meshes.Geometry:
    if isinstance(shape, Box):
        return meshes.Box(shape.size.tolist())
    if isinstance(shape, Cylinder):
        return meshes.Cylinder(shape.length, shape.radius)
    if isinstance(shape, Sphere):
        return meshes.Sphere(shape.radius)
    return meshes.TriangularMeshGeometry(shape.vertices, shape.faces)


def _rgb(color: Color) -> int:
    red, green, blue = (round(255 * channel) for channel in color[:3])
    return red << 16 | green << 8 | blue


def _clip(track: Track, fps: float) -> animation.AnimationClip:
    frames = (track.times * fps).tolist()
    moving = {
        "position": animation.AnimationTrack("position", "vector3", frames, track.positions.tolist()),
        "quaternion": animation.AnimationTrack("quaternion", "quaternion", frames, track.quaternions.tolist()),
    }
    return animation.AnimationClip(moving, fps)
