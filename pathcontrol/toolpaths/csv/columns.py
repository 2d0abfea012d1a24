"""The meaning of the columns of a table of points, from the file's names, their number, or the caller."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.csv.header import Header
from pathcontrol.toolpaths.csv.names import AXIS, KNOWN, POINT, QUATERNION, Name
from pathcontrol.toolpaths.csv.rows import Rows
from pathcontrol.toolpaths.notes import Notes

#: the ways to name columns
Chosen = Sequence[str] | Mapping[str, int | str]
_MOST_LISTED = 8
_ANGLES = ({"roll", "pitch", "yaw"}, {"rx", "ry", "rz"}, {"a", "b", "c"}, {"w", "p", "r"})
_ANGLES_UNREAD = (
    ": of angles nothing is read, as programs differ in their order and unit; orientations are read as i j k, the "
    "direction away from the surface, or as quaternions qx qy qz qw"
)


@dataclass(frozen=True)
class Columns:
    """The position of each known column, the number of columns, and the unit that the file names."""

    places: dict[str, int]
    width: int
    unit: str | None = None

    @classmethod
    def of(cls, rows: Rows, chosen: Chosen | None, passed: Notes, *, flat: bool) -> Columns:
        """Find the columns of the rows, and take the line that names them out of the rows.

        Args:
            rows: the lines of the table.
            chosen: which columns are what, or None for what the file says.
            passed: columns that are passed over are noted there.
            flat: whether z is given by the caller.

        Raises:
            ToolpathError: the columns make up no points.
        """
        header = Header.of(rows)
        names = _names(rows, header, chosen, flat=flat)
        places = {name: k for k, name in enumerate(names) if name}
        if (mistake := _find_mistake(names, places, flat=flat)) is not None:
            there = reprlib.repr(" ".join(name.text for name in header.names) or " ".join(names))
            raise ToolpathError(f"line {header.line}: columns {there}, {mistake}", line=int(header.line))
        _note_unused(_name_columns(header, chosen), places, passed)
        rows.trim(header.width)
        return cls(places, header.width, header.unit(places))

    @property
    def numeric(self) -> dict[str, int]:
        """The columns of numbers, x y z first."""
        return {name: self.places[name] for name in (*POINT, *AXIS, *QUATERNION) if name in self.places}

    def unit_with(self, unit: str | None) -> str:
        """Return the unit of the coordinates, given the one that the caller names."""
        if unit and self.unit and unit != self.unit:
            raise ToolpathError(
                f"its columns are in {self.unit!r}, which unit = {unit!r} contradicts", argument="unit", value=unit
            )
        return unit or self.unit or "m"


def check_choice(chosen: Any) -> Chosen | None:
    """Check ``columns`` of a caller: names in order, or a place for each name; a text lists either.

    Raises:
        InputError: it is neither.
    """
    if chosen is None:
        return None
    given = _split_names(chosen) if isinstance(chosen, str) else chosen
    if isinstance(given, Mapping) and given and all(isinstance(name, str) and Name.of(name).name for name in given):
        if all(isinstance(at, str) or (isinstance(at, int) and not isinstance(at, bool)) for at in given.values()):
            return {Name.of(name).name: at for name, at in given.items()}
    elif isinstance(given, list | tuple) and given and all(isinstance(name, str) for name in given):
        return given
    raise InputError(
        f"columns = {reprlib.repr(chosen)}, expected names in the order of the file, such as ('x', 'y', 'z', 'i', 'j', "
        "'k'), or for each name a number from 0 or the name that the file gives it, such as {'x': 0, 'y': 'Pos Y', "
        f"'z': 2}}; names are {', '.join(KNOWN)}",
        argument="columns",
        value=chosen,
    )


def _split_names(text: str) -> list[str] | dict[str, int | str]:
    """Split ``x,y,z`` into names, ``x=0,y=Pos Y,z=2`` into places."""
    if "=" not in text:
        return [name for name in re.split(r"[,;\s]+", text) if name]
    pairs = [item.partition("=") for item in text.split(",")]
    return {name.strip(): int(at) if re.fullmatch(r"\s*[0-9]{1,6}\s*", at) else at.strip() for name, _, at in pairs}


def _names(rows: Rows, header: Header, chosen: Chosen | None, *, flat: bool) -> list[str]:
    """Return the name of each column, empty for one that is passed over."""
    if isinstance(chosen, Mapping):
        names = [""] * header.width
        for name, at in chosen.items():
            names[header.place(at)] = name
        return names
    if chosen is not None:
        if len(chosen) > header.width:
            raise ToolpathError(
                f"columns= names {len(chosen)} columns, the file has {header.width}",
                argument="columns",
                value=chosen,
                limit=header.width,
            )
        return [Name.of(name).name for name in chosen]
    if header.names:
        return [name.name for name in header.names]
    if header.width != (2 if flat else 3):
        reason = "x y alone need z=, their height in metres" if header.width == 2 else _UNNAMED
        if flat and header.width == 3:
            reason = "z= is for tables of x and y alone: leave it out"
        raise ToolpathError(
            f"line {header.line}: {header.width} values between {rows.between} and no names of columns, expected "
            f"{'2 (x y)' if flat else '3 (x y z)'}; {reason}",
            line=int(header.line),
        )
    return POINT[: header.width]


_UNNAMED = (
    "whether others are normals, angles or colours is not guessed: name them in the first line, or read the file with "
    "columns=('x', 'y', 'z', 'i', 'j', 'k') or the like"
)


def _find_mistake(names: list[str], places: Mapping[str, int], *, flat: bool) -> str | None:
    """Return the reason why columns form no points, or None."""
    once = len(places) == sum(map(bool, names))
    point = {"x", "y"} | (set() if flat else {"z"})
    parts = [len(places.keys() & group) in (0, len(group)) for group in (set(AXIS), set(QUATERNION))]
    if flat and "z" in places:
        return "expected no z where z= is given"
    if not flat and {"x", "y"} <= places.keys() and "z" not in places:
        return "expected z too; a table of x and y alone needs z=, their height in metres"
    if set(AXIS) | set(QUATERNION) <= places.keys():
        return "expected a normal or an orientation, not both: choose by columns="
    if once and point <= places.keys() and all(parts):
        return None
    return (
        f"expected {'x and y' if flat else 'x, y and z'}, and none or all of i, j and k, or of qx, qy, qz and qw, each "
        "once; if they have other names or units, say which they are by columns= and unit="
    )


def _name_columns(header: Header, chosen: Chosen | None) -> list[str]:
    """Return the name of each column: by the file, else by the caller, else by its number."""
    if header.names:
        return [name.text for name in header.names]
    said = [] if chosen is None or isinstance(chosen, Mapping) else chosen
    return [said[k] if k < len(said) and said[k].strip("_- ") else str(k) for k in range(header.width)]


def _note_unused(texts: Sequence[str], places: Mapping[str, int], passed: Notes) -> None:
    """Note the columns that are passed over."""
    unread = [text for k, text in enumerate(texts) if k not in places.values()]
    if unread:
        listed = ", ".join(map(reprlib.repr, unread[:_MOST_LISTED])) + (", …" if len(unread) > _MOST_LISTED else "")
        many = len(unread) > 1
        stems = {re.split(r"[\s_(\[]", text.lower())[0] for text in unread}
        why = _ANGLES_UNREAD if any(angles <= stems for angles in _ANGLES) else ""
        passed.add(f"column{'s' * many} {listed} {'are' if many else 'is'} passed over{why}")
