"""The header of a table of points: names of columns in a first line or a comment, and a line of units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.csv.names import POINT, Name, names_in, unit_in, unit_of_row
from pathcontrol.toolpaths.csv.rows import Rows, separator_of, split


@dataclass(frozen=True)
class Header:
    """The names that a file gives its columns.

    Attributes:
        names: one for each column, or none.
        width: how many columns there are.
        line: where the names are, or the first line of the table.
        said: the unit that another line gives, or None.
    """

    names: list[Name]
    width: int
    line: int
    said: str | None

    @classmethod
    def of(cls, rows: Rows) -> Header:
        """Read the header of a table, and take it out of its rows."""
        line, first = rows.lines[0], rows.texts[0]
        names = names_in(_fields(first, rows.separator))
        said = next(filter(None, (unit_in(text) for _, text in rows.comments)), None)
        if _are_names(names, rows.fields(first)):
            rows.take_first()
            if (unit := unit_of_row(rows.fields(rows.texts[0]))) is not None:
                rows.take_first()
            above = _in_comments(rows, len(names))
            return cls(names, len(names), line, unit or said or _unit_of(above[1] if above else []))
        width = len(names)
        above = _in_comments(rows, width)
        if above is None:
            return cls([], width, line, said)
        names = [name._replace(unit=name.unit or said) if name.name in POINT else name for name in above[1]]
        return cls(names, width, above[0], said)

    def place(self, at: int | str) -> int:
        """Return the index of a column, given by a number or a name in the file.

        Raises:
            ToolpathError: there is none.
        """
        if isinstance(at, int):
            if not 0 <= at < self.width:
                raise ToolpathError(
                    f"columns= names column {at}, the file has the columns 0 to {self.width - 1}",
                    argument="columns",
                    value=at,
                    limit=(0, self.width - 1),
                )
            return at
        wanted = at.lower().replace(" ", "")
        for spell in (lambda name: name.plain, lambda name: name.plain.partition("[")[0].partition("(")[0]):
            found = [k for k, name in enumerate(self.names) if spell(name) == wanted]
            if len(found) == 1:
                return found[0]
        there = ", ".join(repr(name.text) for name in self.names[:20]) or "none that have names"
        raise ToolpathError(
            f"columns= names a column {at!r}, the file has {there}",
            argument="columns",
            value=at,
            choices=tuple(name.text for name in self.names),
        )

    def unit(self, places: Mapping[str, int]) -> str | None:
        """Return the unit of the coordinates, given their columns.

        Raises:
            ToolpathError: they have different ones.
        """
        units = {self.names[places[name]].unit for name in POINT if name in places} if self.names else {None}
        if len(units) > 1:
            listed = ", ".join(sorted(repr(unit or "no unit") for unit in units))
            raise ToolpathError(
                f"line {self.line}: x, y and z in different units, {listed}, expected the same for all",
                line=int(self.line),
            )
        return units.pop() or self.said


def number(field: str, decimal: str = ".") -> float | None:
    """Convert a field to a number, in ASCII and without underscores, or return None."""
    if decimal == ",":
        field = "?" if "." in field else field.replace(",", ".")
    try:
        return None if "_" in field or not field.isascii() else float(field)
    except ValueError:
        return None


def _fields(text: str, separator: str | None) -> list[str]:
    """Split a line into names; between blanks, ``x [mm]`` is one name."""
    if separator is None:
        text = " ".join(text.split()).replace(" [", "[").replace(" (", "(")
    return split(text, separator)


def _are_names(names: list[Name], fields: list[str]) -> bool:
    """Return whether a line names columns: no value is a number, or x and y are among them."""
    numbers = (number(field, mark) is not None for field in fields for mark in ".,")
    return {"x", "y"} <= {name.name for name in names} or not any(numbers)


def _in_comments(rows: Rows, width: int) -> tuple[int, list[Name]] | None:
    """Return line and names of the last comment above the points that names as many columns, or None."""
    for line, text in reversed(rows.comments):
        for separator in (rows.separator, separator_of(text), None):
            names = names_in(_fields(text, separator))
            if {"x", "y"} <= {name.name for name in names} and len(names) == width:
                return line, names
    return None


def _unit_of(names: list[Name]) -> str | None:
    """Return the unit that all coordinates among names have, or None."""
    units = {name.unit for name in names if name.name in POINT}
    return units.pop() if len(units) == 1 else None
