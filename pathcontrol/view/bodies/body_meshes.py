"""The meshes of a robot's files, as they are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from pathcontrol.errors import UrdfError
from pathcontrol.robot.meshes import Part, load_parts
from pathcontrol.view.bodies.body_shapes import Color, Mesh
from pathcontrol.view.bodies.thinning import cluster_vertices, round_vertices, thin

MOST_TRIANGLES = 100_000  # limit for one colour: a picture shows no more
_FARTHEST = 1e6  # m
SHARP = np.deg2rad(40.0)  # faces that meet at more than this show an edge


def read_mesh(path: Path, scale: ArrayLike = 1.0, detail: float = 0.0) -> list[tuple[Mesh, Color | None]]:
    """Read the triangles of a mesh file [m], one mesh for each colour in it; the colour is None where it has none.

    Args:
        path: an STL, OBJ, PLY, Collada or glTF file.
        scale: factor, or one along each axis.
        detail: how far the surface may be from that of the file [m], so that it has fewer triangles.

    Raises:
        UrdfError: the file cannot be read, or has no triangles.
    """
    factor = np.asarray(scale, dtype=np.float64)
    found: dict[Color | None, list[Part]] = {}
    for part in load_parts(path):
        found.setdefault(part.color, []).append(part)
    joined = [(color, _join(found[color], factor)) for color in sorted(found, key=lambda color: color or ())]
    meshes = [(_split_sharp_edges(mesh, detail), color) for color, mesh in joined]
    meshes = [(mesh, color) for mesh, color in meshes if len(mesh.faces)]
    if not meshes:
        raise UrdfError("it has no triangles")
    return meshes


def _join(parts: Sequence[Part], factor: np.ndarray) -> Mesh:
    """Return parts of one colour as one mesh."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + offset for part, offset in zip(parts, offsets, strict=True)]
    vertices = np.concatenate([part.vertices for part in parts]) * factor
    if not (np.abs(vertices) < _FARTHEST).all():
        raise UrdfError(f"it has vertices that are not finite, or {_FARTHEST:g} m away and more; check its scale")
    return Mesh(vertices, np.concatenate(faces))


def _split_sharp_edges(mesh: Mesh, detail: float) -> Mesh:
    """Return a mesh that shares vertices across smooth edges only, so that averaged normals keep sharp ones."""
    few = cluster_vertices(mesh, MOST_TRIANGLES)
    whole = trimesh.Trimesh(few.vertices[few.faces].reshape(-1, 3), np.arange(few.faces.size).reshape(-1, 3))
    whole.update_faces(whole.nondegenerate_faces())
    coarse = thin(Mesh(np.asarray(whole.vertices), np.asarray(whole.faces)), detail)
    if not len(coarse.faces):
        return coarse
    smooth = trimesh.graph.smooth_shade(trimesh.Trimesh(coarse.vertices, coarse.faces, process=False), angle=SHARP)
    return round_vertices(Mesh(np.asarray(smooth.vertices), np.asarray(smooth.faces)), detail)
