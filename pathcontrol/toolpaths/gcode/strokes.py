"""Collection of consecutive moves into contours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError, ToolpathError
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.segment import SAME_POINT, Polyline, Segment
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
            raise ToolpathError(f"more than {MAX_SEGMENTS} moves; split the program", limit=MAX_SEGMENTS)
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
                raise ToolpathError(
                    f"more than {MAX_CONTOURS} changes between rapids and feeds; split the program", limit=MAX_CONTOURS
                )
            rapid = self._feed is None
            self._contours.append(self._builder.contour(feed=self._feed, rapid=rapid, name=self._name))
        self._builder = None

    def contours(self) -> tuple[Contour, ...]:
        """Return all contours, in order."""
        self.end()
        return tuple(self._contours)


class ContourBuilder:
    """A builder of one contour; consecutive straight moves become one polyline.

    Points are kept as tuples of numbers: programs of a hundred thousand lines are read several times faster so.

    Args:
        start: where the contour begins [m], (3,).

    Raises:
        InputError: it, or a point that is added, is not finite.
    """

    def __init__(self, start: Sequence[float] | Array) -> None:
        self._segments: list[Segment] = []
        self._start = _point("start", start)
        self._corners = [self._start]

    @property
    def position(self) -> Array:
        """The current end of the contour [m], (3,)."""
        return np.array(self._corners[-1])

    @property
    def empty(self) -> bool:
        """True if the contour has no length yet."""
        return not self._segments and len(self._corners) == 1

    def line_to(self, point: Sequence[float] | Array) -> None:
        """Add a straight move; one without length is left out."""
        target = _point("point", point)
        if math.dist(target, self._corners[-1]) > SAME_POINT:
            self._corners.append(target)

    def lines_to(self, points: Array) -> None:
        """Add straight moves to finite points (k, 3), one after another; those without length are left out."""
        steps = np.diff(np.concatenate([self._corners[-1:], points]), axis=0)
        targets = map(tuple, points.tolist())
        if (np.abs(steps) > SAME_POINT).any(1).all():
            self._corners.extend(targets)
            return
        for target in targets:
            self.line_to(target)

    def add(self, segment: Segment) -> None:
        """Add a curved piece that begins at the current end; a gap there is closed by a straight move."""
        self.line_to(segment.first)
        self._end_polyline()
        self._segments.append(segment)
        self._corners = [_point("last", segment.last)]

    def close(self) -> None:
        """Add a straight move back to the start."""
        self.line_to(self._start)

    def contour(self, **attributes: Any) -> Contour:
        """Return the contour, with ``attributes`` of :class:`Contour`; by default ``closed`` follows from the ends."""
        self._end_polyline()
        closed = bool(self._segments) and math.dist(self._corners[-1], self._start) <= SAME_POINT
        return Contour(tuple(self._segments), **({"closed": closed} | attributes))

    def _end_polyline(self) -> None:
        if len(self._corners) > 1:
            self._segments.append(Polyline(np.array(self._corners)))
            self._corners = [self._corners[-1]]


def _point(name: str, point: Sequence[float] | Array) -> tuple[float, ...]:
    """Check that a point has three finite numbers."""
    numbers = tuple(map(float, point))
    if not all(map(math.isfinite, numbers)) or len(numbers) != 3:
        raise InputError(f"{name} = {numbers}, expected three finite numbers", argument=name, value=numbers)
    return numbers
