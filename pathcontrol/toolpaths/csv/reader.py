"""Reader of tool paths in tables of points: CSV, tab-separated, or columns between blanks."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.arguments import Feed, Form, Unit
from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.csv.columns import Columns, check_choice
from pathcontrol.toolpaths.csv.names import CONTOUR, UNITS, hint_of_unit
from pathcontrol.toolpaths.csv.rows import Rows
from pathcontrol.toolpaths.csv.table import Table, decimal_mark
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.segments.segment import SAME_POINT, Polyline
from pathcontrol.toolpaths.text import read_lines


def read_csv(
    path: str | os.PathLike[str],
    unit: str | None = None,
    feed: Feed | None = None,
    columns: Annotated[str | Sequence[str] | Mapping[str, int | str], Form.COLUMNS] | None = None,
    decimal: Literal[".", ","] | None = None,
    z: Annotated[float, Unit("m")] | None = None,
    unknown: Literal["refuse", "warn"] = "refuse",
) -> Toolpath:
    """Read contours from a table of points, a point a line: ``x y z``, with axis or orientation of the tool if any.

    Semicolons, tabs, commas or blanks separate the values; the first line says which. It may name the columns, in any
    order and with the unit: ``x [mm]``, ``x / mm`` or ``x_mm``, and so may a comment above, or a line of units below.
    Three columns need no names, others do. A ``#`` begins a comment. Values may be quoted, lines may end in separators.

    - ``x y z``: the point. ``i j k``, also called ``nx ny nz``: the tool's axis, the direction that stands on the
      surface; it is normalised.
    - ``qx qy qz qw``: the orientation of the tool's frame as a unit quaternion in the order of ROS, w last. Of it the
      axis is kept, against which the tool's z axis points; how the tool is turned about it is not.
    - ``contour``: the name of the contour, a text; another value begins a new contour, and so does an empty line.
    - Columns with other names are passed over, and noted in :attr:`Toolpath.notes`.

    A contour without a name is called by its first line. A point that repeats the one before it is left out. A contour
    is closed if its last point, and tool axis, repeat the first.

    Args:
        path: the file.
        unit: unit of the coordinates: ``"m"``, ``"cm"``, ``"mm"``, ``"um"`` or ``"in"``. By default the one that the
            file names, else metres, as everywhere in this package.
        feed: speed of the tool along the contours [m/s], which a table does not give.
        columns: what the columns are, whatever the file calls them: names in the order of the file, as ``("x", "y",
            "z", "nx", "ny", "nz")``, of which any other, such as ``"_"``, passes a column over; or for each name a
            number from 0 or the name in the file, as ``{"x": 0, "y": "Pos Y", "z": 2}``; or either as a text:
            ``"x,y,z"`` or ``"x=0,y=Pos Y,z=2"``.
        decimal: ``"."`` or ``","``, the mark in the numbers. By default it is found out: a comma is one only where
            nothing else can be meant, and that is noted.
        z: height of all points [m], for tables of x and y alone.
        unknown: ``"refuse"`` or ``"warn"``, as for the other readers; a table has nothing that makes a difference.

    Raises:
        InputError: an argument is none of these.
        ToolpathError: the file cannot be used; the message says in which line and why.
    """
    passed, chosen = Notes(unknown), check_choice(columns)
    _check_choice("unit", unit, [*UNITS])
    _check_choice("decimal", decimal, [".", ","])
    feed = None if feed is None else as_scalar("feed", feed, positive=True)
    z = None if z is None else as_scalar("z", z)
    lines = read_lines(path, "a table of points")
    try:
        rows = Rows.of(lines, decimal)
        found = Columns.of(rows, chosen, passed, flat=z is not None)
        unit = found.unit_with(unit) if unit or found.unit else _assume_metres(rows, passed)
        table = Table.of(rows, found, UNITS[unit], decimal or _decimal(rows, found, passed), z)
        contours = [_contour(table, first, end, feed) for first, end in table.parts]
    except ToolpathError as error:
        raise ToolpathError(f"{os.fspath(path)}: {error}", **error.details_with(file=os.fspath(path))) from None
    if "qx" in found.places:
        passed.add("of the orientations qx qy qz qw the tool's z axis is kept, not how it is turned about that")
    return Toolpath(tuple(contours), os.fspath(path), unit, passed.notes)


def _check_choice(name: str, value: str | None, choices: list[str]) -> None:
    if value is not None and value not in choices:
        raise InputError(
            f"{name} = {value!r}, expected one of {', '.join(choices)}, or None",
            argument=name,
            value=value,
            choices=tuple(choices),
        )


def _assume_metres(rows: Rows, passed: Notes) -> str:
    """Return metres, with a note if a comment hints at another unit."""
    for line, comment in rows.comments:
        if (word := hint_of_unit(comment)) is not None:
            passed.add(
                f"line {line} speaks of {word!r}, but the coordinates are taken for metres: give unit= if they are not"
            )
            break
    return "m"


def _decimal(rows: Rows, columns: Columns, passed: Notes) -> str:
    """Return the decimal mark of the numbers."""
    mark = decimal_mark(rows, columns)
    if mark == ",":
        passed.add("the numbers have a decimal comma")
    return mark


def _contour(table: Table, first: int, end: int, feed: float | None) -> Contour:
    """Return the contour of the rows from ``first`` to before ``end``."""
    points = table.points[first:end]
    kept = _distinct_indices(points)
    if len(kept) < 2:
        raise ToolpathError(
            f"line {table.lines[first]}: the contour that begins here is one point, expected at least two that differ; "
            f"an empty line, or another value in the column {CONTOUR!r}, begins the next contour",
            line=int(table.lines[first]),
        )
    closed = len(kept) > 2 and math.dist(points[0], points[kept[-1]]) <= SAME_POINT
    axes = None
    if table.axes is not None:
        axes = table.axes[first:end]
        _check_axes(axes, kept, table.lines[first:end])
        axes = axes[kept]
        closed = closed and bool(np.abs(axes[0] - axes[-1]).max() <= SAME_POINT)
    name = table.labels[first] if table.labels else f"line {table.lines[first]}"
    return Contour((Polyline(points[kept]),), closed, feed, name=name, normals=axes)


def _distinct_indices(points: Array) -> Array:
    """Return the indices of the points that do not repeat the last one kept before them."""
    places, kept = points.tolist(), [0]
    for index, place in enumerate(places):
        if math.dist(place, places[kept[-1]]) > SAME_POINT:
            kept.append(index)
    return np.array(kept)


def _check_axes(axes: Array, kept: Array, lines: list[int]) -> None:
    """Check that no point that is left out turns the tool."""
    stays = np.repeat(kept, np.diff([*kept, len(axes)]))
    turned = np.abs(axes - axes[stays]).max(1) > SAME_POINT
    if turned.any():
        line = lines[int(np.argmax(turned))]
        raise ToolpathError(
            f"line {line}: the tool axis turns on the spot, expected another point, or the same axis", line=int(line)
        )
