"""What the blocks of a G-code program do: the position, and the moves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.arc import Arc
from pathcontrol.toolpaths.gcode.arcs import arc
from pathcontrol.toolpaths.gcode.codes import PROGRAM_END, check_letters, groups
from pathcontrol.toolpaths.gcode.modes import Modes
from pathcontrol.toolpaths.gcode.strokes import Strokes
from pathcontrol.toolpaths.gcode.units import Unit
from pathcontrol.toolpaths.gcode.words import Block

_RAPID, _LINE, _CLOCKWISE = 0, 10, 20
_DWELL, _MACHINE = 40, 530


class Program:
    """A machine that carries out blocks.

    Args:
        unit: the unit in force at the beginning, or None.
        position: where the tool is at the beginning [m], (3,), NaN where that is not known.
        feed: speed of cuts before the program says F [m/s], or None.
    """

    def __init__(self, unit: Unit | None, position: Sequence[float], feed: float | None = None) -> None:
        self.modes = Modes(unit, feed=feed)
        self.strokes = Strokes()
        self._position = list(position)

    def carry_out(self, block: Block, name: str) -> bool:
        """Do what the block called ``name`` says, in the order of RS274/NGC; whether the program goes on after it.

        Raises:
            ToolpathError: it is not understood.
        """
        codes = groups(block)
        self.modes.update(block, codes)
        elsewhere = codes.get("elsewhere")
        if elsewhere is None:
            self._move(block, codes, name)
        elif elsewhere == _DWELL:
            check_letters(block, "P")
            if not block.words.get("P", -1.0) >= 0:
                raise ToolpathError("G4 needs a time to wait, P, that is not negative")
        else:
            self._leave(block, codes, name)
        return PROGRAM_END.isdisjoint(block.m)

    def _move(self, block: Block, codes: dict[str, int], name: str) -> None:
        """The motion in force, if the block has words for it."""
        motion = self.modes.motion
        turns = motion is not None and motion > _LINE
        letters = "" if motion is None else "XYZIJKR" if turns else "XYZ"
        options = ("PQ" if codes.get("path control") == 640 else "") + ("H" if codes.get("tool length") == 430 else "")
        check_letters(block, letters + options)
        if block.words.keys().isdisjoint(letters):
            return
        target = self._target(block)
        if motion == _RAPID:
            self._rapid(target, name)
            return
        self._check_cut(target)
        way: Sequence[float] | Arc = target
        if turns:
            way = arc(self._position, target, block.words, self.modes, clockwise=motion == _CLOCKWISE)
        self.strokes.move(self._position, way, self.modes.feed, name)
        self._position = target

    def _target(self, block: Block) -> list[float]:
        target = list(self._position)
        for axis, letter in enumerate("XYZ"):
            if letter in block.words:
                target[axis] = self.modes.coordinate(letter, block.words[letter], target[axis])
        return target

    def _rapid(self, target: list[float], name: str) -> None:
        """A rapid, which is left out where its ends are not known."""
        if any(map(math.isnan, [*self._position, *target])):
            self.strokes.end()
        else:
            self.strokes.move(self._position, target, None, name)
        self._position = target

    def _leave(self, block: Block, codes: dict[str, int], name: str) -> None:
        """G28, G30 and G53 lead to places of the machine: after them, its axes are where the file does not say."""
        check_letters(block, "XYZ")
        if codes["elsewhere"] == _MACHINE:
            if self.modes.motion != _RAPID:
                raise ToolpathError("G53 cuts in the machine's coordinates, which the file does not give: only G0 may")
        elif "motion" in codes:
            raise ToolpathError("G28 or G30 and a motion exclude each other in one line")
        else:
            self._rapid(self._target(block), name)
        self.strokes.end()
        for axis, letter in enumerate("XYZ"):
            if letter in block.words or block.words.keys().isdisjoint("XYZ"):
                self._position[axis] = math.nan

    def _check_cut(self, target: list[float]) -> None:
        """Raise if it is not known where to cut, or how fast."""
        ends = zip("XYZ", self._position, target, strict=True)
        unknown = [letter for letter, start, end in ends if math.isnan(start + end)]
        if unknown:
            raise ToolpathError(
                f"it cuts where {' and '.join(unknown)} is not known: position the tool before it with "
                f"G90 G0 {'… '.join(unknown)}…, or read the file with start=(x, y, z)"
            )
        if self.modes.feed is None:
            raise ToolpathError(
                "it cuts before there is a feed: write F, in units per minute, or read the file with feed="
            )
