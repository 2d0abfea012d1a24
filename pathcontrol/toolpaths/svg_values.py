"""Numbers, lengths and transforms as attributes of SVG write them."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError

# atomic groups, (?>…), and possessive *+ keep hostile text from being matched in more than one way
NUMBER = r"(?>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
COMMA = r"(?>\s*,?\s*)"
_NUMBER = re.compile(NUMBER)
_LIST = re.compile(rf"\s*+(?:{NUMBER}(?:{COMMA}{NUMBER})*+)?+\s*+")
_LENGTH = re.compile(rf"\s*+({NUMBER})\s*+([a-zA-Z]*+|%)\s*+")
_TRANSFORM = re.compile(r"[\s,]*+([a-zA-Z0-9]++)\s*+\(([^()]*+)\)")
_ANGLE_OR_PX = re.compile(r"(?<=[\d.])(?:deg|px)\b")
_LARGEST = 1e15
_PER_INCH = {"in": 1.0, "mm": 25.4, "cm": 2.54, "q": 101.6, "pt": 72.0, "pc": 6.0}
_TAKES = {"matrix": (6,), "translate": (1, 2), "scale": (1, 2), "rotate": (1, 3), "skewx": (1,), "skewy": (1,)}


def number(text: str) -> float:
    """A number of a size with which one can calculate."""
    value = float(text)
    if not abs(value) <= _LARGEST:
        raise ToolpathError(f"the number {text} is too large, expected at most {_LARGEST:g}")
    return value


def numbers(text: str, what: str) -> list[float]:
    """Numbers separated by blanks or commas."""
    if not _LIST.fullmatch(text):
        raise ToolpathError(f"{what} has {excerpt(text, _LIST)}, expected numbers")
    return [number(found) for found in _NUMBER.findall(text)]


def excerpt(text: str, good: re.Pattern[str]) -> str:
    """The beginning of what in ``text`` comes after its longest good start, for errors."""
    match = good.match(text)
    rest = text[match.end() :] if match else text
    return repr(rest[:20] or text[-20:]) + ("…" if len(rest) > 20 else "")


@dataclass(frozen=True)
class Viewport:
    """What lengths refer to.

    Attributes:
        width: of the viewport in user units, 100 % of horizontal lengths.
        height: likewise, of vertical ones.
        ppi: user units per inch.
    """

    width: float
    height: float
    ppi: float

    def length(self, text: str, what: str) -> float:
        """A length in user units.

        Args:
            text: a number with a unit.
            what: the attribute, which decides what per cent are of.
        """
        match = _LENGTH.fullmatch(text)
        unit = match[2].lower() if match else None
        if match is None or (unit not in ("", "px", "%") and unit not in _PER_INCH):
            raise ToolpathError(f"{what} = {text[:30]!r}, expected a length in px, mm, cm, in, pt, pc or %")
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
    """The affine map of a transform attribute, (4, 4); of several, the last is applied first."""
    total, end = np.eye(4), 0
    if text.strip() in ("", "none"):
        return total
    while match := _TRANSFORM.match(text, end):
        name, end = match[1].lower(), match.end()
        values = numbers(_ANGLE_OR_PX.sub("", match[2]), f"{match[1]}(…)")
        if len(values) not in _TAKES.get(name, ()):
            known = "matrix(6 numbers), translate(1 or 2), scale(1 or 2), rotate(1 or 3), skewX(1), skewY(1)"
            raise ToolpathError(f"transform has {match[0].strip()[:60]!r}, expected {known}")
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused where it is drawn
            total = total @ _plane(*_matrix(name, values))
    if text[end:].strip():
        raise ToolpathError(f"transform has {text[end:][:30]!r}, expected name(numbers)")
    return total


def _matrix(name: str, v: list[float]) -> tuple[float, ...]:
    """(a, b, c, d, e, f) as in matrix(…)."""
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
    """Exact at right angles, which drawings are full of."""
    quarter, rest = divmod(degrees, 90.0)
    cos, sin = (float(f(np.radians(rest))) for f in (np.cos, np.sin))
    return [(cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos)][int(quarter) % 4]


def _plane(a: float, b: float, c: float, d: float, e: float, f: float) -> Array:
    return np.array([[a, c, 0, e], [b, d, 0, f], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=np.float64)
