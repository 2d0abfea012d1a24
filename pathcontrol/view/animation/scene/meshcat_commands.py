"""A Meshcat scene without a server: the commands are kept and played back by a page.

They are written here, as Meshcat's own package loads its server and IPython, which takes longer than to make a film.
"""

from __future__ import annotations

import hashlib
from typing import Any, TypeAlias

import numpy as np
import umsgpack

from pathcontrol._arrays import Array
from pathcontrol.view.animation.scene.three_objects import (
    BACK,
    BOTH,
    WHITE,
    Description,
    describe_material,
    describe_object,
    describe_segments,
    describe_shape,
    describe_surface,
)
from pathcontrol.view.bodies.body_shapes import Color, Cylinder, Mesh, Shape

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
        self._sent: dict[bytes, tuple[str, Color]] = {}
        self._elements = 0
        for furniture in ("/Grid", "/Axes"):
            self._send({"type": "set_property", "path": furniture, "property": "visible", "value": False})

    def add(self, name: str, shape: Shape, color: Color, pose: Array | None = None) -> None:
        """Put a lit shape at a pose in the frame of what is above it, (4, 4)."""
        if not (isinstance(shape, Mesh) and self._copy_if_known(name, shape, color)):
            material = describe_material("MeshPhongMaterial", color, BOTH)
            self._put(name, "Mesh", describe_shape(shape), material)
        place = np.eye(4) if pose is None else pose
        self.place(name, place @ _Y_TO_Z if isinstance(shape, Cylinder) else place)

    def add_line(self, name: str, line: Mesh, color: Color, *, lining: bool = False) -> None:
        """Draw a line as thick as the tube that it is, in one colour that light does not change.

        Of a ``lining`` only the far side is seen, so that it hides nothing that is inside it.
        """
        material = describe_material("MeshBasicMaterial", color, BACK if lining else BOTH)
        self._put(name, "Mesh", describe_shape(line), material)

    def add_colored_line(self, name: str, line: Mesh, colors: Array) -> None:
        """Draw a tube in the colours (k, 3) of its vertices, as they are in the legend: light does not change them."""
        material = describe_material("MeshBasicMaterial", WHITE, BOTH, of_vertices=True)
        self._put(name, "Mesh", describe_surface(line, colors), material)

    def add_segments(self, name: str, segments: Array, color: Color) -> None:
        """Draw line segments [m], (k, 2, 3), one pixel wide."""
        material = describe_material("LineBasicMaterial", color, BOTH)
        self._put(name, "LineSegments", describe_segments(segments), material)

    def place(self, name: str, pose: Array) -> None:
        """Put a name, and all below it, at a pose (4, 4)."""
        matrix = np.ravel(pose, order="F").tolist()
        self._send({"type": "set_transform", "path": absolute(name), "matrix": matrix})

    def _put(self, name: str, kind: str, geometry: Description, material: Description) -> None:
        """Send an object under names of its parts that are the same whenever the same scene is made."""
        thing = describe_object(kind, geometry, material, self._elements)
        self._elements += 3
        self._send({"type": "set_object", "object": thing, "path": absolute(name)})

    def _send(self, command: Description) -> None:
        """Keep a command of Meshcat; WebGL draws in single precision anyway."""
        self.commands.append(umsgpack.packb(command, force_float_precision="single"))

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
