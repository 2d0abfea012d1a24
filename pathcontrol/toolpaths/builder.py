"""Contours put together piece by piece, as the readers of files do."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, finite
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments import Polyline, Segment

_NOTHING = 1e-9  # m, moves shorter than this are none


class ContourBuilder:
    """Collects the pieces of one contour; straight moves that follow each other become one polyline.

    Args:
        start: where the contour begins [m], (3,).
    """

    def __init__(self, start: ArrayLike) -> None:
        self._segments: list[Segment] = []
        self._start = finite("start", as_array("start", start))
        self._corners: list[Array] = [self._start]

    @property
    def position(self) -> Array:
        """Where the contour has come to [m], (3,)."""
        return self._corners[-1]

    @property
    def empty(self) -> bool:
        """Whether nothing that has a length was added."""
        return not self._segments and len(self._corners) == 1

    def line_to(self, point: ArrayLike) -> None:
        """A straight move; one of no length is left out."""
        target = finite("point", as_array("point", point))
        if np.linalg.norm(target - self.position) > _NOTHING:
            self._corners.append(target)

    def add(self, segment: Segment) -> None:
        """A curved piece, which begins at :attr:`position`; a gap there is closed by a straight move."""
        self.line_to(segment.point(np.array(0.0)))
        self._end_polyline()
        self._segments.append(segment)
        self._corners = [segment.point(np.array(1.0))]

    def close(self) -> None:
        """A straight move back to the start."""
        self.line_to(self._start)

    def contour(self, **attributes: Any) -> Contour:
        """The contour; ``attributes`` are those of :class:`Contour`, ``closed`` follows from the ends by default."""
        self._end_polyline()
        closed = bool(self._segments) and float(np.linalg.norm(self.position - self._start)) <= _NOTHING
        return Contour(tuple(self._segments), **({"closed": closed} | attributes))

    def _end_polyline(self) -> None:
        if len(self._corners) > 1:
            self._segments.append(Polyline(np.array(self._corners)))
            self._corners = [self._corners[-1]]
