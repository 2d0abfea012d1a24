"""Look-up of the mesh files that a URDF names, with the reasons why one cannot be read."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path, PurePosixPath

from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf.mesh_names import MeshName, expand_home, is_in_package, is_local, readings

#: the kinds of mesh files that are read
FORMATS = (".stl", ".obj", ".ply", ".dae", ".glb", ".gltf")

_POINTER = b"version https://git-lfs"
_MOST_ENTRIES = 1000  # entries of a folder that are searched
_OPTIONS = "package_dirs in Python, --package-dir on the command line"
#: variables of ROS and Gazebo: with folders that hold packages, and with prefixes that have packages in share/
_ENVIRONMENT = ("ROS_PACKAGE_PATH", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH")
_PREFIXES = ("AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH")


def find_mesh(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Path:
    """Find the file that a mesh name of a URDF means; nothing is fetched.

    Args:
        name: a relative or absolute path, ``file:…``, ``package://…`` or ``model://…``. What no file has as it is
            written is looked for with ``%20`` as a space, backslashes as slashes, ``~`` as the home folder, in upper or
            lower case, and by the end of its path beside the URDF and in ``package_dirs``.
        base_dir: folder of the URDF. Relative meshes are looked for there, packages there and above.
        package_dirs: folders that hold packages, or are packages. A package whose folder has another name is found
            by what is in it. The folders that ``ROS_PACKAGE_PATH`` and the like name come after them.

    Raises:
        UrdfError: there is no such file, or it is no mesh; the message says why and what to try.
    """
    if not is_local(name):
        raise UrdfError("it is not fetched; expected package://, file:// or a relative path", value=name)
    path = _find_first(name, base_dir, package_dirs)
    if path is None:
        raise UrdfError(f"it is not found; {_advise(name)}", value=name)
    check_format(path)
    try:
        with path.open("rb") as file:
            check_content(file.read(len(_POINTER)))
    except OSError as error:
        raise UrdfError(f"it cannot be read: {error.strerror}", file=str(path)) from error
    return path


def check_format(path: Path) -> None:
    """Refuse a file whose suffix is of no known mesh format, with a :class:`UrdfError`."""
    if path.suffix.lower() not in FORMATS:
        raise UrdfError(
            f"it ends in {path.suffix or 'nothing'!r}, expected one of {', '.join(FORMATS)}",
            value=path.suffix,
            choices=tuple(FORMATS),
        )


def check_content(start: bytes) -> None:
    """Refuse a file whose first bytes are of no mesh, with a :class:`UrdfError`."""
    if start.startswith(_POINTER):
        raise UrdfError("it is a pointer of Git LFS and not the mesh itself; run `git lfs pull` where it came from")
    if not start:
        raise UrdfError("it is an empty file")


def has_candidates(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> bool:
    """Return whether there is any folder to look for a mesh in; a robot given as text may have none."""
    return next(_candidates(name, base_dir, package_dirs), None) is not None


def _advise(name: str) -> str:
    """Return advice about a mesh that is not found."""
    if is_in_package(name):
        return f"give the folder that holds its package: {_OPTIONS}, or ROS_PACKAGE_PATH"
    return f"put it there, or give the folder that its path begins in: {_OPTIONS}"


def _find_first(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Path | None:
    """Return the first candidate that is a file."""
    for path in _candidates(name, base_dir, package_dirs):
        try:
            if path.is_file():
                return path
        except (OSError, ValueError):  # a name that no file can have
            continue
    return None


def _candidates(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """Yield the files that a mesh name may mean, in the order to try; see :func:`find_mesh`."""
    names = list(readings(name))
    for reading in names:
        inside = _read_in_packages if reading.scheme == "package" else _read_as_path
        yield from inside(reading, base_dir, package_dirs)
    near = (*package_dirs, *(() if base_dir is None else (base_dir.absolute(), base_dir.absolute().parent)))
    for reading in names:  # a package or a folder that was copied or renamed keeps what is in it
        yield from (folder / tail for tail in reading.tails for folder in near)
    for reading in names:
        whole = PurePosixPath(reading.path.lstrip("/"))
        yield from (path for end in (whole, *reading.tails) for folder in near for path in _match_any_case(folder, end))


def _read_as_path(reading: MeshName, base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """Yield the files that a path may mean: as it is, or from the folder of the URDF and those given."""
    relative = reading.path
    if reading.scheme and relative.startswith("//"):  # file://HOST/path, where most mean file:///path
        relative = relative[1:]
        relative = relative.removeprefix("/localhost") if relative.startswith("/localhost/") else relative
        yield Path(relative)
        relative = relative.lstrip("/")
    path = expand_home(relative)
    for folder in (*package_dirs, *(() if base_dir is None else (base_dir.absolute(),))):
        yield folder / path  # which is the path itself if it is absolute
    if path.is_absolute():
        yield path


def _read_in_packages(reading: MeshName, base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """Yield the files that a path may mean that begins with the name of a package."""
    relative = reading.path.lstrip("/")
    package, _, inside = relative.partition("/")
    known = _package_folders()
    yield from (folder / relative for folder in chain(_folders(base_dir, package_dirs), known))
    if inside:
        yield from (folder / inside for folder in known if folder.name == package)
        yield from (folder / inside for folder in _folders(base_dir, package_dirs))
        yield from (entry / inside for folder in package_dirs for entry in _entries(folder))


def _folders(base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """Yield the folders given, that of the URDF, and all above it: mostly one of the first is the right one."""
    yield from package_dirs
    if base_dir is not None:
        yield base_dir.absolute()
        yield from base_dir.absolute().parents


def _package_folders() -> list[Path]:
    """Return the folders of packages that the environment names."""
    folders = [Path(entry) for name in _ENVIRONMENT for entry in os.environ.get(name, "").split(os.pathsep) if entry]
    prefixes = [Path(entry) for name in _PREFIXES for entry in os.environ.get(name, "").split(os.pathsep) if entry]
    return [*folders, *(prefix / "share" for prefix in prefixes)]


def _match_any_case(folder: Path, relative: PurePosixPath) -> list[Path]:
    """Return the files below ``folder`` whose path is ``relative`` up to upper and lower case."""
    found = [folder]
    for part in relative.parts:
        if part in ("..", "."):
            found = [path / part for path in found]
        else:
            found = [entry for path in found for entry in _entries(path) if entry.name.casefold() == part.casefold()]
    return found


def _entries(folder: Path) -> list[Path]:
    """Return the entries of a folder, at most so many."""
    try:
        return sorted(islice(folder.iterdir(), _MOST_ENTRIES))
    except OSError:
        return []
