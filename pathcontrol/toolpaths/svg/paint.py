"""The visibility of an SVG shape: its fill, its stroke and their opacities, inherited as CSS says."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from tinycss2.color4 import parse_color

#: properties that decide whether a shape is seen, and whether its stroke is dashed
PAINT = frozenset(
    {"fill", "stroke", "color", "opacity", "fill-opacity", "stroke-opacity", "stroke-width", "stroke-dasharray"}
)
_KEYWORDS = ("inherit", "initial", "unset", "revert", "revert-layer")
_PAINTS = ("fill", "stroke", "color")
_AMOUNT = re.compile(r"([-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(%|[a-zA-Z]*)")


@dataclass(frozen=True)
class Paint:
    """The painting properties that an element hands down to those inside it.

    Attributes:
        fill: its paint.
        stroke: likewise.
        color: what ``currentColor`` is.
        fill_opacity: 0 to 1.
        stroke_opacity: 0 to 1.
        stroke_width: 0 if strokes have no width.
        stroke_dasharray: as it is written.
        opacity: of the element and all that it is inside of, 0 to 1.
    """

    fill: str = "black"
    stroke: str = "none"
    color: str = "black"
    fill_opacity: float = 1.0
    stroke_opacity: float = 1.0
    stroke_width: float = 1.0
    stroke_dasharray: str = "none"
    opacity: float = 1.0

    def inside(self, style: dict[str, str]) -> Paint:
        """Return the paint of an element inside, given its own properties."""
        given = {name: style[name].strip() for name in PAINT.intersection(style)}
        if not given:
            return self
        own = given.pop("opacity", "1")
        share = self.opacity if own.lower() == "inherit" else _amount(own, 1.0)
        values: dict[str, Any] = {name.replace("-", "_"): self._value(name, value) for name, value in given.items()}
        return replace(self, **values, opacity=self.opacity * share)

    @property
    def fills(self) -> bool:
        """True if the fill is visible."""
        return self.opacity > 0 and self.fill_opacity > 0 and self._is_seen(self.fill)

    @property
    def strokes(self) -> bool:
        """True if the stroke is visible."""
        seen = self.stroke_opacity > 0 and self.stroke_width > 0 and self._is_seen(self.stroke)
        return self.opacity > 0 and seen

    @property
    def seen(self) -> bool:
        """True if the fill or the stroke is visible."""
        return self.fills or self.strokes

    @property
    def dashed(self) -> bool:
        """True if the stroke is visible and dashed."""
        lengths = [float(match[1]) for match in _AMOUNT.finditer(self.stroke_dasharray)]
        return self.strokes and any(lengths)

    def _value(self, name: str, value: str) -> str | float:
        """Return the computed value of a property."""
        field = name.replace("-", "_")
        if value.lower() in ("initial", "revert", "revert-layer"):
            return getattr(Paint(), field)
        if value.lower() in _KEYWORDS or (name == "color" and value.lower() == "currentcolor"):
            return getattr(self, field)
        return _amount(value, 1.0) if field in ("fill_opacity", "stroke_opacity", "stroke_width") else value

    def _is_seen(self, paint: str) -> bool:
        alpha = opacity_of(paint)
        return (opacity_of(self.color) if alpha is None else alpha) != 0


def is_valid(name: str, value: str) -> bool:
    """Return whether a declaration is valid; an invalid one is ignored."""
    if name not in PAINT or value.strip().lower() in _KEYWORDS or "(" in value:
        return True
    if name in _PAINTS:
        return opacity_of(value) != -1
    if name == "stroke-dasharray":
        return True
    match = _AMOUNT.fullmatch(value.strip())
    return match is not None and (name != "stroke-width" or float(match[1]) >= 0)


def is_black(paint: str) -> bool:
    """Return whether a paint is plain black, which hides everything in a mask."""
    color = parse_color(paint) if "(" not in paint else None
    return color is not None and color != "currentcolor" and not any(color[:3])


@lru_cache(maxsize=4096)
def opacity_of(paint: str) -> float | None:
    """Return the opacity of a paint, 0 to 1; None for the current colour, −1 where it is no paint.

    Gradients, patterns and what is computed in ways that are not known here count as opaque.
    """
    text = paint.strip().lower()
    if text == "none":
        return 0.0
    try:
        color = parse_color(text)
    except Exception:  # tinycss2 unpacks the arguments of color() before it counts them
        color = None
    if color == "currentcolor":
        return None
    if color is not None:
        return float(color.alpha)
    return 1.0 if "(" in text or text.startswith("context-") else -1.0


def _amount(value: str, otherwise: float) -> float:
    """Return a number that may be in per cent, not less than 0; ``otherwise`` where it is computed."""
    match = _AMOUNT.fullmatch(value)
    return otherwise if match is None else max(0.0, float(match[1]) / (100 if match[2] == "%" else 1))
