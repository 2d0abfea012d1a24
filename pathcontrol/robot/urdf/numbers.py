"""The numbers of a URDF: read as urdfdom reads them, and checked to be valid."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from lxml import etree

from pathcontrol._arrays import LARGEST
from pathcontrol.robot.urdf.checks.finding import Finding, quote
from pathcontrol.robot.urdf.elements import MOMENTS, first, links_and_joints, place_of

MAX_DIGITS = 400
ABSURD = LARGEST
POSE = {"xyz": 3, "rpy": 3}

_LIMITS = ("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk")
_SAFETY = ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity")

# how many numbers each attribute holds, by element
_NUMBERS: dict[str, dict[str, dict[str, int]]] = {
    "link": {
        "inertial/origin": POSE,
        "inertial/mass": {"value": 1},
        "inertial/inertia": dict.fromkeys(MOMENTS, 1),
    },
    "joint": {
        "origin": POSE,
        "axis": {"xyz": 3},
        "limit": dict.fromkeys(_LIMITS, 1),
        "dynamics": {"damping": 1, "friction": 1},
        "mimic": {"multiplier": 1, "offset": 1},
        "calibration": {"rising": 1, "falling": 1},
        "safety_controller": dict.fromkeys(_SAFETY, 1),
    },
}

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


def read_numbers(text: str, length: int) -> tuple[float, ...] | None:
    """Read exactly `length` finite numbers the way urdfdom does, or return None.

    It knows neither ``inf`` nor ``nan``, splits at spaces only, and takes no space behind a single number.
    """
    words = [text.lstrip(" ")] if length == 1 else [word for word in text.split(" ") if word]
    if len(words) != length or not all(map(_is_number, words)):
        return None
    values = tuple(map(float, words))
    return values if all(map(math.isfinite, values)) else None


def check_numbers(root: etree._Element) -> Iterator[Finding]:
    """Check that every number of the dynamics is finite and of bounded size, and that there are as many as expected."""
    for element in links_and_joints(root):
        for path, lengths in _NUMBERS[element.tag].items():
            if (part := first(element, path)) is None:
                continue
            for name, length in lengths.items():
                if (text := part.get(name)) is not None:
                    yield from _check_number(element, part, name, text, length)


def _check_number(
    element: etree._Element, part: etree._Element, name: str, text: str, length: int
) -> Iterator[Finding]:
    """Check the numbers of one attribute of a part of an element."""
    values, is_limit = read_numbers(text, length), part.tag == "limit"
    if values is not None and (is_limit or max(map(abs, values)) < ABSURD):
        return
    where, what = place_of(element), f"{name} of <{part.tag}>"
    if values is None:
        expected = "a finite number" if length == 1 else f"{length} finite numbers with spaces between"
        message = f"{what} is {quote(text)}; expected {expected}, correct it"
        yield Finding("error", "not-a-number", where, message)
    else:
        message = f"{what} is {quote(text)}; expected SI units, below {ABSURD:g}"
        yield Finding("error", "number-absurd", where, message)


def _is_number(word: str) -> bool:
    """Return whether a word is a number as urdfdom reads it, of bounded length."""
    return len(word) <= MAX_DIGITS and _NUMBER.fullmatch(word) is not None
