"""Pieces of drawings: the curves of SVG and DXF files, under affine maps, and their conversion to segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Protocol

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.cusps import is_plain, straight_turns, without_cusps
from pathcontrol.toolpaths.segments.segment import Polyline, Segment
from pathcontrol.toolpaths.text import MAX_COORDINATE, MAX_SEGMENTS

NOTHING = 1e-9  # m, a shorter piece has no length
_CURVE = 10  # lines
_LARGEST_RADIUS = 100 * MAX_COORDINATE  # m; the ends of an arc of a larger one would not be known to 1 nm


class Piece(Protocol):
    """A curve whose image under an affine map is a curve of the same kind."""

    def mapped(self, matrix: Array) -> Piece:
        """Return the image under an affine map, a matrix (4, 4)."""
        ...

    def segments(self) -> list[Segment]:
        """Return the piece, with lengths in metres, as segments that are regular inside; none if it has no length.

        Raises:
            ToolpathError: it is not finite, or lies too far away.
        """
        ...


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight lines through points (k, 3)."""

    points: Array

    def mapped(self, matrix: Array) -> Lines:
        return Lines(_map(self.points, matrix))

    def segments(self) -> list[Segment]:
        points = drop_repeated(_check_bounded(self.points))
        return [Polyline(points)] if len(points) > 1 else []


@dataclass(frozen=True, eq=False)
class Curve:
    """A Bézier curve with control points (degree + 1, 3), and weights if it is rational."""

    points: Array
    weights: Array | None = None

    def mapped(self, matrix: Array) -> Curve:
        return replace(self, points=_map(self.points, matrix))

    def segments(self) -> list[Segment]:
        straight = straight_turns(_check_bounded(self.points), self.weights, NOTHING)
        if straight is not None:
            return Lines(straight).segments()
        return [Bezier(*part) for part in without_cusps(self.points, self.weights)]


@dataclass(frozen=True, eq=False)
class Curves:
    """Polynomial Bézier curves of one degree, one after another, with control points (k, degree + 1, 3)."""

    points: Array

    def mapped(self, matrix: Array) -> Curves:
        return Curves(_map(self.points, matrix))

    def segments(self) -> list[Segment]:
        plain = is_plain(_check_bounded(self.points), NOTHING)
        found: list[Segment] = list(Bezier.of_each(self.points[plain]))
        if plain.all():
            return found
        several = iter(found)
        parts = (
            [next(several)] if good else Curve(row).segments() for good, row in zip(plain, self.points, strict=True)
        )
        return [segment for part in parts for segment in part]


@dataclass(frozen=True, eq=False)
class EllipticArc:
    """An elliptic arc c + cos φ x + sin φ y, φ from ``start`` to ``start`` + ``sweep`` [rad]; c, x and y are (3,)."""

    center: Array
    x: Array
    y: Array
    start: float
    sweep: float

    def mapped(self, matrix: Array) -> EllipticArc:
        with np.errstate(over="ignore", invalid="ignore"):  # segments() refuses values that are not finite
            x, y = matrix[:3, :3] @ self.x, matrix[:3, :3] @ self.y
        return replace(self, center=_map(self.center, matrix), x=x, y=y)

    def segments(self) -> list[Segment]:
        _check_bounded(self.at(self.start + self.sweep * np.linspace(0.0, 1.0, 9)))
        vectors = _check_bounded(np.stack([self.x, self.y]), _LARGEST_RADIUS, "a radius of")
        directions, axes, _ = np.linalg.svd(vectors.T, full_matrices=False)
        if axes[0] * abs(self.sweep) <= NOTHING or axes[1] <= NOTHING:
            return Lines(self.at(self._turns(directions[:, 0]))).segments()
        return [Arc(self.center, self.x, self.y, self.start, self.sweep)]

    def at(self, angle: Array) -> Array:
        """Return points at angles (k,), (k, 3)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.center + np.outer(np.cos(angle), self.x) + np.outer(np.sin(angle), self.y)

    def _turns(self, along: Array) -> Array:
        """Return the angles at the ends and where a flattened arc turns back, in order."""
        first = np.arctan2(self.y @ along, self.x @ along)
        low, high = sorted((self.start, self.start + self.sweep))
        inside = first + np.pi * np.arange(np.ceil((low - first) / np.pi), np.floor((high - first) / np.pi) + 1)
        angles = np.unique(np.concatenate([[low, high], inside]))
        return angles if self.sweep > 0 else angles[::-1]


class Budget:
    """A counter of the content of a drawing, up to 2 000 000 lines or 200 000 curves: a curve counts as ten lines."""

    def __init__(self) -> None:
        self._used = 0

    def take(self, pieces: Sequence[Piece]) -> None:
        """Count more pieces.

        Raises:
            ToolpathError: it is too much.
        """
        self._used += sum(_effort(piece) for piece in pieces)
        if self._used > MAX_SEGMENTS:
            raise ToolpathError(
                f"the drawing has more than {MAX_SEGMENTS} lines, or {MAX_SEGMENTS // _CURVE} curves; split it",
                limit=MAX_SEGMENTS,
            )


def _effort(piece: Piece) -> int:
    """Return the count of a piece in the budget."""
    if isinstance(piece, Lines):
        return len(piece.points)
    return _CURVE * (len(piece.points) if isinstance(piece, Curves) else 1)


def drop_repeated(points: Array) -> Array:
    """Return the points without those that lie within 1 nm of the one kept before."""
    if (np.linalg.norm(np.diff(points, axis=0), axis=-1) > NOTHING).all():
        return points
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) > NOTHING:
            kept.append(point)
    return np.array(kept)


def ends_of(segment: Segment) -> tuple[Array, Array]:
    """Return the first and the last point of a segment [m], each (3,)."""
    if isinstance(segment, Polyline | Bezier):
        return segment.points[0], segment.points[-1]
    start, end = segment.point(np.array([0.0, 1.0]))
    return start, end


def contour_of(segments: Sequence[Segment], feed: float | None, name: str) -> Contour:
    """Return a contour of segments in a row; it is closed if the last one ends where the first begins."""
    gap = np.linalg.norm(ends_of(segments[-1])[1] - ends_of(segments[0])[0])
    return Contour(tuple(_merge(segments)), closed=bool(gap <= NOTHING), feed=feed, name=name)


def _merge(segments: Sequence[Segment]) -> list[Segment]:
    """Return the segments with consecutive polylines merged."""
    merged: list[Segment] = []
    for straight, group in groupby(segments, lambda segment: isinstance(segment, Polyline)):
        run = list(group)
        if straight and len(run) > 1:
            points = [segment.points for segment in run if isinstance(segment, Polyline)]
            run = [Polyline(np.concatenate([points[0], *(more[1:] for more in points[1:])]))]
        merged += run
    return merged


def _map(points: Array, matrix: Array) -> Array:
    """Apply an affine map to points."""
    with np.errstate(over="ignore", invalid="ignore"):  # segments() refuses values that are not finite
        return points @ matrix[:3, :3].T + matrix[:3, 3]


def _check_bounded(values: Array, most: float = MAX_COORDINATE, what: str = "a coordinate of") -> Array:
    """Check that values are finite and bounded."""
    largest = np.abs(values).max()
    if not largest <= most:
        raise ToolpathError(
            f"it has {what} {largest:g} m, expected finite numbers up to {most:g} m; is the unit of length right?",
            value=largest,
            limit=most,
        )
    return values
