"""A parser of path data of SVG: all commands, by the grammar of https://www.w3.org/TR/SVG2/paths.html."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.svg.attributes import arcs, numbers
from pathcontrol.toolpaths.svg.pen import Pen, Subpath

_COMMAND = re.compile("([MmZzLlHhVvCcSsQqTtAa])")
_BLANK = " \t\n\f\r"  # of the grammar, in which other spaces of Unicode are letters
_TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7}


def parse_path(data: str) -> list[Subpath]:
    """Return the subpaths of the d attribute of a path.

    Raises:
        ToolpathError: it does not follow the grammar; nothing is drawn up to the mistake.
    """
    before, *parts = _COMMAND.split(data)
    if before.strip(_BLANK) or (parts and parts[0] not in "Mm"):
        raise ToolpathError(
            f"path data begins with {data.strip(_BLANK)[:20]!r}, expected M or m: where the pen is set down",
            value=data.strip(_BLANK),
        )
    pen = Pen()
    for letter, arguments in zip(parts[::2], parts[1::2], strict=True):
        _draw(pen, letter, arguments)
    return pen.subpaths()


def _draw(pen: Pen, letter: str, arguments: str) -> None:
    """Draw one command with all its arguments."""
    name, relative = letter.upper(), letter.islower()
    if name == "Z":
        if arguments.strip(_BLANK):
            raise ToolpathError(
                f"path data has {arguments.strip(_BLANK)[:20]!r} after {letter}, expected a command",
                value=arguments.strip(_BLANK),
            )
        pen.close()
        return
    values, size = (arcs if name == "A" else numbers)(arguments, f"path data after {letter}"), _TAKES[name]
    if not values or len(values) % size:
        raise ToolpathError(
            f"path data has {len(values)} numbers after {letter}, expected {size} or a multiple: {arguments[:30]!r}",
            value=len(values),
            limit=size,
        )
    if name in _RUNS and len(values) > size:
        points = np.array(values[::2]) + 1j * np.array(values[1::2])
        _RUNS[name](pen, points.reshape(-1, size // 2), relative)
        return
    for i in range(0, len(values), size):
        origin = pen.at if relative else 0j
        _STROKES[name](pen, origin, *values[i : i + size])
        name = "L" if name == "M" else name


def _cubic(pen: Pen, o: complex, *v: float) -> None:
    pen.curve(o + complex(*v[:2]), o + complex(*v[2:4]), o + complex(*v[4:]))


def _smooth_cubic(pen: Pen, o: complex, *v: float) -> None:
    pen.curve(pen.reflection("C"), o + complex(*v[:2]), o + complex(*v[2:]))


_RUNS: dict[str, Callable[..., None]] = {"L": Pen.lines, "C": Pen.curves, "Q": Pen.curves}
_STROKES: dict[str, Callable[..., None]] = {
    "M": lambda pen, o, x, y: pen.move(o + complex(x, y)),
    "L": lambda pen, o, x, y: pen.line(o + complex(x, y)),
    "H": lambda pen, o, x: pen.line(complex(o.real + x, pen.at.imag)),
    "V": lambda pen, o, y: pen.line(complex(pen.at.real, o.imag + y)),
    "C": _cubic,
    "S": _smooth_cubic,
    "Q": lambda pen, o, x1, y1, x, y: pen.curve(o + complex(x1, y1), o + complex(x, y)),
    "T": lambda pen, o, x, y: pen.curve(pen.reflection("Q"), o + complex(x, y)),
    "A": lambda pen, o, rx, ry, turn, large, sweep, x, y: pen.arc(rx, ry, turn, large, sweep, o + complex(x, y)),
}
