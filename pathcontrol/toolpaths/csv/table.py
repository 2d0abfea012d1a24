"""The numbers in a table of points."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.csv.columns import Columns
from pathcontrol.toolpaths.csv.header import number
from pathcontrol.toolpaths.csv.names import CONTOUR
from pathcontrol.toolpaths.csv.rows import Rows
from pathcontrol.toolpaths.text import MAX_COORDINATE, MAX_SEGMENTS

_SWAP = str.maketrans({",": ".", ".": "?"})  # a decimal comma; a point is then no part of a number
_UNIT_NORM = 0.01  # how far the norm of a quaternion that was rounded may be from 1
_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+(?:[eE][-+]?[0-9]+)?")
_THOUSANDS = re.compile(r"[-+]?[0-9]{1,3}(?:,[0-9]{3})+")


@dataclass(frozen=True)
class Table:
    """The points of a table, row by row.

    Attributes:
        points: coordinates [m], (k, 3).
        axes: tool axes, unit vectors (k, 3), or None.
        lines: numbers of the lines, (k,).
        labels: names of the contours, (k,), or None.
        starts: the rows that begin a contour.
    """

    points: Array
    axes: Array | None
    lines: list[int]
    labels: list[str] | None
    starts: list[int]

    @classmethod
    def of(cls, rows: Rows, columns: Columns, scale: float, decimal: str, z: float | None) -> Table:
        """Read the table, with coordinates in ``scale`` metres, and z [m] where there is no such column."""
        if len(rows.texts) > MAX_SEGMENTS:
            raise ToolpathError(
                f"line {rows.lines[MAX_SEGMENTS]}: more than {MAX_SEGMENTS} points; split the file",
                line=int(rows.lines[MAX_SEGMENTS]),
            )
        labels, starts = None, {0, *rows.after_gap}
        if (place := columns.places.get(CONTOUR)) is not None:
            _find_wrong_width(rows, columns)
            labels = [rows.fields(text)[place] for text in rows.texts]
            starts |= {row for row in range(1, len(labels)) if labels[row] != labels[row - 1]}
        values = _values(rows, columns, decimal)
        points, axes = scale * values[:, : 3 if z is None else 2], values[:, 3 if z is None else 2 :]
        if z is not None:
            points = np.column_stack([points, np.full(len(points), z)])
        far = np.abs(points).max(1) > MAX_COORDINATE
        if far.any():
            line = rows.lines[int(np.argmax(far))]
            raise ToolpathError(
                f"line {line}: further than {MAX_COORDINATE:g} m from the origin; is the unit right?", line=int(line)
            )
        return cls(points, _axes(axes, rows.lines), rows.lines, labels, sorted(starts))

    @property
    def parts(self) -> Iterator[tuple[int, int]]:
        """The first row of each contour, and the row after its last."""
        return pairwise([*self.starts, len(self.points)])


def decimal_mark(rows: Rows, columns: Columns) -> str:
    """Return ``","`` if the numbers can only have a decimal comma, else ``"."``.

    Raises:
        ToolpathError: commas in the numbers could separate thousands, or points are there too.
    """
    if rows.separator == "," or not any("," in text for text in rows.texts):
        return "."
    commas: dict[str, int] = {}
    points: dict[str, int] = {}
    for line, text in zip(rows.lines, rows.texts, strict=True):
        fields = rows.fields(text)
        for at in columns.numeric.values():
            if at < len(fields):
                if "," in fields[at]:
                    commas.setdefault(fields[at], line)
                elif "." in fields[at]:
                    points.setdefault(fields[at], line)
    if not commas or not all(map(_COMMA.fullmatch, commas)):
        return "."
    if points or all(map(_THOUSANDS.fullmatch, commas)):
        field, line = next(iter(commas.items()))
        raise ToolpathError(
            f"line {line}: is {reprlib.repr(field)} a number with a decimal comma, or with a comma between thousands? "
            "Read the file with decimal=',' or write decimal points alone",
            line=int(line),
        )
    return ","


def _values(rows: Rows, columns: Columns, decimal: str) -> Array:
    """Return the numbers of the columns in their order, (k, columns)."""
    places = list(columns.numeric.values())
    texts = [text.translate(_SWAP) for text in rows.texts] if decimal == "," else rows.texts
    _find_wrong_width(rows, columns)
    try:
        values = np.loadtxt(texts, delimiter=rows.separator, comments=None, usecols=places, ndmin=2)
    except ValueError as error:
        _find_mistake(rows, columns, decimal)
        raise ToolpathError(f"it cannot be read: {error}") from None
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        name = list(columns.numeric)[column]
        raise ToolpathError(
            f"line {rows.lines[row]}: {name} = {values[row, column]}, expected a finite number",
            line=int(rows.lines[row]),
        )
    return values


def _find_wrong_width(rows: Rows, columns: Columns) -> None:
    """Raise for the first line whose number of values is not that of the columns."""
    separator, width = rows.separator, columns.width
    for line, text in zip(rows.lines, rows.texts, strict=True):
        found = len(text.split()) if separator is None else text.count(separator) + 1
        if found != width:
            names = sorted(columns.places, key=columns.places.__getitem__)
            raise ToolpathError(
                f"line {line}: {found} values between {rows.between}, expected {width}: {' '.join(names)}"
                f"{' and what is passed over' if len(names) < width else ''}",
                line=int(line),
            )


def _find_mistake(rows: Rows, columns: Columns, decimal: str) -> None:
    """Raise for the first line in which a value is no number."""
    for line, text in zip(rows.lines, rows.texts, strict=True):
        fields = rows.fields(text)
        for name, at in columns.numeric.items():
            if number(fields[at], decimal) is None:
                mark = "a decimal comma" if decimal == "," else "a decimal point"
                split_up = rows.separator == "," and " " in fields[at]
                comma = decimal == "." and ("," in fields[at] or split_up)
                raise ToolpathError(
                    f"line {line}: {name} = {reprlib.repr(fields[at])}, expected a number with {mark}"
                    f"{', or read the file with decimal=' + repr(',') if comma else ''}",
                    line=int(line),
                )


def _axes(values: Array, lines: list[int]) -> Array | None:
    """Return the tool axes as unit vectors, from i j k or opposite to the z axis of qx qy qz qw."""
    if not values.size:
        return None
    largest = np.abs(values).max(1, keepdims=True)
    if not largest.all():
        line = lines[int(np.argmin(largest))]
        what = "the tool axis i j k is 0 0 0, expected a direction"
        raise ToolpathError(
            f"line {line}: {what if values.shape[1] == 3 else 'the quaternion is 0 0 0 0'}", line=int(line)
        )
    unit = values / largest  # so that squares neither overflow nor vanish
    unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    if values.shape[1] == 3:
        return unit
    off = ~(np.abs(values - unit).max(1) <= _UNIT_NORM)
    if off.any():
        line = lines[int(np.argmax(off))]
        raise ToolpathError(
            f"line {line}: the quaternion qx qy qz qw has not the norm 1; are its columns the right ones?",
            line=int(line),
        )
    x, y, z, w = unit.T
    return np.stack([-2 * (x * z + w * y), 2 * (w * x - y * z), 2 * (x * x + y * y) - 1], axis=-1)
