"""Reading of a toolpath from a file of any supported format."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from pathcontrol._files import as_path
from pathcontrol.errors import InputError, ToolpathError, warn
from pathcontrol.toolpaths.contour import Toolpath

#: readers by the end of a file's name: the module of this package, and the function in it
READERS = {
    (".csv", ".tsv", ".txt", ".xyz"): ("csv", "read_csv"),
    (".ngc", ".nc", ".gcode", ".gc", ".tap", ".cnc"): ("gcode", "read_gcode"),
    (".svg",): ("svg", "read_svg"),
    (".dxf",): ("dxf", "read_dxf"),
}
#: what to do about files of other programs
_EXPORTS = {
    ".dwg": "save the DWG drawing as DXF in ASCII, R2000 or later",
    **dict.fromkeys((".ai", ".eps", ".pdf", ".cdr", ".odg"), "export the drawing as SVG or DXF"),
    **dict.fromkeys(
        (".stl", ".step", ".stp", ".iges", ".igs", ".obj", ".3mf"), "let a CAM program make G-code of the body"
    ),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "save the table as CSV"),
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".bmp"), "trace the image, and save it as SVG"),
}


def read_toolpath(path: str | Path, **options: Any) -> Toolpath:
    """Read the contours of a file, CSV, G-code, SVG or DXF by its suffix.

    Args:
        path: the file.
        options: what the reader for such files takes besides, see :func:`read_csv`, :func:`read_gcode`,
            :func:`read_svg` and :func:`read_dxf`. All take ``feed`` [m/s], for contours without one, and ``unknown``:
            ``"refuse"``, what is not understood is an error, or ``"warn"``, where it cannot change what is cut it is
            passed over, and each kind is noted once with its count and lines.

    What a reader passes over or takes for granted is warned of by :class:`PathControlWarning`, and is in
    :attr:`Toolpath.notes`.

    Raises:
        ToolpathError: no reader knows such files, or the file cannot be used; the message says where and why.
        InputError: the reader has no such option.
    """
    reader = _reader(as_path("path", path))
    known = [name for name in inspect.signature(reader).parameters if name != "path"]
    unknown = sorted(set(options) - set(known))
    if unknown:
        takes, wrong = (", ".join(f"{name}=" for name in names) for names in (known, unknown))
        raise InputError(
            f"{Path(path).name!r} is read by {reader.__name__}, which takes {takes}, not {wrong}",
            argument=unknown[0],
            choices=tuple(known),
        )
    toolpath = reader(path, **options)
    for note in toolpath.notes:
        warn(f"{Path(path).name}: {note}")
    return toolpath


def readers() -> Iterator[Callable[..., Toolpath]]:
    """Yield the readers of all formats."""
    yield from (_load(*place) for place in READERS.values())


def _load(module: str, name: str) -> Callable[..., Toolpath]:
    """Return a reader, whose module is loaded now."""
    reader: Callable[..., Toolpath] = getattr(import_module(f"pathcontrol.toolpaths.{module}"), name)
    return reader


def _reader(path: Path) -> Callable[..., Toolpath]:
    """Return the reader of a file, by its suffix."""
    for suffixes, place in READERS.items():
        if path.suffix.lower() in suffixes:
            return _load(*place)
    known = ", ".join(suffix for suffixes in READERS for suffix in suffixes)
    advice = f"; {_EXPORTS[path.suffix.lower()]}" if path.suffix.lower() in _EXPORTS else ""
    raise ToolpathError(
        f"{str(path)!r} ends in {path.suffix or 'nothing'!r}, expected one of {known}{advice}",
        argument="path",
        value=str(path),
        file=str(path),
    )
