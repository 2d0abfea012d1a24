"""Parsers of numbers, lengths and transforms in SVG attributes."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError

# each pattern matches in one way only: no possessive quantifiers, which early releases of Python 3.11 get wrong
_BLANKS = r"[ \t\n\r\f]*"
_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_STRANGE, _BARE_COMMA = re.compile(r"[^-+0-9eE., \t\n\r\f]"), re.compile(rf",{_BLANKS}(?:,|\Z)|\A{_BLANKS},")
_START, _AFTER = re.compile(_BLANKS), f"{_BLANKS}(,?){_BLANKS}"
_FIGURE, _FLAG = re.compile(f"({_NUMBER}){_AFTER}"), re.compile(f"([01]){_AFTER}")
_ARC = (_FIGURE, _FIGURE, _FIGURE, _FLAG, _FLAG, _FIGURE, _FIGURE)
_LENGTH = re.compile(f"{_BLANKS}({_NUMBER})")
_FUNCTION = re.compile(r"[ \t\n\r\f,]*([a-zA-Z0-9]+)[ \t\n\r\f]*\(([^()]*)")
_ANGLE_OR_PX = re.compile(r"(?<=[0-9.])(?:deg|px)\b")
_LARGEST = 1e15
_PER_INCH = {"in": 1.0, "mm": 25.4, "cm": 2.54, "q": 101.6, "pt": 72.0, "pc": 6.0}
_TAKES = {"matrix": (6,), "translate": (1, 2), "scale": (1, 2), "rotate": (1, 3), "skewx": (1,), "skewy": (1,)}


def number(text: str) -> float:
    """Parse a number, whose size must allow calculation."""
    value = float(text)
    if not abs(value) <= _LARGEST:
        raise ToolpathError(
            f"the number {text} is too large, expected at most {_LARGEST:g}", value=value, limit=_LARGEST
        )
    return value


def numbers(text: str, what: str) -> list[float]:
    """Parse numbers separated by blanks or commas."""
    if not (_STRANGE.search(text) or _BARE_COMMA.search(text)):
        with suppress(ValueError):  # two of them without a separator, as in 1-2, or none
            found = list(map(float, text.replace(",", " ").split()))
            if not found or max(max(found), -min(found)) <= _LARGEST:
                return found
    return _scan(text, what)


def _scan(text: str, what: str) -> list[float]:
    """Parse numbers of any form, one after another."""
    start = _START.match(text)
    assert start is not None
    found, at, comma = [], start.end(), ""
    for match in _FIGURE.finditer(text, at):
        if match.start() != at:
            break
        figure, comma = match.groups()
        found.append(figure)
        at = match.end()
    if at < len(text) or comma:
        raise ToolpathError(f"{what} has {_excerpt(text, at)}, expected numbers", value=text)
    return [number(figure) for figure in found]


def arcs(text: str, what: str) -> list[float]:
    """Parse the seven numbers of each arc in path data, whose flags need no separators: ``1 1 0 0110 10``."""
    start = _START.match(text)
    assert start is not None
    found, at, comma = [], start.end(), ""
    while at < len(text) or comma:
        for pattern in _ARC:
            match = pattern.match(text, at)
            if match is None:
                expected = "radii, rotation, two flags 0 or 1, x and y"
                raise ToolpathError(f"{what} has {_excerpt(text, at)}, expected {expected}", value=text)
            figure, comma = match.groups()
            found.append(number(figure))
            at = match.end()
    return found


def _excerpt(text: str, at: int) -> str:
    """Return the text from a position on, shortened; the end of the text if nothing follows."""
    rest = text[at : at + 21]
    return repr(rest[:20] or text[-20:]) + ("…" if len(rest) > 20 else "")


@dataclass(frozen=True)
class Viewport:
    """The reference of lengths: the size of the viewport.

    Attributes:
        width: of the viewport in user units, 100 % of horizontal lengths.
        height: likewise, of vertical ones.
        ppi: user units per inch.
    """

    width: float
    height: float
    ppi: float

    def length(self, text: str, what: str) -> float:
        """Return a length in user units.

        Args:
            text: a number with a unit.
            what: the attribute, which decides what per cent are of.
        """
        match = _LENGTH.match(text)
        unit = text[match.end() :].strip().lower() if match else None
        if match is None or (unit not in ("", "px", "%") and unit not in _PER_INCH):
            raise ToolpathError(f"{what} = {text[:30]!r}, expected a length in px, mm, cm, in, pt, pc or %", value=text)
        value = number(match[1])
        if unit == "%":
            return value / 100 * self._whole(what)
        return value if unit in ("", "px") else value * self.ppi / _PER_INCH[str(unit)]

    def _whole(self, what: str) -> float:
        if what in ("x", "width", "cx", "rx", "x1", "x2"):
            return self.width
        if what in ("y", "height", "cy", "ry", "y1", "y2"):
            return self.height
        return float(np.hypot(self.width, self.height) / np.sqrt(2))


def transform(text: str) -> Array:
    """Parse a transform attribute to its affine map, (4, 4); of several, the last is applied first."""
    total, end = np.eye(4), 0
    if text.strip() in ("", "none"):
        return total
    while (match := _FUNCTION.match(text, end)) and text[match.end() : match.end() + 1] == ")":
        name, end = match[1].lower(), match.end() + 1
        values = numbers(_ANGLE_OR_PX.sub("", match[2]), f"{match[1]}(…)")
        if len(values) not in _TAKES.get(name, ()):
            known = "matrix(6 numbers), translate(1 or 2), scale(1 or 2), rotate(1 or 3), skewX(1), skewY(1)"
            raise ToolpathError(
                f"transform has {match[0].strip()[:59] + ')'!r}, expected {known}", value=match[0].strip()
            )
        with np.errstate(over="ignore", invalid="ignore"):  # an overflow is refused when it is drawn
            total = total @ _plane(*_matrix(name, values))
    if text[end:].strip():
        raise ToolpathError(f"transform has {text[end:][:30]!r}, expected name(numbers)", value=text)
    return total


def _matrix(name: str, v: list[float]) -> tuple[float, ...]:
    """Return (a, b, c, d, e, f) as in matrix(…)."""
    if name == "matrix":
        return tuple(v)
    if name == "translate":
        return 1, 0, 0, 1, v[0], v[1] if len(v) > 1 else 0
    if name == "scale":
        return v[0], 0, 0, v[-1], 0, 0
    if name == "rotate":
        cos, sin = _cos_sin(v[0])
        x, y = v[1:] or (0.0, 0.0)
        return cos, sin, -sin, cos, x - cos * x + sin * y, y - sin * x - cos * y
    tangent = float(np.tan(np.radians(v[0])))
    return (1, 0, tangent, 1, 0, 0) if name == "skewx" else (1, tangent, 0, 1, 0, 0)


def _cos_sin(degrees: float) -> tuple[float, float]:
    """Return cosine and sine, exact at right angles, which are frequent in drawings."""
    quarter, rest = divmod(degrees, 90.0)
    cos, sin = (float(f(np.radians(rest))) for f in (np.cos, np.sin))
    return [(cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos)][int(quarter) % 4]


def _plane(a: float, b: float, c: float, d: float, e: float, f: float) -> Array:
    """Return the affine map (4, 4) of matrix(a, b, c, d, e, f)."""
    return np.array([[a, c, 0, e], [b, d, 0, f], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=np.float64)
