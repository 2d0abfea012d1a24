"""The meshes of a robot's files, as they are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import fast_simplification
import numpy as np
import trimesh
from numpy.typing import ArrayLike

from pathcontrol.errors import UrdfError
from pathcontrol.robot.meshes import Part, load_parts
from pathcontrol.view.bodies.body_shapes import Color, Mesh

MOST_TRIANGLES = 100_000  # limit for one colour: a picture shows no more
_FARTHEST = 1e6  # m
SHARP = np.deg2rad(40.0)  # faces that meet at more than this show an edge
_MOST_KEPT = 200_000  # triangles in all that are kept for the next film, in some 8 MB
_ROUNDING = 1 / 16  # share of the detail, far below a pixel; numbers with fewer digits compress better
_kept: dict[bytes, Mesh] = {}  # by what they were made of


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
    meshes = [(_remember_split(mesh, detail), color) for color, mesh in joined]
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
        raise UrdfError(
            f"it has vertices that are not finite, or {_FARTHEST:g} m away and more; check its scale", limit=_FARTHEST
        )
    return Mesh(vertices, np.concatenate(faces))


def _remember_split(mesh: Mesh, detail: float) -> Mesh:
    """Split a mesh at sharp edges, once for all films of a session, most of whose time it takes."""
    kind = (float(detail), mesh.vertices.dtype, mesh.faces.dtype, len(mesh.vertices))
    key = sha256(repr(kind).encode() + mesh.vertices.tobytes() + mesh.faces.tobytes()).digest()
    if (known := _kept.get(key)) is not None:
        return known
    split = _split_sharp_edges(mesh, detail)
    if sum(len(other.faces) for other in [*_kept.values()]) + len(split.faces) > _MOST_KEPT:
        _kept.clear()
    if len(split.faces) <= _MOST_KEPT:
        for array in (split.vertices, split.faces):
            array.setflags(write=False)
        _kept[key] = split
    return split


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


def cluster_vertices(mesh: Mesh, most: int) -> Mesh:
    """Return a mesh with at most ``most`` triangles, in time and memory proportional to the given ones.

    Vertices in one cell of a grid become their mean, and triangles that lose their area go (Rossignac and Borrel,
    1993); the cells are doubled in size until few enough are left. A mesh that has no more is left alone.
    """
    if len(mesh.faces) <= most:
        return mesh
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    cell = extent / np.sqrt(most)
    while cell and len(mesh.faces) > most:
        mesh, cell = _merge_cells(mesh, cell), 2 * cell
    return mesh


def _merge_cells(mesh: Mesh, cell: float) -> Mesh:
    """Merge the vertices of a mesh in each cell of a grid."""
    index = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / cell).astype(np.int64)
    key = np.ravel_multi_index(tuple(index.T), tuple(index.max(axis=0) + 1))
    _, which, count = np.unique(key, return_inverse=True, return_counts=True)
    sums = [np.bincount(which, weights=x) for x in mesh.vertices.T]
    faces = which[mesh.faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Mesh(np.stack(sums, axis=-1) / count[:, None], faces[kept])


def thin(mesh: Mesh, detail: float) -> Mesh:
    """Return a mesh with shared vertices and fewer triangles: its surface moves by at most ``detail`` [m].

    Edges are collapsed while the sum of the squared distances from the planes of all triangles that a vertex
    stands for is less than the square of the detail (quadric error metric; Garland and Heckbert, SIGGRAPH
    1997). Borders stay as they are, so that the parts of a body go on meeting. What would lose its extent is kept.
    """
    if detail <= 0 or not len(mesh.faces):
        return mesh
    # the library's lossless mode allows for errors of rounding, up to the machine epsilon: ours is to be just that
    scale = np.sqrt(np.finfo(np.float64).eps) / detail
    vertices, faces = fast_simplification.simplify(
        scale * mesh.vertices, mesh.faces, 0.0, lossless=True, preserve_border=True
    )
    fewer = Mesh(vertices / scale, faces)
    same = len(faces) > 0 and bool((np.abs(fewer.bounds - mesh.bounds) <= detail).all())
    return fewer if same else mesh


def round_vertices(mesh: Mesh, detail: float) -> Mesh:
    """Return a mesh whose coordinates are multiples of a power of two, a small part of the ``detail`` [m]."""
    if detail <= 0:
        return mesh
    step = 2.0 ** np.floor(np.log2(_ROUNDING * detail))
    return Mesh(step * np.round(mesh.vertices / step), mesh.faces)
