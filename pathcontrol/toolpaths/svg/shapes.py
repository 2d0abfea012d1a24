"""Basic shapes of SVG as subpaths, as defined in https://www.w3.org/TR/SVG2/shapes.html."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.pieces import EllipticArc
from pathcontrol.toolpaths.svg.attributes import Viewport, numbers
from pathcontrol.toolpaths.svg.path_data import parse_path
from pathcontrol.toolpaths.svg.pen import Pen, Subpath

#: the value of an attribute or style property by its name, or None
Attributes = Callable[[str], str | None]


def subpaths(tag: str, get: Attributes, viewport: Viewport) -> list[Subpath]:
    """Return the subpaths of a shape element, in user units; none if its size is 0.

    Args:
        tag: ``"path"``, ``"rect"``, ``"circle"``, ``"ellipse"``, ``"line"``, ``"polyline"`` or ``"polygon"``.
        get: its attributes.
        viewport: what its lengths refer to.
    """
    if tag == "path":
        return parse_path(get("d") or "") if get("d") != "none" else []
    if tag in ("polyline", "polygon"):
        return _poly(numbers(get("points") or "", "points"), tag == "polygon")
    lengths = _Lengths(get, viewport)
    if tag == "line":
        return _line(lengths)
    return _rect(lengths) if tag == "rect" else _round(tag, lengths)


#: the elements that :func:`subpaths` knows
SHAPES = frozenset({"path", "rect", "circle", "ellipse", "line", "polyline", "polygon"})


class _Lengths:
    """The lengths among the attributes of an element."""

    def __init__(self, get: Attributes, viewport: Viewport) -> None:
        self._get, self._viewport = get, viewport

    def __call__(self, name: str) -> float:
        text = self._get(name)
        return 0.0 if text is None else self._viewport.length(text, name)

    def size(self, name: str) -> float | None:
        """Return a length that must not be negative; None where it is ``auto`` or missing."""
        text = self._get(name)
        if text is None or text.strip() == "auto":
            return None
        value = self._viewport.length(text, name)
        if value < 0:
            raise ToolpathError(f"{name} = {text!r}, expected a length not below 0", value=text, limit=0.0)
        return value


def _poly(values: list[float], closed: bool) -> list[Subpath]:
    """Return the subpath of a polyline or polygon."""
    if len(values) % 2:
        raise ToolpathError(f"points has {len(values)} numbers, expected x and y of each point", value=len(values))
    pen = Pen()
    for i, point in enumerate(zip(values[::2], values[1::2], strict=True)):
        (pen.line if i else pen.move)(complex(*point))
    if closed:
        pen.close()
    return pen.subpaths()


def _line(length: _Lengths) -> list[Subpath]:
    """Return the subpath of a line."""
    pen = Pen()
    pen.move(complex(length("x1"), length("y1")))
    pen.line(complex(length("x2"), length("y2")))
    return pen.subpaths()


def _rect(length: _Lengths) -> list[Subpath]:
    """Return the subpath of a rectangle."""
    width, height = length.size("width") or 0.0, length.size("height") or 0.0
    if width == 0 or height == 0:
        return []
    rx, ry = length.size("rx"), length.size("ry")
    rx, ry = (ry if rx is None else rx) or 0.0, (rx if ry is None else ry) or 0.0
    rx, ry = min(rx, width / 2), min(ry, height / 2)
    left, top = length("x"), length("y")
    right, bottom = left + width, top + height
    pen = Pen()
    pen.move(complex(left + rx, top))
    for before, after in (
        (complex(right - rx, top), complex(right, top + ry)),
        (complex(right, bottom - ry), complex(right - rx, bottom)),
        (complex(left + rx, bottom), complex(left, bottom - ry)),
        (complex(left, top + ry), complex(left + rx, top)),
    ):
        pen.line(before)
        pen.arc(rx, ry, 0.0, 0.0, 1.0, after)
    pen.close()
    return pen.subpaths()


def _round(tag: str, length: _Lengths) -> list[Subpath]:
    """Return the subpath of a circle or ellipse."""
    names = ("r", "r") if tag == "circle" else ("rx", "ry")
    first, second = (length.size(name) for name in names)
    rx, ry = (second if first is None else first) or 0.0, (first if second is None else second) or 0.0
    if rx == 0 or ry == 0:
        return []
    center = np.array([length("cx"), length("cy"), 0.0])
    whole = EllipticArc(center, np.array([rx, 0.0, 0.0]), np.array([0.0, ry, 0.0]), 0.0, 2 * pi)
    return [Subpath([whole], closed=True)]
