"""Expansion of drilling cycles of G-code to moves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.gcode.modes import Modes

#: codes times ten: drill with chips broken, drill, drill and wait, drill in pecks
DRILLING = {730: "G73", 810: "G81", 820: "G82", 830: "G83"}
_PECKS = (730, 830)
_BACK = 0.254e-3  # m, how far above the bottom a peck begins: LinuxCNC's 0.010 in
_LEAST = 1e-6  # m, depths of pecks and holes
_MOST_REPEATS, _MOST_PECKS = 10_000, 10_000


@dataclass
class Drilling:
    """The drilling cycle in force; its words stay in force from hole to hole (LinuxCNC, G-Codes, Canned Cycles).

    Attributes:
        code: G73, G81, G82 or G83, times ten.
        initial: z before the first hole of the series [m], where G98 retracts to.
        words: R, Z and Q [file's unit], as they were given last.
    """

    code: int
    initial: float
    words: dict[str, float] = field(default_factory=dict)

    def moves(
        self, here: list[float], words: Mapping[str, float], modes: Modes
    ) -> Iterator[tuple[bool, tuple[float, float, float]]]:
        """Yield the moves of a line from ``here`` [m], (3,): whether each cuts, and its end.

        Raises:
            ToolpathError: R, Z or Q is missing or no measure of a hole, L is no number of repetitions.
        """
        self.words |= {letter: words[letter] for letter in "RZQ" if letter in words}
        clear, bottom = self._levels(here[2], modes)
        level = clear if modes.return_level == 990 else max(self.initial, clear)
        x, y, z = here
        if z < clear:
            z = clear
            yield False, (x, y, z)
        for _ in range(_repeats(words)):
            x, y = (modes.coordinate(a, words[a], old) if a in words else old for a, old in (("X", x), ("Y", y)))
            yield False, (x, y, z)
            for cuts, height in self._hole(clear, bottom, level, modes):
                yield cuts, (x, y, height)
            z = level

    def _levels(self, z: float, modes: Modes) -> tuple[float, float]:
        """Return the level above the hole at which rapids end, and its bottom [m]."""
        missing = [a for a in ("RZQ" if self.code in _PECKS else "RZ") if a not in self.words]
        if missing:
            raise ToolpathError(
                f"{DRILLING[self.code]} without {' and '.join(missing)}, expected it in the first line", value=missing
            )
        if not modes.absolute and abs(z - self.initial) > 1e-9:
            raise ToolpathError(
                "R of a cycle in G91 counts from the first level on some machines, from where the tool is on others: "
                "use G90, or return by G98"
            )
        clear = modes.coordinate("R", self.words["R"], z)
        bottom = modes.coordinate("Z", self.words["Z"], clear)
        if not clear - bottom >= _LEAST:
            raise ToolpathError(f"{DRILLING[self.code]} drills upwards or not at all, expected Z below R")
        return clear, bottom

    def _hole(self, clear: float, bottom: float, level: float, modes: Modes) -> Iterator[tuple[bool, float]]:
        """Yield the moves down and up of one hole: whether each cuts, and its end z [m]."""
        yield False, clear
        for depth in self._pecks(clear, bottom, modes):
            yield True, depth
            if self.code == 830:
                yield False, level
            yield False, min(depth + _BACK, level)
        yield True, bottom
        yield False, level

    def _pecks(self, clear: float, bottom: float, modes: Modes) -> Iterator[float]:
        """Yield the depths at which the drill comes out before it goes on [m]."""
        if self.code not in _PECKS:
            return
        step = modes.length("Q", self.words["Q"])
        if not step >= _LEAST or (clear - bottom) / step > _MOST_PECKS:
            raise ToolpathError(
                f"Q{self.words['Q']:g} is no depth of pecks, expected more than 0 and at most {_MOST_PECKS} for a hole",
                value=self.words["Q"],
            )
        count = 1
        while clear - count * step > bottom + 1e-9:
            yield clear - count * step
            count += 1


def _repeats(words: Mapping[str, float]) -> int:
    """Return the number of times that the line is carried out."""
    value = words.get("L", 1.0)
    if not 1 <= value <= _MOST_REPEATS or value % 1:
        raise ToolpathError(
            f"L{value:g} is no number of repetitions, expected 1 to {_MOST_REPEATS}",
            value=value,
            limit=(1, _MOST_REPEATS),
        )
    return int(value)
