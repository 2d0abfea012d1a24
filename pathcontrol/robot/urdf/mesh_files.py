"""Where the mesh files that a URDF names may be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

_PACKAGE, _FILE = ("package", "model"), "file"
_POINTER = b"version https://git-lfs"
_MOST_PACKAGES = 1000  # folders in one of package_dirs that are looked into

#: what to do about a mesh that is not found, in Python, in experiment files and on the command line
ADD_FOLDER = "give the folder that holds its package: package_dirs in Python, --package-dir on the command line"

#: what a file is that is no mesh but the address of one
A_POINTER = "a pointer of Git LFS and not the mesh itself; run `git lfs pull` where it came from"


def scheme_of(name: str) -> str:
    """What stands before the colon of a mesh name: empty for a path, ``"package"`` for ``model://`` too."""
    scheme, colon, rest = name.partition(":")
    if not colon or len(scheme) == 1 or not scheme.isalpha():  # C:\arm.stl is a path
        return ""
    if scheme in _PACKAGE:
        return "package"
    return scheme if scheme == _FILE or rest.startswith("//") else ""


def is_local(name: str) -> bool:
    """Whether a mesh name means a file of this machine; nothing is fetched."""
    return scheme_of(name) in ("", _FILE, "package")


def find_mesh_file(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Path | None:
    """The file that a mesh name means, ``None`` if there is none.

    Args:
        name: a relative or absolute path, ``file:…``, ``package://…`` or ``model://…``. What no file has as it is
            written is looked for with ``%20`` as a space, backslashes as slashes and ``~`` as the home folder.
        base_dir: folder of the URDF. Relative meshes are looked for there, packages there and above.
        package_dirs: folders that hold packages, or are packages. A package whose folder has another name is found
            by what is in it.
    """
    for path in mesh_candidates(name, base_dir, package_dirs):
        try:
            if path.is_file():
                return path
        except (OSError, ValueError):  # a name that no file can have
            continue
    return None


def is_pointer(path: Path) -> bool:
    """Whether a file is but a pointer of Git LFS to the mesh, which was not downloaded."""
    with path.open("rb") as file:
        return file.read(len(_POINTER)) == _POINTER


def mesh_candidates(name: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """The files that a mesh name may mean, in the order to try; see :func:`find_mesh_file`."""
    for spelling in dict.fromkeys((name, name.replace("\\", "/"), unquote(name.replace("\\", "/")))):
        scheme = scheme_of(spelling)
        if scheme == "package":
            yield from _in_packages(spelling.partition(":")[2].lstrip("/"), base_dir, package_dirs)
        else:
            yield from _paths(spelling, scheme, base_dir, package_dirs)


def _paths(name: str, scheme: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """What a path may mean: as it is, or from the folder of the URDF and those given."""
    relative = name.removeprefix("file:") if scheme else name
    if relative.startswith("//"):  # file://HOST/path, where most mean file:///path
        relative = relative[1:]
        relative = relative.removeprefix("/localhost") if relative.startswith("/localhost/") else relative
        yield Path(relative)
        relative = relative.lstrip("/")
    path = _at_home(relative)
    for folder in (*package_dirs, *(() if base_dir is None else (base_dir.absolute(),))):
        yield folder / path  # which is the path itself if it is absolute
    if path.is_absolute():
        yield path


def _in_packages(relative: str, base_dir: Path | None, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """What a path that begins with the name of a package may mean."""
    above = () if base_dir is None else (base_dir.absolute(), *base_dir.absolute().parents)
    folders, inside = (*package_dirs, *above), relative.partition("/")[2]
    yield from (folder / relative for folder in folders)
    if inside:
        yield from (folder / inside for folder in folders)
        yield from (package / inside for folder in package_dirs for package in _folders_in(folder))


def _folders_in(folder: Path) -> list[Path]:
    try:
        return sorted(entry for entry, _ in zip(folder.iterdir(), range(_MOST_PACKAGES), strict=False))
    except OSError:
        return []


def _at_home(name: str) -> Path:
    try:
        return Path(name).expanduser()
    except RuntimeError:  # the home of a user who does not exist
        return Path(name)
