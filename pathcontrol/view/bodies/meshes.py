"""Mesh files of a robot: where they are, and what is in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf.mesh_files import LOCAL_SCHEMES, mesh_candidates
from pathcontrol.view.bodies.shapes import Color, Mesh
from pathcontrol.view.bodies.thinning import rounded, thinned

SHARP = np.deg2rad(40.0)  # faces that meet at more than this show an edge


def find_mesh(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Path:
    """The file behind a mesh name of a URDF; nothing is fetched.

    Args:
        name: a relative or absolute path, ``file://…``, or ``package://…``.
        base_dir: folder of the URDF; see :func:`mesh_candidates`.
        package_dirs: folders that hold packages.

    Raises:
        UrdfError: there is no such file.
    """
    scheme = name.rpartition("://")[0]
    if scheme not in LOCAL_SCHEMES:
        raise UrdfError(f"{scheme}:// is not fetched; give a relative path, package:// or file://")
    for path in mesh_candidates(name, base_dir, package_dirs):
        if path.is_file():
            return path
    raise UrdfError("there is no such file; give the folder that holds it, or its package, in package_dirs")


def read_mesh(path: Path, scale: ArrayLike = 1.0, detail: float = 0.0) -> list[tuple[Mesh, Color | None]]:
    """The triangles of a mesh file [m], one mesh for each colour in it; the colour is None where it has none.

    Args:
        path: an STL, OBJ, PLY, Collada or glTF file.
        scale: factor, or one along each axis.
        detail: how far the surface may be from that of the file [m], so that it has fewer triangles.

    Raises:
        UrdfError: the file cannot be read, or has no triangles.
    """
    try:
        scene = trimesh.load_scene(path)
        factor = np.asarray(scale, dtype=np.float64) * _metres(scene.units)
        parts = _by_color(part for part in scene.dump() if isinstance(part, trimesh.Trimesh))
    except Exception as error:  # the readers of a dozen formats raise whatever they like
        raise UrdfError(f"it cannot be read: {type(error).__name__}: {error}") from error
    meshes = [(_shaded(np.concatenate(triangles) * factor, detail), color) for color, triangles in parts.items()]
    meshes = [(mesh, color) for mesh, color in meshes if len(mesh.faces)]
    if not meshes:
        raise UrdfError("it has no triangles")
    return meshes


def _metres(units: str | None) -> float:
    """Only Collada says its unit; the files of other formats are in metres by the convention of URDF."""
    return trimesh.units.unit_conversion(units, "meters") if units and units.endswith("* meters") else 1.0


def _by_color(parts: Iterator[Any]) -> dict[Color | None, list[np.ndarray]]:
    found: dict[Color | None, list[np.ndarray]] = {}
    for part in parts:
        found.setdefault(_color(part.visual), []).append(part.triangles)
    return dict(sorted(found.items(), key=lambda item: item[0] or ()))


def _color(visual: Any) -> Color | None:
    if not visual.defined:
        return None
    rgba = np.asarray(getattr(visual, "material", visual).main_color, dtype=np.float64) / 255
    return float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3])


def _shaded(triangles: np.ndarray, detail: float) -> Mesh:
    """A mesh with vertices shared across smooth edges only, so that averaged normals keep the sharp ones."""
    soup = np.arange(3 * len(triangles)).reshape(-1, 3)
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), soup, process=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    if not np.isfinite(mesh.vertices).all():
        raise UrdfError("it has vertices that are not finite")
    coarse = thinned(Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)), detail)
    if not len(coarse.faces):
        return coarse
    smooth = trimesh.graph.smooth_shade(trimesh.Trimesh(coarse.vertices, coarse.faces, process=False), angle=SHARP)
    return rounded(Mesh(np.asarray(smooth.vertices), np.asarray(smooth.faces)), detail)
