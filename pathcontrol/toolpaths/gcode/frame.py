"""The frame of the coordinates of a G-code program, which must not change: offset, shift, rotary axes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.codes import GROUPS
from pathcontrol.toolpaths.gcode.words import Block
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.segments.segment import SAME_POINT

_SYSTEMS = GROUPS["coordinate system"]
_FIRST_SYSTEM = 540


class Frame:
    """The frame of the workpiece, which a program may choose once, before it moves.

    Attributes:
        used: whether coordinates were used in it.

    Args:
        passed: what is passed over is counted there.
    """

    def __init__(self, passed: Notes) -> None:
        self.used = False
        self._passed = passed
        self._system: int = _FIRST_SYSTEM
        self._shifted = False
        self._rotary: dict[str, float] = {}

    def select(self, system: int | None) -> None:
        """Select one of the coordinate systems G54 to G59.3.

        Raises:
            ToolpathError: coordinates were used that refer to another.
        """
        if system is None or system == self._system:
            return
        if self.used:
            raise ToolpathError(
                f"{_SYSTEMS[system]} after coordinates in {_SYSTEMS[self._system]}: how they lie to each other is not "
                "in the file: refer the program to one origin"
            )
        self._system = system
        self._passed.add(f"the coordinates are those of {_SYSTEMS[system]}")

    def shift(self, here: Sequence[float], place: Sequence[float], begun: bool) -> None:
        """Name the position ``here`` [m], (3,), where axes may be NaN, ``place`` by G92.

        Raises:
            ToolpathError: it is another place, and there were moves.
        """
        same = all(math.isnan(b) or abs(a - b) <= SAME_POINT for a, b in zip(here, place, strict=True))
        if begun and not same:
            raise ToolpathError(
                "G92 after the first move shifts the coordinates: refer the program to one origin, and say G92 at its "
                "beginning only"
            )
        self._shifted = self._shifted or not same

    def unshift(self) -> None:
        """Cancel G92, which is allowed where none was in force.

        Raises:
            ToolpathError: there was one.
        """
        if self._shifted:
            raise ToolpathError("G92.1 takes back a G92 and shifts the coordinates: refer the program to one origin")

    def without_rotary(self, block: Block, absolute: bool, begun: bool, line: int) -> Block:
        """Return the block without rotary axes, A, B and C, that stay where they are.

        Raises:
            ToolpathError: one of them turns.
        """
        found = [letter for letter in "ABC" if letter in block.words]
        if not found:
            return block
        for letter in found:
            value = block.words[letter]
            stays = self._rotary.setdefault(letter, value if absolute and not begun else 0.0) if absolute else 0.0
            if value != stays:
                raise ToolpathError(
                    f"{letter}{value:g} turns {letter} from {stays:g}: only X, Y and Z are supported, others must stay",
                    value=value,
                    limit=stays,
                )
            self._passed.pass_over(f"{letter}, an axis that stays where it is,", line)
        return block._replace(words={letter: value for letter, value in block.words.items() if letter not in found})
