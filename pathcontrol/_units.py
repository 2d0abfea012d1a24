"""Quantities given with their unit, as ``"50 mm/s"``, read into SI units and radians.

A table of some twenty units is all that experiment files and options need; a library of units would bring thousands,
with names that mean something else to people of other fields.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import NamedTuple

from pathcontrol.errors import InputError

_INCH = 0.0254


class _Unit(NamedTuple):
    """A unit as a multiple of one made of m, kg, s and rad with these exponents."""

    factor: float
    m: int = 0
    kg: int = 0
    s: int = 0
    rad: int = 0


_UNITS = {
    **{name: _Unit(factor, m=1) for name, factor in {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}.items()},
    **{name: _Unit(factor, m=1) for name, factor in {"μm": 1e-6, "in": _INCH, "inch": _INCH, "ft": 12 * _INCH}.items()},
    **{name: _Unit(factor, s=1) for name, factor in {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}.items()},
    **{name: _Unit(factor, s=1) for name, factor in {"μs": 1e-6, "min": 60.0, "h": 3600.0}.items()},
    **{name: _Unit(factor, s=-1) for name, factor in {"Hz": 1.0, "kHz": 1e3}.items()},
    **{name: _Unit(factor, rad=1) for name, factor in {"rad": 1.0, "mrad": 1e-3}.items()},
    **{name: _Unit(math.pi / 180, rad=1) for name in ("deg", "°")},
    "rev": _Unit(2 * math.pi, rad=1),
    "rpm": _Unit(2 * math.pi / 60, s=-1, rad=1),
    **{name: _Unit(factor, kg=1) for name, factor in {"kg": 1.0, "g": 1e-3}.items()},
    **{name: _Unit(factor, m=1, kg=1, s=-2) for name, factor in {"N": 1.0, "kN": 1e3}.items()},
    **dict.fromkeys(("Nm", "J"), _Unit(1.0, m=2, kg=1, s=-2)),
}
#: what to offer beside the SI unit itself
_OTHERS = {
    "m": "mm, cm, um, in, ft",
    "m/s": "mm/s, m/min, mm/min, in/min",
    "m/s^2": "mm/s^2",
    "s": "ms, us, min",
    "1/s": "1/min, Hz",
    "Hz": "kHz, 1/s",
    "rad": "deg, mrad, rev",
    "rad/s": "deg/s, mrad/s, rpm",
    "rad/s^2": "deg/s^2",
    "kg": "g",
    "N m": "Nm",
}
_POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*")
_TERM = re.compile(r"([*·/]?)(1|[^\W\d_]+|°)(?:(?:\^|\*\*)?(-?\d))?")
_LONGEST = 60


class Quantity(float):
    """A number in SI units and radians that was given with a unit.

    Attributes:
        unit: the SI unit that it is in.
    """

    unit: str

    def __new__(cls, value: float, unit: str) -> Quantity:
        made = super().__new__(cls, value)
        made.unit = unit
        return made

    def __getnewargs__(self) -> tuple[float, str]:  # type: ignore[override]
        return float(self), self.unit


def parse_quantity(text: str, *units: str) -> Quantity:
    """Convert ``text``, a number and a unit, to the one of the SI ``units`` that has its dimension.

    Raises:
        InputError: it is no number with a unit, or the unit is not known or of another dimension.
    """
    match = _QUANTITY.fullmatch(text) if len(text) <= _LONGEST else None
    if match is None:
        raise InputError(f"expected a number with a unit, {list_units(units)}", value=text)
    if not match[2]:
        raise InputError(
            f"expected a unit after the number, {list_units(units)}, or the number without quotes", value=text
        )
    given = _parse_unit(match[2], units)
    for unit in units:
        if _dimension(given) == _dimension(_parse_unit(unit, units)) or _without_angle(given, unit, units):
            value = _scale(float(match[1]), given.factor)
            if not math.isfinite(value):
                break
            return Quantity(value, unit)
    raise InputError(f"expected a finite quantity in {list_units(units)}", value=text)


def _scale(value: float, factor: float) -> float:
    """Return ``value`` times ``factor``, correct to the last bit: ``5 mm`` is 0.005."""
    inverse = 1 / factor
    return value / inverse if inverse.is_integer() else value * factor


def is_quantity(text: str) -> bool:
    """Return whether ``text`` is a number followed by something, which is meant as its unit."""
    match = _QUANTITY.fullmatch(text) if len(text) <= _LONGEST else None
    return match is not None and bool(match[2])


def is_number(text: str) -> bool:
    """Return whether ``text`` is a number alone, which lacks its unit or stands in quotes for nothing."""
    match = _QUANTITY.fullmatch(text) if len(text) <= _LONGEST else None
    return match is not None and not match[2]


def list_units(units: Iterable[str]) -> str:
    """Return the units that may be written where ``units`` are expected, for a message."""
    return " or ".join(f"{unit} ({_OTHERS[unit]})" if unit in _OTHERS else unit for unit in units)


def _parse_unit(text: str, wanted: Iterable[str]) -> _Unit:
    """Parse a product of units, as ``N m s/rad`` or ``mm/s²``: a slash divides by the next unit only."""
    compact = re.sub(r"\s*([*·/^]+)\s*", r"\1", text.translate(_POWERS))
    total, end = _Unit(1.0), 0
    for term in _TERM.finditer(re.sub(r"\s+", "·", compact)):
        unit = _Unit(1.0) if term[2] == "1" else _UNITS.get(term[2])
        if term.start() != end or unit is None:
            break
        power = int(term[3] or 1) * (-1 if term[1] == "/" else 1)
        exponents = (a + power * b for a, b in zip(total[1:], unit[1:], strict=True))
        total, end = _Unit(total.factor * unit.factor**power, *exponents), term.end()
    if end != len(compact):
        raise InputError(f"unknown unit {text!r}, expected {list_units(wanted)}", value=text)
    return total


def _dimension(unit: _Unit) -> tuple[int, ...]:
    """Return the exponents of m, kg, s and rad."""
    return unit[1:]


def _without_angle(given: _Unit, unit: str, wanted: Iterable[str]) -> bool:
    """Return whether a unit per radian is given without the angle, as is often written: ``N m s``."""
    meant = _parse_unit(unit, wanted)
    return meant.kg != 0 and given.rad == 0 and _dimension(given)[:3] == _dimension(meant)[:3]
