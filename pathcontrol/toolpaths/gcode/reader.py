"""Reader of tool paths in G-code files."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import as_array, as_scalar, check_finite
from pathcontrol.arguments import Feed, Length, Point
from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.contour import Toolpath
from pathcontrol.toolpaths.gcode.modes import Modes
from pathcontrol.toolpaths.gcode.program import Program
from pathcontrol.toolpaths.gcode.remarks import without_remarks
from pathcontrol.toolpaths.gcode.units import UNITS
from pathcontrol.toolpaths.gcode.words import PERCENT, PLAIN, PROGRAM_NAME, parse, without_comments
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.text import MAX_COORDINATE, read_lines


def read_gcode(
    path: str | os.PathLike[str],
    unit: str | None = None,
    start: Point | None = None,
    feed: Feed | None = None,
    arc_tolerance: Length | None = None,
    unknown: Literal["refuse", "warn"] = "refuse",
) -> Toolpath:
    """Read contours from a G-code program, RS274/NGC as LinuxCNC and most CAM programs write it.

    Cuts (G1, G2 and G3, one after another, at one feed) and rapids (G0, straight) are contours, called by their first
    line: ``"N20"``, or ``"line 14"`` where it has no number. What is not understood is refused, never guessed.

    - Motion: G0, G1, and the arcs G2 and G3 by I J K or R, helices and turns P too, in the planes of G17, G18 and G19;
      the drilling cycles G73, G81, G82 and G83, with G98 and G99, as the moves that they stand for.
    - Modes: G20 inch, G21 mm; G90 absolute, G91 relative; G90.1 and G91.1, the same for centres; G80 no motion; G94,
      F is per minute. At the beginning G17, G90 and G91.1 are in force.
    - No effect here: G4, G15, G40, G43, G49, G61, G61.1, G64, G67, G69, G97, M0, M1, M3-M9, S, T, comments, line
      numbers, program numbers and %. Smoothing (G5 P, G5.1 Q, G187, …), outputs and overrides (M62-M68, M48-M53, …) and
      rotary axes that stay where they are have none either, and are noted in :attr:`Toolpath.notes`.
    - The coordinates are those of the tool's tip in one workpiece frame, one of G54 to G59.3; G92 before the first move
      says where the tool is.
    - M2, M30 and the second % end the program; what follows is not read.
    - Where the tool is at the beginning is in no program. An axis is known once the program gives it absolutely; rapids
      before that are left out, cuts refused. An axis that is named nowhere is 0. After G28, G30 and G53 G0 the axes are
      unknown again.

    Args:
        path: the file.
        unit: ``"mm"`` or ``"in"``, the unit before the program says G20 or G21; by default it must say it.
        start: where the tool is before the first move [m], (3,); by default that is not known.
        feed: speed of the tool [m/s] along cuts before the program says F; by default it must say it.
        arc_tolerance: how much the radii at the ends of an arc may differ [m], for programs whose numbers are rounded
            to 2 or 3 decimals; by default what LinuxCNC allows.
        unknown: ``"refuse"`` words that are not understood, or ``"warn"``, pass those over that cannot move the tool.

    Raises:
        InputError: ``path``, ``unit``, ``start``, ``feed``, ``arc_tolerance`` or ``unknown`` is none.
        ToolpathError: the file cannot be used; the message says in which line and why.
    """
    if unit is not None and unit not in UNITS:
        raise InputError(
            f"unit = {unit!r}, expected one of {', '.join(UNITS)}, or None",
            argument="unit",
            value=unit,
            choices=tuple(UNITS),
        )
    if feed is not None:
        feed = as_scalar("feed", feed, positive=True)
    if arc_tolerance is not None:
        arc_tolerance = as_scalar("arc_tolerance", arc_tolerance, positive=True)
    passed = Notes(unknown)
    texts = [without_comments(line).strip(" \t") for line in read_lines(path, "a G-code program")]
    modes = Modes(None if unit is None else UNITS[unit], feed=feed, arc_tolerance=arc_tolerance)
    program = Program(modes, _start(start, texts), passed)
    try:
        _run(program, texts, passed)
        contours = program.strokes.contours()
        if not contours:
            raise ToolpathError("there is no move in it between places that it gives, expected G0, G1, G2 or G3")
    except ToolpathError as error:
        raise ToolpathError(f"{os.fspath(path)}: {error}", **error.details_with(file=os.fspath(path))) from None
    return Toolpath(contours, os.fspath(path), program.modes.known_unit("the program").name, passed.notes)


def _start(start: ArrayLike | None, texts: list[str]) -> list[float]:
    """Return the position before the first move, NaN where it is not known."""
    if start is None:
        named = [any(axis in text or axis.lower() in text for text in texts) for axis in "XYZ"]
        return [math.nan if known else 0.0 for known in named]
    position = check_finite("start", as_array("start", start))
    if position.shape != (3,):
        raise InputError(f"start has shape {position.shape}, expected (3,)", argument="start", value=start)
    if np.abs(position).max() > MAX_COORDINATE:
        raise InputError(
            f"start = {position.tolist()} m is further than {MAX_COORDINATE:g} m from the origin",
            argument="start",
            value=start,
            limit=MAX_COORDINATE,
        )
    return position.tolist()


def _run(program: Program, texts: Sequence[str], passed: Notes) -> None:
    """Carry out the lines until the program ends; errors name the line."""
    began, number = False, 0
    while number < len(texts):
        text, number = texts[number], number + 1
        try:
            if PERCENT.fullmatch(text):
                if began:
                    return
            elif PROGRAM_NAME.fullmatch(text):
                if began:
                    raise ToolpathError("a second program begins before the first ended with M2, M30 or %")
            elif text := without_remarks(text, number, passed):
                began = True
                if not program.carry_out(parse(text), number):
                    return
                if PLAIN.fullmatch(text):  # lines after other lines are rarely plain, and the test takes time
                    number += program.follow(texts, number)
        except ToolpathError as error:
            raise ToolpathError(f"line {number}: {error}", **error.details_with(line=number)) from None
