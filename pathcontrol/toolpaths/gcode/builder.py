"""A builder of contours, piece by piece."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.segment import SAME_POINT, Polyline, Segment


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
        raise InputError(f"{name} = {numbers}, expected three finite numbers")
    return numbers
