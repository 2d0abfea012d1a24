"""A Meshcat scene without a server: the commands are kept and played back by a page."""

from __future__ import annotations

import hashlib
from typing import Any, TypeAlias

import meshcat
import meshcat.geometry as meshes
import numpy as np
import umsgpack

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.body_shapes import Box, Color, Cylinder, Mesh, Shape, Sphere

_BACK, _BOTH = 1, 2  # three.js: which side of a triangle is drawn
# three.js has cylinders along y, URDF along z
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

#: a command of Meshcat's in MessagePack, or a copy of an object that is there already
Command: TypeAlias = bytes | dict[str, Any]


class Scene:
    """Objects in the base frame, z up [m].

    Objects are named by ``"group/name"`` paths; a pose belongs to a name, and what is below moves with it. A mesh that
    comes again is not sent again, but copied by the page.

    Attributes:
        commands: the commands to the page, in order.
    """

    def __init__(self) -> None:
        self.commands: list[Command] = []
        self._root = meshcat.Visualizer(window=self)
        self._sent: dict[bytes, tuple[str, Color]] = {}
        self._elements = 0
        for furniture in ("/Grid", "/Axes"):
            self._root[furniture].set_property("visible", False)

    def send(self, command: Any) -> None:
        """Keep a command of Meshcat, in place of its window; WebGL draws in single precision anyway."""
        self.commands.append(umsgpack.packb(command.lower(), force_float_precision="single"))

    def add(self, name: str, shape: Shape, color: Color, pose: Array | None = None) -> None:
        """Put a lit shape at a pose in the frame of what is above it, (4, 4)."""
        if not (isinstance(shape, Mesh) and self._copy_if_known(name, shape, color)):
            material = meshes.MeshPhongMaterial(color=_rgb(color), opacity=color[3], side=_BOTH)
            self._put(name, meshes.Mesh(_geometry(shape), material))
        place = np.eye(4) if pose is None else pose
        self.place(name, place @ _Y_TO_Z if isinstance(shape, Cylinder) else place)

    def add_line(self, name: str, line: Mesh, color: Color, *, lining: bool = False) -> None:
        """Draw a line as thick as the tube that it is, in one colour that light does not change.

        Of a ``lining`` only the far side is seen, so that it hides nothing that is inside it.
        """
        side = _BACK if lining else _BOTH
        material = meshes.MeshBasicMaterial(color=_rgb(color), opacity=color[3], side=side)
        self._put(name, meshes.Mesh(_geometry(line), material))

    def add_colored_line(self, name: str, line: Mesh, colors: Array) -> None:
        """Draw a tube in the colours (k, 3) of its vertices, as they are in the legend: light does not change them."""
        geometry = meshes.TriangularMeshGeometry(line.vertices, line.faces, colors)
        self._put(name, meshes.Mesh(geometry, meshes.MeshBasicMaterial(vertexColors=True, side=_BOTH)))

    def add_segments(self, name: str, segments: Array, color: Color) -> None:
        """Draw line segments [m], (k, 2, 3), one pixel wide."""
        ends = meshes.PointsGeometry(segments.reshape(-1, 3).T.astype(np.float32))
        material = meshes.LineBasicMaterial(color=_rgb(color), opacity=color[3])
        self._put(name, meshes.LineSegments(ends, material))

    def place(self, name: str, pose: Array) -> None:
        """Put a name, and all below it, at a pose (4, 4)."""
        self._root[name].set_transform(pose)

    def _put(self, name: str, thing: meshes.Object) -> None:
        """Send an object under names of its parts that are the same whenever the same scene is made."""
        for part in (thing, thing.geometry, thing.material):
            self._elements += 1
            part.uuid = str(self._elements)
        self._root[name].set_object(thing)

    def _copy_if_known(self, name: str, mesh: Mesh, color: Color) -> bool:
        """Return whether the mesh was sent before, in which case it is copied."""
        digest = hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).digest()
        if digest not in self._sent:
            self._sent[digest] = (name, color)
            return False
        original, painted = self._sent[digest]
        copy: dict[str, Any] = {"copy": absolute(original), "to": absolute(name)}
        self.commands.append(copy if color == painted else copy | {"color": list(color)})
        return True


def absolute(name: str) -> str:
    """Return the path of a name of the scene, as the page knows it."""
    return f"/meshcat/{name}"


def path(group: str, index: int, name: str) -> str:
    """Return a unique path for any name; its number keeps it unlike JavaScript's own, and slashes would nest."""
    return f"{group}/{index} {name.replace('/', '|')}"


def _geometry(shape: Shape) -> meshes.Geometry:
    """Return a shape as geometry of Meshcat."""
    if isinstance(shape, Box):
        return meshes.Box(shape.size.tolist())
    if isinstance(shape, Cylinder):
        return meshes.Cylinder(shape.length, shape.radius)
    if isinstance(shape, Sphere):
        return meshes.Sphere(shape.radius)
    return meshes.TriangularMeshGeometry(shape.vertices, shape.faces)


def _rgb(color: Color) -> int:
    """Return a colour as one number."""
    red, green, blue = (round(255 * channel) for channel in color[:3])
    return red << 16 | green << 8 | blue
