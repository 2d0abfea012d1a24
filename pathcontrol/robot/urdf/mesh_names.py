"""What the names of mesh files in a URDF mean: paths, and places in packages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote

_PACKAGE, _FILE = ("package", "model"), "file"
_FIND = re.compile(r"\$\(find(?:-pkg-share)?\s+([^)\s]+)\s*\)/*")  # what xacro or roslaunch would have replaced
_DEEPEST = 8  # folders of a path that are kept in its ends
_DRIVE = re.compile(r"[A-Za-z]:/+")


class MeshName(NamedTuple):
    """One way to read the name of a mesh.

    Attributes:
        scheme: ``"package"``, also for ``model://``; ``"file"``; empty for a path; else what would have to be fetched.
        path: what follows the scheme, with ``/`` between folders.
    """

    scheme: str
    path: str

    @property
    def tails(self) -> list[PurePosixPath]:
        """Its ends, the longest first: a folder that was moved or copied keeps what is in it."""
        whole = PurePosixPath(_DRIVE.sub("/", self.path, count=1))
        parts = [part for part in whole.parts if part.strip("/") not in ("", "..")][-_DEEPEST:]
        return [PurePosixPath(*parts[i:]) for i in range(len(parts))]


def readings(name: str) -> Iterator[MeshName]:
    """Read a name as it is written, then with slashes for backslashes, then with a space for ``%20`` and so on."""
    name = _FIND.sub(r"package://\1/", name.strip(), count=1)
    forward = name.replace("\\", "/")
    for spelling in dict.fromkeys((name, forward, unquote(forward))):
        scheme = _scheme(spelling)
        yield MeshName(scheme, spelling.partition(":")[2] if scheme else spelling)


def is_local(name: str) -> bool:
    """Whether a mesh name means a file of this machine; nothing is fetched."""
    return next(readings(name)).scheme in ("", _FILE, "package")


def in_package(name: str) -> bool:
    """Whether a mesh name means a file in a package."""
    return next(readings(name)).scheme == "package"


def at_home(name: str) -> Path:
    """Return a path, with the home folder in the place of ``~``."""
    try:
        return Path(name).expanduser()
    except RuntimeError:  # the home of a user who does not exist
        return Path(name)


def _scheme(name: str) -> str:
    scheme, colon, rest = name.partition(":")
    scheme = scheme.lower()
    if not colon or len(scheme) == 1 or not scheme.isalpha():  # C:\arm.stl is a path
        return ""
    if scheme in _PACKAGE:
        return "package"
    return scheme if scheme == _FILE or rest.startswith("//") else ""
