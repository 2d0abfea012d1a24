"""The numbers in a table of points."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.points_columns import AXIS, CONTOUR, POINT, Columns, number
from pathcontrol.toolpaths.text import MAX_COORDINATE, MAX_SEGMENTS


@dataclass
class Rows:
    """The lines that are neither empty nor comments.

    Attributes:
        texts: the lines without comments.
        lines: their numbers.
        after_gap: which of them follow an empty line.
    """

    texts: list[str]
    lines: list[int]
    after_gap: list[int]

    @classmethod
    def of(cls, lines: list[str]) -> Rows:
        """The rows among the lines of a file."""
        rows, gap = cls([], [], []), False
        for line, content in enumerate(lines, 1):
            text = content.partition("#")[0].strip()
            if text:
                if gap:
                    rows.after_gap.append(len(rows.texts))
                rows.texts.append(text)
                rows.lines.append(line)
            gap = not text and (gap or not content.strip())  # a comment is no gap, and ends none
        return rows

    def columns(self) -> Columns:
        """What the columns are; the line that names them is taken out."""
        if not self.texts:
            raise ToolpathError("there is no point in it, expected lines of x y z, or x y z i j k")
        columns = Columns.of(self.lines[0], self.texts[0])
        if columns.in_file:
            del self.texts[0], self.lines[0]
            self.after_gap = [row - 1 for row in self.after_gap if row]
        if not self.texts:
            raise ToolpathError("there is no point in it, only the names of columns")
        if len(self.texts) > MAX_SEGMENTS:
            raise ToolpathError(f"line {self.lines[MAX_SEGMENTS]}: more than {MAX_SEGMENTS} points; split the file")
        return columns


@dataclass(frozen=True)
class Table:
    """Points, row by row.

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
    def of(cls, rows: Rows, columns: Columns, scale: float) -> Table:
        """The table with the coordinates in ``scale`` metres."""
        labels, starts = None, {0, *rows.after_gap}
        if (label := columns.index(CONTOUR)) is not None:
            fields = (columns.fields(line, text) for line, text in zip(rows.lines, rows.texts, strict=True))
            labels = [row[label] for row in fields]
            starts |= {row for row in range(1, len(labels)) if labels[row] != labels[row - 1]}
        values = _values(rows, columns)
        points, axes = scale * values[:, :3], values[:, 3:]
        far = np.abs(points).max(1) > MAX_COORDINATE
        if far.any():
            line = rows.lines[int(np.argmax(far))]
            raise ToolpathError(f"line {line}: further than {MAX_COORDINATE:g} m from the origin; is the unit right?")
        return cls(points, _unit(axes, rows.lines) if axes.size else None, rows.lines, labels, sorted(starts))

    @property
    def parts(self) -> Iterator[tuple[int, int]]:
        """First row of each contour, and the row after its last."""
        return pairwise([*self.starts, len(self.points)])


def _values(rows: Rows, columns: Columns) -> Array:
    """The numbers, x y z first, then i j k if there are any, (k, 3 or 6)."""
    order = [name for name in POINT + AXIS if name in columns.names]
    numeric = [name for name in columns.names if name != CONTOUR]
    use = None if numeric == columns.names else [columns.names.index(name) for name in numeric]
    try:
        values = np.loadtxt(rows.texts, delimiter=columns.separator, comments=None, usecols=use, ndmin=2)
        if values.shape[1] != len(numeric):
            raise ValueError(f"{values.shape[1]} columns")
    except ValueError as error:
        _find_mistake(rows, columns)
        raise ToolpathError(f"it cannot be read: {error}") from None
    values = values[:, [numeric.index(name) for name in order]]
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise ToolpathError(
            f"line {rows.lines[row]}: {order[column]} = {values[row, column]}, expected a finite number"
        )
    return values


def _find_mistake(rows: Rows, columns: Columns) -> None:
    """Raise for the first line that has not one number for each column."""
    for line, text in zip(rows.lines, rows.texts, strict=True):
        for name, field in zip(columns.names, columns.fields(line, text), strict=True):
            if name != CONTOUR and number(field) is None:
                found = reprlib.repr(field)
                raise ToolpathError(f"line {line}: {name} = {found}, expected a number with a decimal point")


def _unit(axes: Array, lines: list[int]) -> Array:
    """Tool axes as unit vectors."""
    largest = np.abs(axes).max(1, keepdims=True)
    if not largest.all():
        line = lines[int(np.argmin(largest))]
        raise ToolpathError(f"line {line}: the tool axis i j k is 0 0 0, expected a direction")
    axes = axes / largest  # so that squares neither overflow nor vanish
    return axes / np.linalg.norm(axes, axis=-1, keepdims=True)
