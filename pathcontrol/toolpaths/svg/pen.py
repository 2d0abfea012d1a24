"""A pen that draws subpaths of SVG, stroke by stroke in user units."""

from __future__ import annotations

import cmath
from math import pi, radians, sqrt
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.pieces import Curve, Curves, EllipticArc, Lines, Piece
from pathcontrol.toolpaths.text import MAX_CONTOURS, MAX_SEGMENTS

_NO_RADIUS = 1e-15  # user units; with less an arc is a line
_SHALLOW = 1e-3  # half chord over radius, below which the centre of an arc is too far away to start from


class Subpath(NamedTuple):
    """A line drawn without lifting the pen, in user units."""

    pieces: list[Piece]
    closed: bool


class Pen:
    """A pen that draws subpaths; points are complex numbers x + iy in user units."""

    def __init__(self) -> None:
        self.at = self._start = 0j
        self._handle = ("", 0j)  # the last control point, and the kind of its curve
        self._line: list[complex] = [0j]
        self._curves: list[Array] = []
        self._pieces: list[Piece] = []
        self._subpaths: list[Subpath] = []
        self._strokes = 0

    def move(self, point: complex) -> None:
        """Begin a subpath."""
        self._finish(closed=False)
        self._start = self.at = point
        self._line = [point]

    def line(self, point: complex) -> None:
        """Draw a straight line."""
        self._go(point)
        self._line.append(point)

    def curve(self, *points: complex) -> None:
        """Draw a quadratic or cubic Bézier curve."""
        self.curves(np.array([points]))

    def curves(self, points: Array, relative: bool = False) -> None:
        """Draw Bézier curves in a row by their points but the first, (k, 2 or 3), from their starts if relative."""
        starts = np.concatenate([[self.at], points[:-1, -1]])
        if relative:
            starts = np.cumsum(starts)
            points = points + starts[:, None]
        self._end_line()
        if self._curves and self._curves[0].shape[1] != points.shape[1] + 1:
            self._end_curves()
        self._curves.append(np.column_stack([starts, points]))
        self._go(complex(points[-1, -1]), len(points))
        self._line = [self.at]
        self._handle = ("Q" if points.shape[1] == 2 else "C", complex(points[-1, -2]))

    def lines(self, points: Array, relative: bool = False) -> None:
        """Draw straight lines in a row to points (k, 1), from each one's start if relative."""
        ends = points[:, 0]
        if relative:
            ends = np.cumsum(np.concatenate([[self.at], ends]))[1:]
        self._go(complex(ends[-1]), len(ends))
        self._line += ends.tolist()

    def arc(self, rx: float, ry: float, rotation: float, large: float, sweep: float, point: complex) -> None:
        """Draw an arc of an ellipse; ``rotation`` is in degrees, ``large`` and ``sweep`` are 0 or 1."""
        if point == self.at:
            self._handle = ("", 0j)
        elif min(abs(rx), abs(ry)) <= _NO_RADIUS:
            self.line(point)
        else:
            self._add(_arc(self.at, abs(rx), abs(ry), rotation, large > 0, sweep > 0, point), point)

    def close(self) -> None:
        """Draw a straight line to the start of the subpath."""
        if self.at != self._start:
            self.line(self._start)
        self._finish(closed=True)

    def reflection(self, kind: str) -> complex:
        """Return the last control point mirrored at the end of its curve, if that was of this kind."""
        return 2 * self.at - self._handle[1] if self._handle[0] == kind else self.at

    def subpaths(self) -> list[Subpath]:
        """Return all that was drawn."""
        self._finish(closed=False)
        return self._subpaths

    def _go(self, point: complex, strokes: int = 1) -> None:
        """Move the pen to the end of strokes."""
        self.at, self._handle = point, ("", 0j)
        self._strokes += strokes
        if self._strokes > MAX_SEGMENTS:
            raise ToolpathError(f"path data has more than {MAX_SEGMENTS} segments; split it", limit=MAX_SEGMENTS)

    def _add(self, piece: Piece, end: complex) -> None:
        self._end_line()
        self._end_curves()
        self._pieces.append(piece)
        self._go(end)
        self._line = [end]

    def _end_line(self) -> None:
        if len(self._line) > 1:
            self._end_curves()
            self._pieces.append(Lines(_space(self._line)))

    def _end_curves(self) -> None:
        if self._curves:
            points = np.concatenate(self._curves)
            self._pieces.append(Curves(np.stack([points.real, points.imag, np.zeros(points.shape)], axis=-1)))
            self._curves = []

    def _finish(self, closed: bool) -> None:
        self._end_line()
        self._end_curves()
        if self._pieces:
            self._subpaths.append(Subpath(self._pieces, closed))
            if len(self._subpaths) > MAX_CONTOURS:
                raise ToolpathError(
                    f"path data has more than {MAX_CONTOURS} subpaths; split the drawing", limit=MAX_CONTOURS
                )
        self._pieces, self._line = [], [self._start]
        self.at, self._handle = self._start, ("", 0j)


def _arc(start: complex, rx: float, ry: float, rotation: float, large: bool, sweep: bool, end: complex) -> Piece:
    """Return the arc with these ends, https://www.w3.org/TR/SVG2/implnote.html#ArcConversionEndpointToCenter.

    On the unit circle that the ellipse is the image of: the chord runs from u to −u about its middle, and the centre
    lies at ±iu √(1/|u|² − 1) from there. Radii that are too small are enlarged to |u| = 1.
    """
    turn = cmath.rect(1.0, radians(rotation % 360.0))
    half = (start - end) / 2 * turn.conjugate()
    u = complex(half.real / rx, half.imag / ry)
    size = abs(u)
    if size < _NO_RADIUS:  # the ends are the same but for rounding
        return Lines(_space([start, end]))
    if size > 1:
        rx, ry, u, size = rx * size, ry * size, u / size, 1.0
    off = sqrt((1 - size) * (1 + size)) / size
    center = (-1j if large != sweep else 1j) * u * off
    x, y, middle = rx * turn, 1j * ry * turn, (start + end) / 2
    if size < _SHALLOW and not large:  # a rational parabola between the ends and where their tangents meet
        pole = -center * (size / abs(center)) ** 2
        points = [start, middle + pole.real * x + pole.imag * y, end]
        return Curve(_space(points), np.array([1.0, abs(center), 1.0]))
    first, angle = u - center, abs(cmath.phase((-u - center) / (u - center)))
    angle = 2 * pi - angle if large else angle
    place = middle + center.real * x + center.imag * y
    c, to_zero, to_quarter = _space([place, x, y])
    return EllipticArc(c, to_zero, to_quarter, cmath.phase(first), angle if sweep else -angle)


def _space(points: list[complex]) -> Array:
    """Return complex numbers as points (k, 3) with z = 0."""
    plane = np.array(points)
    return np.column_stack([plane.real, plane.imag, np.zeros(len(plane))])
