"""The modal state of a G-code program: settings in force until others replace them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.units import UNITS, Unit
from pathcontrol.toolpaths.gcode.words import Block
from pathcontrol.toolpaths.text import MAX_COORDINATE

_UNIT_CODES = {200: UNITS["in"], 210: UNITS["mm"]}


@dataclass
class Modes:
    """The modes in force, at first those of RS274/NGC; the program must set unit, motion and feed.

    Attributes:
        unit: unit of length, G20 or G21.
        motion: code of the motion times ten, G0 to G3, or None after G80.
        feed: F [m/s].
        plane: code of the plane of arcs times ten, G17 to G19.
        absolute: whether coordinates are absolute, G90, and not relative to where the tool is, G91.
        absolute_centers: whether centres of arcs are absolute, G90.1, and not relative to the start, G91.1.
        return_level: code of where cycles return to, times ten: the level before them, G98, or R, G99.
        stopped: whether G80 ended a motion, so that there is none until the next.
        arc_tolerance: how much the radii at the ends of an arc may differ [m], or None for LinuxCNC's rule.
    """

    unit: Unit | None = None
    motion: int | None = None
    feed: float | None = None
    plane: int = 170
    absolute: bool = True
    absolute_centers: bool = False
    return_level: int = 980
    stopped: bool = False
    arc_tolerance: float | None = None

    def update(self, block: Block, codes: dict[str, int]) -> None:
        """Put the modes of a block into force, given its code of each group."""
        before = self.unit
        self.unit = _UNIT_CODES[codes["unit"]] if "unit" in codes else before
        if "F" in block.words:
            if before not in (None, self.unit):
                raise ToolpathError("F where the unit changes is another feed on other machines: give it its own line")
            self.feed = self.feed_of(block.words["F"])
            if not 0 < self.feed < math.inf:
                raise ToolpathError(
                    f"F{block.words['F']:g} is no feed, expected a number greater than 0",
                    value=block.words["F"],
                    limit=0.0,
                )
        self.motion = codes.get("motion", None if "end of motion" in codes else self.motion)
        self.stopped = self.motion is None and (self.stopped or "end of motion" in codes)
        self.return_level = codes.get("return level", self.return_level)
        self.plane = codes.get("plane", self.plane)
        self.absolute = codes.get("distance", 900 if self.absolute else 910) == 900
        self.absolute_centers = codes.get("arc centre", 901 if self.absolute_centers else 911) == 901

    def length(self, letter: str, value: float) -> float:
        """Return the value of a word [m]."""
        return value * self.known_unit(f"{letter}{value:g}").scale

    def feed_of(self, value: float) -> float:
        """Return the value of F [m/s]."""
        return self.length("F", value) / 60

    def known_unit(self, needed_by: str) -> Unit:
        """Return the unit in force; it is an error if there is none yet."""
        if self.unit is None:
            raise ToolpathError(
                f"{needed_by} has no unit: write G20, inches, or G21, millimetres, before it, or read the file with "
                "unit='mm' or unit='in'",
                argument="unit",
            )
        return self.unit

    def coordinate(self, letter: str, value: float, here: float) -> float:
        """Return the end of an axis word on that axis, from ``here`` [m]."""
        target = self.length(letter, value) + (0.0 if self.absolute else here)
        if abs(target) > MAX_COORDINATE:
            raise ToolpathError(
                f"{letter}{value:g} leads further than {MAX_COORDINATE:g} m from the origin",
                value=value,
                limit=MAX_COORDINATE,
            )
        return target
