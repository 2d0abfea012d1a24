"""Interpretation of the names of mesh files in a URDF: paths, and places in packages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote

_PACKAGE, _FILE = ("package", "model"), "file"
_FIND = re.compile(
    r"\$\(find(?:-pkg-share)?\s+([^)\s]+)\s*\)/*"
)  # left by xacro or roslaunch, which should have replaced it
_DEEPEST = 8  # folders of a path that are kept in its ends
_DRIVE = re.compile(r"[A-Za-z]:/+")


class MeshName(NamedTuple):
    """One reading of the name of a mesh.

    Attributes:
        scheme: ``"package"``, also for ``model://``; ``"file"``; empty for a path; else what would have to be fetched.
        path: what follows the scheme, with ``/`` between folders.
    """

    scheme: str
    path: str

    @property
    def tails(self) -> list[PurePosixPath]:
        """The ends of the path, the longest first: a folder that was moved or copied keeps its content."""
        whole = PurePosixPath(_DRIVE.sub("/", self.path, count=1))
        parts = [part for part in whole.parts if part.strip("/") not in ("", "..")][-_DEEPEST:]
        return [PurePosixPath(*parts[i:]) for i in range(len(parts))]


def readings(name: str) -> Iterator[MeshName]:
    """Yield the readings of a name: as written, with slashes for backslashes, and with ``%20`` and the like decoded."""
    name = _FIND.sub(r"package://\1/", name.strip(), count=1)
    forward = name.replace("\\", "/")
    for spelling in dict.fromkeys((name, forward, unquote(forward))):
        scheme = _scheme(spelling)
        yield MeshName(scheme, spelling.partition(":")[2] if scheme else spelling)


def is_local(name: str) -> bool:
    """Return whether a mesh name means a file of this machine; nothing is fetched."""
    return next(readings(name)).scheme in ("", _FILE, "package")


def is_in_package(name: str) -> bool:
    """Return whether a mesh name means a file in a package."""
    return next(readings(name)).scheme == "package"


def expand_home(name: str) -> Path:
    """Return a path with ``~`` replaced by the home folder."""
    try:
        return Path(name).expanduser()
    except RuntimeError:  # the home of a user who does not exist
        return Path(name)


def _scheme(name: str) -> str:
    """Return the scheme of a mesh name, empty for a path."""
    scheme, colon, rest = name.partition(":")
    scheme = scheme.lower()
    if not colon or len(scheme) == 1 or not scheme.isalpha():  # C:\arm.stl is a path
        return ""
    if scheme in _PACKAGE:
        return "package"
    return scheme if scheme == _FILE or rest.startswith("//") else ""
