"""The files that a command line names: they exist, and are of the kind that the command takes.

This is looked at before the libraries are loaded that the command needs, which takes a second or two.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from pathcontrol.errors import InputError

Kind = Literal["an experiment", "a saved run", "a robot", "a toolpath"]

#: what reads files of a kind
_COMMANDS = {
    "an experiment": "`pathcontrol run {file}` runs it",
    "a saved run": "`pathcontrol view {file}` shows it, and `pathcontrol report {file}` writes a report on it",
    "a robot": "`pathcontrol check {file}` checks it, and `pathcontrol view {file}` shows it",
    "a toolpath": "`pathcontrol toolpath {file}` shows what is in it",
    "a page": "open it in a browser",
    "a Python program": "`python {file}` runs it",
}
#: what to do where there is no such file
_ABSENT = {"an experiment": "; `pathcontrol run --example` prints one to start from"}
_RUNS = b"\x89HDF\r\n\x1a\n", b"\x89MCAP0\r\n"  # how netCDF and MCAP begin
_GCODE = re.compile(rb"^[ \t]*(?:[%(;]|[GMNT][0-9])", re.MULTILINE | re.IGNORECASE)
_BEGINNING = 4096


def check_file(path: Path, expected: Kind) -> None:
    """Check that a file exists and is not one of another kind than ``expected``.

    Raises:
        InputError: it does not exist, is a folder, or is of another kind; the message names the command for those.
    """
    if path.is_dir():
        raise InputError(f"{str(path)!r} is a folder, expected the file of {expected}", file=str(path))
    if not path.exists():
        raise InputError(
            f"there is no file {str(path)!r}, expected {expected}{_ABSENT.get(expected, '')}", file=str(path)
        )
    kind = recognise_file(path)
    if kind not in ("", expected):
        raise InputError(
            f"{str(path)!r} is {kind}, expected {expected}: {_COMMANDS[kind].format(file=path)}",
            value=kind,
            file=str(path),
        )


def recognise_file(path: Path) -> str:
    """Return what a file is, by its content or the end of its name; an empty text where that is not known."""
    suffix = path.suffix.lower()
    kinds = {".toml": "an experiment", ".py": "a Python program", ".html": "a page", ".htm": "a page"}
    kinds |= {".urdf": "a robot", ".xacro": "a robot"}
    if suffix in kinds or not path.is_file():
        return kinds.get(suffix, "")
    with path.open("rb") as stream:
        beginning = stream.read(_BEGINNING)
    if beginning.startswith(_RUNS):
        return "a saved run"
    if suffix == ".nc":  # a run, or G-code
        return "a toolpath" if _GCODE.search(beginning) and b"\0" not in beginning else ""
    return "a toolpath" if suffix in _toolpath_suffixes() else ""


def _toolpath_suffixes() -> list[str]:
    """Return the ends of the names of toolpaths."""
    from pathcontrol.toolpaths.read import READERS

    return [suffix for suffixes in READERS for suffix in suffixes]
