"""The reduction of meshes to fewer triangles, to be seen from a distance."""

from __future__ import annotations

import fast_simplification
import numpy as np

from pathcontrol.view.bodies.body_shapes import Mesh

_ROUNDING = 1 / 16  # share of the detail, far below a pixel; numbers with fewer digits compress better


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
