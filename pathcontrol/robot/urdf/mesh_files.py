"""Where the mesh files that a URDF names may be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

LOCAL_SCHEMES = ("", "file", "package")


def mesh_candidates(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> list[Path]:
    """The files that a mesh name may mean, in the order to try; nothing if there is no folder to look in.

    Args:
        name: a relative or absolute path, ``file://…``, or ``package://…``; see :data:`LOCAL_SCHEMES`.
        base_dir: folder of the URDF. Relative meshes are looked for there, packages there and above.
        package_dirs: folders that hold packages.
    """
    scheme, _, relative = name.rpartition("://")
    if scheme == "file" or Path(name).is_absolute():
        return [Path(relative)]
    folders = list(package_dirs)
    if base_dir is not None:
        folder = base_dir.absolute()
        folders += [folder, *folder.parents] if scheme else [folder]
    return [folder / relative.lstrip("/") for folder in folders]
