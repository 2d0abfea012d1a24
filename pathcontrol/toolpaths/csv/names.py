"""Names of the columns of a table of points, with their units."""

from __future__ import annotations

import re
from typing import NamedTuple

#: units of length of a table: metres in one
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3}
#: columns with the coordinates, with the tool's axis, and with its orientation, in the order of ROS
POINT, AXIS, QUATERNION = ["x", "y", "z"], ["i", "j", "k"], ["qx", "qy", "qz", "qw"]
#: column with the name of the contour
CONTOUR = "contour"
KNOWN = (*POINT, *AXIS, *QUATERNION, CONTOUR)

_SPELT = {"m": "met", "cm": "centimet", "mm": "millimet", "um": "micromet"}
_UNIT_ALIASES = {"inch": "in", "inches": "in", "µm": "um", "μm": "um", "micron": "um", "microns": "um"} | {
    stem + end: unit for unit, stem in _SPELT.items() for end in ("er", "ers", "re", "res")
}
#: names as other programs write them: position.x and pose.orientation.w of ROS, pos_x, nx, normal_z
_LONG = re.compile(
    r"(?:.*[._/])?(?=.+(?P<letter>[xyzw])\Z)(?:(?P<point>pos(?:ition)?)|(?P<quaternion>orientation)|(?P<axis>n(?:ormal)?))"
    r"[._/]?[xyzw]"
)
#: x_pos, X Position, x coordinate
_POINT_FIRST = re.compile(r"(?P<letter>[xyz])[._/-]?(?:pos(?:ition)?|coord(?:inate)?)")
_LONGEST = 100  # longest name that is parsed
_PREFIX = {"point": "", "quaternion": "q", "axis": "n"}
_NORMAL = {"nx": "i", "ny": "j", "nz": "k"}
#: x_mm, x/mm, x-mm, x in mm, xmm, x [mm] and x (mm), without their blanks
_COLUMN = re.compile(
    r"([^\[\]()]*?)(?:(?:[_/-]|(?<=[a-z])in)([^\W\d_]+)|(?<=[xyz])(mm|cm|[uµμ]m)|\[([^\[\]()]*)\]|\(([^\[\]()]*)\))?"
)
_WORD = "|".join(sorted({*UNITS, *_UNIT_ALIASES}, key=len, reverse=True))
_WHAT = r"(?:x[ ,]*y(?:[ ,]*z)?|coordinates?|points?|positions?|lengths?|dimensions?|distances?|values|data|all)"
#: units: mm, lengths are in mm, x y z in mm; not: speeds in mm/s
_IN_A_COMMENT = re.compile(
    rf"\bunits?(?: ?[:=] ?| (?:in|is|are) )\[?({_WORD})\b|\b{_WHAT}(?: [\w,]+){{0,3}} in \[?({_WORD})\b(?!/)",
    re.IGNORECASE,
)
_ALONE = re.compile(rf"\W*({_WORD})\W*", re.IGNORECASE)
_HINT = re.compile(r"\b(mm|cm|inch(?:es)?|millimet(?:er|re)s?|µm)\b", re.IGNORECASE)


class Name(NamedTuple):
    """The name of a column in a file.

    Attributes:
        text: as it is there, without quotes.
        name: one of those that are known, or an empty string.
        unit: unit of length, as here, or as it is there if it is none; None where there is none.
    """

    text: str
    name: str
    unit: str | None

    @classmethod
    def of(cls, text: str) -> Name:
        """Read the name in a field such as ``x``, ``X [mm]``, ``x (mm)``, ``x_mm`` or ``nx``."""
        text = text.strip("\"' ")
        plain = text.lower().replace(" ", "")
        if len(plain) > _LONGEST:
            return cls(text, "", None)
        if name := _match_known(plain):
            return cls(text, name, None)
        found = _COLUMN.fullmatch(plain)
        name = _match_known(found[1]) if found else ""
        unit = next(filter(None, found.groups()[1:]), None) if found else None
        unit = None if unit is None else _UNIT_ALIASES.get(unit, unit)
        if name in POINT:
            return cls(text, name if unit in UNITS else "", unit)
        if plain[-1:] not in ("]", ")"):
            return cls(text, "", None)
        return cls(text, name, unit if not name and unit in UNITS else None)

    @property
    def plain(self) -> str:
        """The text without case and blanks, for comparison."""
        return self.text.lower().replace(" ", "")


def _match_known(plain: str) -> str:
    """Return the known name that a text is another spelling of, or an empty string."""
    if plain in KNOWN:
        return plain
    if first := _POINT_FIRST.fullmatch(plain):
        return first["letter"]
    found = _LONG.fullmatch(plain)
    name = "" if found is None else _PREFIX[str(found.lastgroup)] + found["letter"]
    name = _NORMAL.get(name, name)
    return name if name in KNOWN else ""


def names_in(fields: list[str]) -> list[Name]:
    """Return the names in the fields of a line, without empty ones at its end."""
    last = next((k for k in range(len(fields), 0, -1) if fields[k - 1].strip("\"' ")), 0)
    return [Name.of(field) for field in fields[:last]]


def unit_of_row(fields: list[str]) -> str | None:
    """Return the unit of lengths in a line of units below the names, such as ``mm;mm;mm`` or ``[mm] [mm] [mm] -``."""
    plain = [field.strip("\"' ").strip("[]()").lower() for field in fields]
    units = {_UNIT_ALIASES.get(unit, unit) for unit in plain if unit not in ("", "-", "1")}
    return units.pop() if len(units) == 1 and units <= UNITS.keys() else None


def unit_in(comment: str) -> str | None:
    """Return the unit that a comment such as ``units: mm``, ``x y z in mm`` or ``mm`` names."""
    found = _ALONE.fullmatch(comment) or _IN_A_COMMENT.search(comment)
    unit = next(filter(None, found.groups())).lower() if found else None
    return None if unit is None else _UNIT_ALIASES.get(unit, unit)


def hint_of_unit(comment: str) -> str | None:
    """Return a word in a comment that resembles a unit, or None."""
    found = _HINT.search(comment)
    return found[0] if found else None
