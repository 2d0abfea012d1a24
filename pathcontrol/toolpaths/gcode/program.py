"""Execution of the blocks of a G-code program: the position, and the moves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.arcs import arcs
from pathcontrol.toolpaths.gcode.codes import PROGRAM_END, check_letters, groups
from pathcontrol.toolpaths.gcode.cycles import DRILLING, Drilling
from pathcontrol.toolpaths.gcode.frame import Frame
from pathcontrol.toolpaths.gcode.harmless import without_codes, without_letters
from pathcontrol.toolpaths.gcode.modes import Modes
from pathcontrol.toolpaths.gcode.runs import read_run
from pathcontrol.toolpaths.gcode.strokes import Strokes
from pathcontrol.toolpaths.gcode.words import Block
from pathcontrol.toolpaths.notes import Notes

_RAPID, _LINE, _CLOCKWISE, _COUNTER_CLOCKWISE = 0, 10, 20, 30
_DWELL, _MACHINE = 40, 530
_SHIFT, _NO_SHIFT = 920, 921


class Program:
    """An interpreter that carries out blocks.

    Args:
        modes: the modes in force at the beginning.
        position: where the tool is at the beginning [m], (3,), NaN where that is not known.
        passed: what is passed over is counted there.
    """

    def __init__(self, modes: Modes, position: Sequence[float], passed: Notes) -> None:
        self.modes = modes
        self.strokes = Strokes()
        self._position = list(position)
        self._passed = passed
        self._frame = Frame(passed)
        self._drilling: Drilling | None = None

    def carry_out(self, block: Block, line: int) -> bool:
        """Carry out the block of a line, in the order of RS274/NGC; return whether the program goes on.

        Raises:
            ToolpathError: it is not understood.
        """
        name = block.label or f"line {line}"
        block = without_codes(block, self._is_turning(block), line, self._passed)
        codes = groups(block)
        block = without_letters(block, line, self._passed)
        self.modes.update(block, codes)
        self._frame.select(codes.get("coordinate system"))
        elsewhere = codes.get("elsewhere")
        if elsewhere is None:
            begun = self.strokes.begun or self._is_cutting(block)
            self._move(self._frame.without_rotary(block, self.modes.absolute, begun, line), codes, line, name)
        elif elsewhere == _DWELL:
            _check_dwell(block)
        elif elsewhere in (_SHIFT, _NO_SHIFT):
            self._shift(block, elsewhere)
        else:
            self._leave(block, codes, name)
        return PROGRAM_END.isdisjoint(block.m)

    def _is_cutting(self, block: Block) -> bool:
        """Return whether the tool moves at feed in the block."""
        return self.modes.motion not in (None, _RAPID) and not {*"XYZ"}.isdisjoint(block.words)

    def follow(self, texts: Sequence[str], first: int) -> int:
        """Carry out the lines from the index ``first`` on that continue the last move; return their number."""
        rapid, feed = self.modes.motion == _RAPID, self.modes.feed
        straight = rapid or (self.modes.motion == _LINE and feed is not None)
        if not straight or self._drilling or not self.strokes.goes_on(None if rapid else feed):
            return 0
        if any(map(math.isnan, self._position)):
            return 0
        count, points = read_run(texts, first, self.strokes.left, self._position, self.modes)
        if len(points):
            self.strokes.follow(points)
            self._position = points[-1].tolist()
        return count

    def _is_turning(self, block: Block) -> bool:
        """Return whether the motion of a block is an arc or a cycle."""
        motion = next((code for code in block.g if code in (_RAPID, _LINE, 800)), self.modes.motion)
        return any(code in (_CLOCKWISE, _COUNTER_CLOCKWISE, *DRILLING) for code in (motion, *block.g))

    def _move(self, block: Block, codes: dict[str, int], line: int, name: str) -> None:
        """Carry out the motion in force, if the block has words for it."""
        motion = self._motion(block, line)
        letters = _letters(motion)
        options = ("PQ" if codes.get("path control") == 640 else "") + ("H" if codes.get("tool length") == 430 else "")
        check_letters(block, letters + options)
        if motion not in DRILLING:
            self._drilling = None
        if motion is None or block.words.keys().isdisjoint("XYZIJKR" if motion in DRILLING else letters):
            return
        self._frame.used = True
        if motion in DRILLING:
            self._drill(block, motion, name)
        elif motion == _RAPID:
            self._rapid(self._target(block), name)
        else:
            self._cut(block, motion, name)

    def _motion(self, block: Block, line: int) -> int | None:
        """Return the motion in force; before the first, coordinates are rapids, as grbl and others begin."""
        motion = self.modes.motion
        if motion is None and not self.modes.stopped and not block.words.keys().isdisjoint("XYZ"):
            self._passed.add(f"line {line}: it moves before G0 or G1 is said; that is taken for rapids, as grbl does")
            self.modes.motion = motion = _RAPID
        return motion

    def _cut(self, block: Block, motion: int, name: str) -> None:
        target = self._target(block)
        self._check_cut(target)
        if motion == _LINE:
            self.strokes.move(self._position, target, self.modes.feed, name)
        else:
            for arc in arcs(self._position, target, block.words, self.modes, clockwise=motion == _CLOCKWISE):
                self.strokes.move(self._position, arc, self.modes.feed, name)
        self._position = target

    def _drill(self, block: Block, motion: int, name: str) -> None:
        """Carry out the moves of a cycle."""
        if self.modes.plane != 170:
            raise ToolpathError(f"{DRILLING[motion]} is supported in the plane XY only, G17")
        self._check_cut(self._position)
        if self._drilling is None or self._drilling.code != motion:
            initial = self._position[2] if self._drilling is None else self._drilling.initial
            self._drilling = Drilling(motion, initial)
        for cuts, target in self._drilling.moves(self._position, block.words, self.modes):
            self.strokes.move(self._position, target, self.modes.feed if cuts else None, name)
            self._position = list(target)

    def _target(self, block: Block) -> list[float]:
        target = list(self._position)
        for axis, letter in enumerate("XYZ"):
            if letter in block.words:
                target[axis] = self.modes.coordinate(letter, block.words[letter], target[axis])
        return target

    def _rapid(self, target: list[float], name: str) -> None:
        """Carry out a rapid, which is left out where its ends are not known."""
        if any(map(math.isnan, [*self._position, *target])):
            self.strokes.end()
        else:
            self.strokes.move(self._position, target, None, name)
        self._position = target

    def _shift(self, block: Block, code: int) -> None:
        """Carry out G92, which names the position of the tool."""
        check_letters(block, "XYZ" if code == _SHIFT else "")
        if code == _NO_SHIFT:
            self._frame.unshift()
            return
        named = {axis: letter for axis, letter in enumerate("XYZ") if letter in block.words}
        place = list(self._position)
        for axis, letter in named.items():
            place[axis] = self.modes.coordinate(letter, block.words[letter], 0.0)
        self._frame.shift(self._position, place, self.strokes.begun)
        self._position = place

    def _leave(self, block: Block, codes: dict[str, int], name: str) -> None:
        """Carry out G28, G30 or G53: the tool is at a place of the machine, unknown to the file."""
        check_letters(block, "XYZ")
        if codes["elsewhere"] == _MACHINE:
            if self.modes.motion not in (_RAPID, None) or self.modes.stopped:
                raise ToolpathError("G53 cuts in the machine's coordinates, which the file does not give: only G0 may")
        elif "motion" in codes:
            raise ToolpathError("G28 or G30 and a motion exclude each other in one line")
        else:
            self._rapid(self._target(block), name)
        self.strokes.end()
        for axis, letter in enumerate("XYZ"):
            if letter in block.words or block.words.keys().isdisjoint("XYZ"):
                self._position[axis] = math.nan

    def _check_cut(self, target: Sequence[float]) -> None:
        """Check that the place and the feed of a cut are known."""
        ends = zip("XYZ", self._position, target, strict=True)
        unknown = [letter for letter, start, end in ends if math.isnan(start + end)]
        if unknown:
            raise ToolpathError(
                f"it cuts where {' and '.join(unknown)} is not known: position the tool before it with "
                f"G90 G0 {'… '.join(unknown)}…, or read the file with start=(x, y, z)",
                argument="start",
                value=unknown,
            )
        if self.modes.feed is None:
            raise ToolpathError(
                "it cuts before there is a feed: write F, in units per minute, or read the file with feed=",
                argument="feed",
            )


def _letters(motion: int | None) -> str:
    """Return the letters that belong to a motion."""
    if motion is None:
        return ""
    if motion in DRILLING:
        return "XYZRQPL"
    return "XYZ" if motion <= _LINE else "XYZIJKRP"


def _check_dwell(block: Block) -> None:
    """Check that G4 says how long: by P, or as Fanuc, Siemens and printers do by X, U or S."""
    check_letters(block, "PXUS")
    times = [block.words[letter] for letter in "PXUS" if letter in block.words]
    if not times or min(times) < 0:
        raise ToolpathError("G4 needs a time to wait, P, that is not negative", value=times, limit=0.0)
