"""What the columns of a table of points are."""

from __future__ import annotations

import re
import reprlib
from dataclasses import dataclass

from pathcontrol.errors import ToolpathError

#: units of length of a table: metres in one
UNITS = {"m": 1.0, "mm": 1e-3, "in": 25.4e-3}
#: columns with the coordinates, and with the tool's axis
POINT, AXIS = ["x", "y", "z"], ["i", "j", "k"]
#: column with the name of the contour
CONTOUR = "contour"

_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", None: "blanks"}
_COLUMN = re.compile(r"([a-z]+)(?:_([a-z]+)|\[([a-z]+)\]|\(([a-z]+)\))?")


@dataclass(frozen=True)
class Columns:
    """Names of the columns, the character between them or None for blanks, and the unit that the file names."""

    names: list[str]
    separator: str | None
    unit: str | None = None
    in_file: bool = False

    @classmethod
    def of(cls, line: int, text: str) -> Columns:
        """The columns as the first line of a table names them, or as its number of values says."""
        separator = next((s for s in ";\t," if s in text), None)
        fields = split(text, separator)
        if number(fields[0]) is None:
            if separator is None:  # "x [mm]" is one name
                fields = " ".join(fields).replace(" [", "[").replace(" (", "(").split()
            return cls(*_named(line, fields, separator), in_file=True)
        if len(fields) not in (3, 6):
            raise ToolpathError(
                f"line {line}: {len(fields)} values between {_SEPARATORS[separator]}, expected 3 (x y z) or "
                "6 (x y z i j k), or a first line that names the columns"
            )
        return cls((POINT + AXIS)[: len(fields)], separator)

    def unit_with(self, unit: str | None) -> str:
        """The unit of the coordinates, given the one that the caller names."""
        if unit and self.unit and unit != self.unit:
            raise ToolpathError(f"its columns are in {self.unit!r}, which unit = {unit!r} contradicts")
        return unit or self.unit or "m"

    def index(self, name: str) -> int | None:
        """Where the column is, or None if there is none."""
        return self.names.index(name) if name in self.names else None

    def fields(self, line: int, text: str) -> list[str]:
        """The values in a line, one for each column."""
        fields = split(text, self.separator)
        if len(fields) != len(self.names):
            raise ToolpathError(
                f"line {line}: {len(fields)} values between {_SEPARATORS[self.separator]}, expected {len(self.names)}: "
                f"{' '.join(self.names)}"
            )
        return fields


def split(text: str, separator: str | None) -> list[str]:
    """The values in a line."""
    return [field.strip() for field in text.split(separator)]


def number(field: str) -> float | None:
    """The number that a field is, in ASCII and without the underscores of Python, or None."""
    try:
        return None if "_" in field or not field.isascii() else float(field)
    except ValueError:
        return None


def _named(line: int, fields: list[str], separator: str | None) -> tuple[list[str], str | None, str | None]:
    """Names, separator and unit of columns from the line that names them."""
    found = [_name_and_unit(line, field) for field in fields]
    names = [name for name, _ in found]
    complete = set(POINT) <= set(names) and len(set(AXIS) & set(names)) in (0, 3)
    if not complete or len(set(names)) < len(names):
        raise ToolpathError(
            f"line {line}: columns {reprlib.repr(' '.join(names))}, expected x, y and z, and none or all of i, j and "
            "k, each once"
        )
    units = {unit for name, unit in found if name in POINT}
    if len(units) > 1:
        listed = ", ".join(sorted(repr(unit or "no unit") for unit in units))
        raise ToolpathError(f"line {line}: x, y and z in different units, {listed}, expected the same for all")
    return names, separator, units.pop()


def _name_and_unit(line: int, field: str) -> tuple[str, str | None]:
    match = _COLUMN.fullmatch(field.strip("\"' ").lower().replace(" ", ""))
    name = match[1] if match else ""
    unit = next(filter(None, match.groups()[1:]), None) if match else None
    if name not in [*POINT, *AXIS, CONTOUR] or (unit and (name not in POINT or unit not in UNITS)):
        raise ToolpathError(
            f"line {line}: {reprlib.repr(field)}, expected a number, or as the name of a column x, y or z, perhaps "
            f"with a unit ({', '.join(UNITS)}) as in 'x [mm]', or i, j, k, or {CONTOUR}"
        )
    return name, unit
