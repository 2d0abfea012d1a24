"""Mesh files of a robot, read within bounds of time and memory, whatever the file holds."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

from pathcontrol._arrays import Array
from pathcontrol._files import read_bounded
from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf.mesh_files import check_content, check_format

MAX_BYTES = 128 << 20
#: most triangles of a mesh, counted as often as they are placed
MAX_TRIANGLES = 5_000_000

_BESIDE = (".mtl", ".bin")  # other files of a mesh that are read: materials and buffers, but no pictures


class Part(NamedTuple):
    """The triangles of one material of a mesh.

    Attributes:
        vertices: their corners [m], (k, 3).
        faces: three indices into them each, (m, 3).
        color: red, green, blue and opacity, each from 0 to 1; ``None`` if the file says none.
    """

    vertices: Array
    faces: np.ndarray
    color: tuple[float, float, float, float] | None


def load_parts(path: Path) -> list[Part]:
    """Read the triangles of an STL, OBJ, PLY, Collada or glTF file, grouped by material.

    Raises:
        UrdfError: the file is of another kind, too large, cannot be read, or holds no triangles.
    """
    check_format(path)
    data = read_bounded(path, MAX_BYTES, "a mesh", UrdfError)
    check_content(data)
    try:
        parts = _parts(data, path)
    except UrdfError:
        raise
    except Exception as error:  # the readers of a handful of formats raise whatever they like
        raise UrdfError(f"it cannot be read: {type(error).__name__}: {error}") from error
    if not parts:
        raise UrdfError("it has no triangles")
    for part in parts:
        _check_part(part)
    return parts


def _check_part(part: Part) -> None:
    """Check that every triangle has three corners in space that exist in the file."""
    count = len(part.vertices)
    if part.vertices.ndim != 2 or part.vertices.shape[1] != 3 or part.vertices.dtype.kind not in "fiu":
        raise UrdfError(
            f"its vertices have the shape {part.vertices.shape}, expected three coordinates each",
            value=part.vertices.shape,
        )
    if part.faces.ndim != 2 or part.faces.shape[1] != 3 or part.faces.dtype.kind not in "iu":
        raise UrdfError(
            f"its faces have the shape {part.faces.shape}, expected three corners each", value=part.faces.shape
        )
    if part.faces.min() < 0 or part.faces.max() >= count:
        raise UrdfError(
            f"a triangle has a corner {part.faces.max()}, but there are {count} vertices",
            value=part.faces.max(),
            limit=count,
        )


def _parts(data: bytes, path: Path) -> list[Part]:
    """Read the parts of a mesh, checked for their number of triangles."""
    kind = path.suffix.lower().removeprefix(".")
    if kind in ("glb", "gltf"):
        _check_accessors(data, kind)
    scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=_Beside(path.parent), process=False)
    placed = [(transform, scene.geometry[name]) for transform, name in map(scene.graph.get, scene.graph.nodes_geometry)]
    shapes = [(transform, shape) for transform, shape in placed if isinstance(shape, trimesh.Trimesh)]
    triangles = sum(len(shape.faces) for _, shape in shapes)
    if triangles > MAX_TRIANGLES:
        raise UrdfError(
            f"it has {triangles} triangles, expected at most {MAX_TRIANGLES}; thin it out",
            value=triangles,
            limit=MAX_TRIANGLES,
        )
    metres = _metres(scene.units)
    return [_place(shape, transform, metres) for transform, shape in shapes if len(shape.faces)]


def _place(shape: trimesh.Trimesh, transform: Array, metres: float) -> Part:
    """Transform a shape to its place in the file; the triangles of a mirrored one are turned outside again."""
    turn, vertices = metres * transform[:3, :3], np.asarray(shape.vertices)
    if not np.array_equal(turn, np.eye(3)) or transform[:3, 3].any():
        vertices = vertices @ turn.T + metres * transform[:3, 3]
    faces = np.asarray(shape.faces)
    return Part(vertices, faces[:, ::-1] if np.linalg.det(turn) < 0 else faces, _color(shape.visual))


def _metres(units: str | None) -> float:
    """Return the length of the file's unit [m]; only Collada states one, other formats are in metres (URDF)."""
    return trimesh.units.unit_conversion(units, "meters") if units and units.endswith("* meters") else 1.0


def _color(visual: Any) -> tuple[float, float, float, float] | None:
    """Return the colour of a shape, ``None`` if it has none."""
    if not visual.defined:
        return None
    rgba = np.asarray(getattr(visual, "material", visual).main_color, dtype=np.float64) / 255
    return float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3])


def _check_accessors(data: bytes, kind: str) -> None:
    """Check that a glTF file announces no more numbers than a mesh may have, before room is made for them."""
    if kind == "glb":
        data = data[20 : 20 + int.from_bytes(data[12:16], "little")]
    counts = [accessor.get("count", 0) for accessor in json.loads(data).get("accessors", [])]
    if sum(counts) > 6 * MAX_TRIANGLES:
        raise UrdfError(
            f"it announces {sum(counts)} vertices and faces, expected at most {6 * MAX_TRIANGLES}",
            value=sum(counts),
            limit=6 * MAX_TRIANGLES,
        )


class _Beside(trimesh.resolvers.Resolver):
    """A resolver of the files that a mesh refers to: materials and buffers in its own folder, read within bounds."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()

    def get(self, key: str) -> bytes:
        path = (self._folder / key).resolve()
        if path.suffix.lower() not in _BESIDE or not path.is_relative_to(self._folder):
            raise UrdfError(
                f"{key!r} is not read, expected files in its folder that end in {', '.join(_BESIDE)}", value=key
            )
        return read_bounded(path, MAX_BYTES, "a part of a mesh", UrdfError)

    def keys(self) -> list[str]:
        return []

    def namespaced(self, namespace: str) -> _Beside:
        return _Beside(self._folder / namespace)

    def write(self, name: str, data: bytes) -> None:
        raise UrdfError(f"nothing is written to a mesh: {name!r}", value=name)
