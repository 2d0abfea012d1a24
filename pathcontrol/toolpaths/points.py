"""Tool paths from tables of points: CSV, tab-separated, or columns between blanks."""

from __future__ import annotations

import math
import os

import numpy as np

from pathcontrol._arrays import Array, scalar
from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.passed import Passed
from pathcontrol.toolpaths.points_columns import CONTOUR, UNITS
from pathcontrol.toolpaths.points_table import Rows, Table
from pathcontrol.toolpaths.segments import Polyline
from pathcontrol.toolpaths.text import read_lines

_NOTHING = 1e-9  # m, points nearer than this are the same, as are tool axes


def read_csv(
    path: str | os.PathLike[str], unit: str | None = None, feed: float | None = None, unknown: str = "refuse"
) -> Toolpath:
    """Contours from a table of points, a point a line: ``x y z``, or ``x y z i j k`` with the tool's axis.

    Semicolons, tabs, commas or blanks separate the values; the first line says which. It may name the columns, in any
    order and with the unit: ``x [mm]``, ``x (mm)`` or ``x_mm``. A ``#`` begins a comment. An empty line begins a new
    contour, and so does another value in a column ``contour``, which may be text and is then the contour's name; else
    that is the number of its first line. A point that repeats the one before it is left out. A contour is closed if its
    last point, and tool axis, repeat the first. Tool axes are normalised.

    Args:
        path: the file.
        unit: unit of the coordinates: ``"m"``, ``"mm"`` or ``"in"``. By default the one that the first line names, else
            metres, as everywhere in this package.
        feed: speed of the tool along the contours [m/s], which a table does not give.
        unknown: ``"refuse"`` or ``"warn"``, as for the other readers.

    Raises:
        InputError: ``path``, ``unit``, ``feed`` or ``unknown`` is none.
        ToolpathError: the file cannot be used; the message says in which line and why.
    """
    if unit is not None and unit not in UNITS:
        raise InputError(f"unit = {unit!r}, expected one of {', '.join(UNITS)}, or None")
    if feed is not None:
        feed = scalar("feed", feed, positive=True)
    passed = Passed(unknown)
    rows = Rows.of(read_lines(path, "a table of points"))
    try:
        columns = rows.columns()
        unit = columns.unit_with(unit)
        table = Table.of(rows, columns, UNITS[unit])
        contours = [_contour(table, first, end, feed) for first, end in table.parts]
    except ToolpathError as error:
        raise ToolpathError(f"{os.fspath(path)}: {error}") from None
    return Toolpath(tuple(contours), os.fspath(path), unit, passed.notes)


def _contour(table: Table, first: int, end: int, feed: float | None) -> Contour:
    """The contour of the rows from ``first`` to before ``end``."""
    points = table.points[first:end]
    kept = _distinct(points)
    if len(kept) < 2:
        raise ToolpathError(
            f"line {table.lines[first]}: the contour that begins here is one point, expected at least two that differ; "
            f"an empty line, or another value in the column {CONTOUR!r}, begins the next contour"
        )
    closed = len(kept) > 2 and math.dist(points[0], points[kept[-1]]) <= _NOTHING
    axes = None
    if table.axes is not None:
        axes = table.axes[first:end]
        _check_axes(axes, kept, table.lines[first:end])
        axes = axes[kept]
        closed = closed and bool(np.abs(axes[0] - axes[-1]).max() <= _NOTHING)
    name = table.labels[first] if table.labels else f"line {table.lines[first]}"
    return Contour((Polyline(points[kept]),), closed, feed, name=name, normals=axes)


def _distinct(points: Array) -> Array:
    """Indices of the points that do not repeat the last one kept before them."""
    places, kept = points.tolist(), [0]
    for index, place in enumerate(places):
        if math.dist(place, places[kept[-1]]) > _NOTHING:
            kept.append(index)
    return np.array(kept)


def _check_axes(axes: Array, kept: Array, lines: list[int]) -> None:
    """Raise if a point that is left out turns the tool."""
    stays = np.repeat(kept, np.diff([*kept, len(axes)]))
    turned = np.abs(axes - axes[stays]).max(1) > _NOTHING
    if turned.any():
        line = lines[int(np.argmax(turned))]
        raise ToolpathError(f"line {line}: the tool axis turns on the spot, expected another point, or the same axis")
