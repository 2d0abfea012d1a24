"""Text files of toolpaths, read within bounds of time and memory, whatever the file holds."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from pathcontrol.errors import InputError, ToolpathError

#: most segments, moves or points that a file may hold
MAX_SEGMENTS = 2_000_000
MAX_CONTOURS = 100_000
#: largest coordinate, radius or length [m]: a larger one is a mistake in the unit, or an attack
MAX_COORDINATE = 1e4

#: beginnings of other files that end like toolpaths, and what to do about them
_OTHERS = {
    b"AutoCAD Binary DXF": "a binary DXF drawing, which is not read: save it as DXF in ASCII, R2000 or later",
    b"AC10": "a DWG drawing, which is not read: save it as DXF in ASCII, R2000 or later",
    b"\x1f\x8b": "compressed by gzip, as SVGZ is: unpack it first",
    b"PK\x03\x04": "a ZIP archive, as XLSX and 3MF are: unpack it, or export it as the text that is read here",
    b"%PDF": "a PDF document: export its drawing as SVG or DXF",
    b"\x89PNG": "a PNG image, which has no outlines: trace it, and save it as SVG",
    b"\xff\xd8\xff": "a JPEG image, which has no outlines: trace it, and save it as SVG",
}
_MAX_BYTES = 64 << 20
_MAX_LINES = 2 * MAX_SEGMENTS
_MAX_LINE_LENGTH = 100_000


def read_text(path: str | os.PathLike[str], what: str = "a toolpath") -> str:
    r"""Read a file as UTF-8, or as Latin-1 if it is not valid; lines end in ``\n``.

    Args:
        path: the file.
        what: what is expected in it, for the errors: ``"a G-code file"``.

    Raises:
        InputError: ``path`` is no path.
        ToolpathError: there is no such regular file, it cannot be read, is larger than 64 MiB, or holds NUL bytes.
    """
    data = _read_bytes(path, what)
    for beginning, kind in _OTHERS.items():
        if data.startswith(beginning):
            raise ToolpathError(f"{os.fspath(path)} is {kind}", file=os.fspath(path))
    if b"\0" in data:
        raise ToolpathError(
            f"{os.fspath(path)} holds NUL bytes and is no text, expected {what}; if it is UTF-16, save it as UTF-8",
            file=os.fspath(path),
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_lines(path: str | os.PathLike[str], what: str = "a toolpath") -> list[str]:
    """Read the lines of a file as :func:`read_text` does, without their ends.

    Raises:
        InputError: ``path`` is no path.
        ToolpathError: see :func:`read_text`; more than 4 000 000 lines, or more than 100 000 characters in one of them.
    """
    text = read_text(path, what)
    if text.count("\n") > _MAX_LINES:
        raise ToolpathError(
            f"{os.fspath(path)} has more than {_MAX_LINES} lines; split it into several files",
            limit=_MAX_LINES,
            file=os.fspath(path),
        )
    lines = text.split("\n")
    for number, line in enumerate(lines, 1):
        if len(line) > _MAX_LINE_LENGTH:
            raise ToolpathError(
                f"{os.fspath(path)}: line {number}: {len(line)} characters, expected at most {_MAX_LINE_LENGTH} in a "
                f"line; is it {what}?",
                value=len(line),
                limit=_MAX_LINE_LENGTH,
                file=os.fspath(path),
                line=number,
            )
    return lines


def _read_bytes(path: str | os.PathLike[str], what: str) -> bytes:
    """Read the bytes of a regular file of bounded size."""
    try:
        file = Path(path)
    except TypeError as error:
        raise InputError(f"path = {path!r}, expected the path of {what}", argument="path", value=path) from error
    data = None
    try:
        if stat.S_ISREG(file.stat().st_mode):  # a pipe or a device could be read for ever
            with file.open("rb") as stream:
                data = stream.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise ToolpathError(f"{str(path)!r} cannot be read, expected {what}: {reason}", file=str(path)) from error
    if data is None:
        raise ToolpathError(f"{path} is no regular file, expected {what}", file=str(path))
    if len(data) > _MAX_BYTES:
        raise ToolpathError(
            f"{path} is larger than the {_MAX_BYTES >> 20} MiB that are read at most; split it into several files",
            limit=_MAX_BYTES,
            file=str(path),
        )
    return data
