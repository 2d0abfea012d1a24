"""Texts in figures: names are drawn letter for letter, and fit into the available room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

_POINTS = 72.0  # points in an inch
_SIZE = 8.0  # pt
_ENTRY = 0.5  # in, of a legend's handle and the gaps around it


def plain(text: str, room: float = 2.0) -> str:
    """Return ``text`` as Matplotlib draws it letter for letter, cut in the middle if longer than ``room`` [in]."""
    return _fit(_replace_invisible(text), room).replace("$", r"\$")


def joint_label(index: int, names: Sequence[str], symbol: str = "q") -> str:
    """Return the symbol of a joint, counted from 1, and its name where it adds something."""
    letter = rf"${symbol}_{{{index + 1}}}$"
    return letter if len(names) <= 2 else f"{letter} ({plain(names[index], 1.3)})"


def legend(figure: Figure, entries: Mapping[str, Any]) -> None:
    """Draw a legend above everything, of handles by their labels (from :func:`plain`), in as many rows as needed.

    Matplotlib leaves out labels that begin with an underscore, so the words are put in afterwards.
    """
    if not entries:
        return
    columns = _columns([_label_width(label) + _ENTRY for label in entries], figure.get_figwidth())
    drawn = figure.legend(
        list(entries.values()),
        [str(i) for i in range(len(entries))],
        loc="outside upper center",
        ncols=columns,
        handlelength=1.6,
        handletextpad=0.5,
        columnspacing=1.2,
        borderpad=0.1,
    )
    for text, label in zip(drawn.get_texts(), entries, strict=True):
        text.set_text(label)


def _columns(widths: Sequence[float], room: float) -> int:
    """Return the most columns, filled one after the other, that fit."""
    for columns in range(len(widths), 1, -1):
        if sum(float(np.max(column)) for column in np.array_split(widths, columns)) <= room:
            return columns
    return 1


def _replace_invisible(text: str) -> str:
    """Return a text with spaces for line breaks, control characters and halves of characters."""
    return "".join(letter if letter.isprintable() else " " for letter in str(text))


def _fit(text: str, room: float) -> str:
    """Return a text cut to fit the room."""
    text = text if len(text) <= 400 else f"{text[:200]}{text[-200:]}"
    kept = len(text)
    while kept > 2 and _width(shown := _cut(text, kept)) > room:
        kept = min(kept - 1, int(kept * max(room / _width(shown), 0.5)) + 1)
    return _cut(text, kept)


def _cut(text: str, kept: int) -> str:
    """Return a text cut in the middle."""
    head = -(-kept // 2)
    return text if kept >= len(text) else f"{text[:head]}…{text[len(text) - (kept - head) :]}"


def _label_width(label: str) -> float:
    """Return the width of a label."""
    letters = label.replace(r"\$", "")
    return _width(label, mathematics=True) if "$" in letters else _width(label.replace(r"\$", "$"))


def _width(text: str, mathematics: bool = False) -> float:
    """Return the width [in] of a text."""
    width, _, _ = text_to_path.get_text_width_height_descent(text, FontProperties(size=_SIZE), mathematics)
    return float(width) / _POINTS
