"""Runs of straight moves, the greater part of most programs, which are carried out together.

A run changes nothing but the position of the tool, so it needs no interpreter: every line that says anything else, or
cannot be carried out, ends it and is left to :class:`~pathcontrol.toolpaths.gcode.program.Program`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.toolpaths.gcode.modes import Modes
from pathcontrol.toolpaths.gcode.words import PLAIN
from pathcontrol.toolpaths.text import MAX_COORDINATE

_DIGITS = {0: "0", 10: "1"}
_NONE = "nan"  # the text of a missing word


def read_run(texts: Sequence[str], first: int, most: int, position: Sequence[float], modes: Modes) -> tuple[int, Array]:
    """Return the number of lines from ``first`` on that only go on straight, and their end points [m], (k, 3).

    Args:
        texts: the lines of the program, without comments.
        first: the index of the first of them.
        most: the most lines that are taken.
        position: where the tool is before them [m], (3,).
        modes: the modes in force, whose unit and motion, G0 or G1, are known.
    """
    rows = _plain_rows(texts, first, most, modes)
    if not rows:
        return 0, np.empty((0, 3))
    words = np.array([[float(value) for value in column] for column in list(zip(*rows, strict=True))[1:4]]).T
    places = _places(words * modes.known_unit("X").scale, position, absolute=modes.absolute)
    far = np.flatnonzero((np.abs(places) > MAX_COORDINATE).any(1))
    count = int(far[0]) if len(far) else len(rows)
    return count, places[:count][~np.isnan(words[:count]).all(1)]


def _plain_rows(texts: Sequence[str], first: int, most: int, modes: Modes) -> list[tuple[str, ...]]:
    """Return the words of the lines from ``first`` on that are plain and keep the motion and feed in force."""
    rows: list[tuple[str, ...]] = []
    motions, feeds = {None, _DIGITS[modes.motion or 0]}, {_NONE}
    for index in range(first, min(first + most, len(texts))):
        found = PLAIN.fullmatch(texts[index])
        if found is None or found[1] not in motions:
            break
        row = found.groups(_NONE)
        if row[-1] not in feeds:
            if modes.feed_of(float(row[-1])) != modes.feed:
                break
            feeds.add(row[-1])
        rows.append(row)
    return rows


def _places(lengths: Array, position: Sequence[float], *, absolute: bool) -> Array:
    """Return the points (k, 3) that words (k, 3) [m] lead to from a position [m]; NaN stands for no word."""
    if not absolute:
        with np.errstate(invalid="ignore"):  # the first point out of bounds ends the run
            return np.cumsum([position, *np.where(np.isnan(lengths), 0.0, lengths)], axis=0)[1:]
    known = np.concatenate([[position], lengths + 0.0])
    rows = np.where(np.isnan(known), 0, np.arange(len(known))[:, None])
    return np.take_along_axis(known, np.maximum.accumulate(rows), axis=0)[1:]
