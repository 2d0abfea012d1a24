"""Meshes with fewer triangles, to look at from a distance."""

from __future__ import annotations

import fast_simplification
import numpy as np

from pathcontrol.view.bodies.shapes import Mesh

_ROUNDING = 1 / 16  # of the detail: far below a pixel, and numbers with fewer digits are packed into less room


def thinned(mesh: Mesh, detail: float) -> Mesh:
    """A mesh that shares its vertices, with fewer triangles: its surface moves by no more than ``detail`` [m].

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


def rounded(mesh: Mesh, detail: float) -> Mesh:
    """A mesh whose coordinates are multiples of a power of two, a small part of the ``detail`` [m]."""
    if detail <= 0:
        return mesh
    step = 2.0 ** np.floor(np.log2(_ROUNDING * detail))
    return Mesh(step * np.round(mesh.vertices / step), mesh.faces)
