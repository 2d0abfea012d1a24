"""Collection of consecutive moves into contours."""

from __future__ import annotations

from collections.abc import Sequence

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.gcode.builder import ContourBuilder
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.text import MAX_CONTOURS, MAX_SEGMENTS


class Strokes:
    """A collector of moves into contours, one for all that follow each other at one feed, or as rapids."""

    def __init__(self) -> None:
        self._contours: list[Contour] = []
        self._builder: ContourBuilder | None = None
        self._feed: float | None = None
        self._name = ""
        self._moves = 0

    @property
    def begun(self) -> bool:
        """True once there was a move."""
        return self._moves > 0

    @property
    def left(self) -> int:
        """The number of moves that are still allowed."""
        return MAX_SEGMENTS - self._moves

    def goes_on(self, feed: float | None) -> bool:
        """Return whether a move at ``feed`` [m/s], or None for a rapid, continues a contour that has a length."""
        return self._builder is not None and not self._builder.empty and feed == self._feed

    def follow(self, points: Array) -> None:
        """Add straight moves through points (k, 3) [m], like the last move; they are at most :attr:`left`."""
        assert self._builder is not None
        self._moves += len(points)
        self._builder.lines_to(points)

    def move(self, start: Sequence[float], way: Sequence[float] | Arc, feed: float | None, name: str) -> None:
        """Add a move from ``start`` [m], (3,), along an arc or straight, at ``feed`` [m/s], or None for a rapid."""
        self._moves += 1
        if self._moves > MAX_SEGMENTS:
            raise ToolpathError(f"more than {MAX_SEGMENTS} moves; split the program")
        if self._builder is None or feed != self._feed:
            self.end()
            self._builder, self._feed = ContourBuilder(start), feed
        if self._builder.empty:
            self._name = name
        if isinstance(way, Arc):
            self._builder.add(way)
        else:
            self._builder.line_to(way)

    def end(self) -> None:
        """End the contour: the next move begins a new one."""
        if self._builder is not None and not self._builder.empty:
            if len(self._contours) == MAX_CONTOURS:
                raise ToolpathError(f"more than {MAX_CONTOURS} changes between rapids and feeds; split the program")
            rapid = self._feed is None
            self._contours.append(self._builder.contour(feed=self._feed, rapid=rapid, name=self._name))
        self._builder = None

    def contours(self) -> tuple[Contour, ...]:
        """Return all contours, in order."""
        self.end()
        return tuple(self._contours)
