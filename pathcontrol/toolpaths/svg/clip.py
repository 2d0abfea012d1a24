"""Clip paths and masks of SVG that clip nothing, such as those of the page."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.pieces import EllipticArc, Lines, Piece
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline, Segment
from pathcontrol.toolpaths.svg.attributes import Viewport, transform
from pathcontrol.toolpaths.svg.document import Document, tag_of
from pathcontrol.toolpaths.svg.paint import Paint, is_black
from pathcontrol.toolpaths.svg.shapes import SHAPES, subpaths

_LINK = re.compile(r"""url\(\s*["']?([^"')]*)["']?\s*\)""")
_SAMPLES, _NEAR = 257, 1e-6  # of an outline; share of its size by which a drawing may stick out
_MOST_INSIDE = 8
_CLIPS = frozenset({"clip-path", "mask"})


@dataclass(frozen=True, eq=False)
class Region:
    """Convex polygons through which a clip path shows its elements.

    Attributes:
        polygons: corners of each [m], (k, 2), counterclockwise.
    """

    polygons: tuple[Array, ...]

    def holds(self, segments: Sequence[Segment]) -> bool:
        """Return whether all of the segments lie in one of the polygons."""
        return any(_contains(polygon, segments) for polygon in self.polygons)


class Clips:
    """A look-up of the clip paths and masks of elements.

    Args:
        document: the drawing.
    """

    def __init__(self, document: Document) -> None:
        self._document = document

    def of(self, element: Any, matrix: Array, viewport: Viewport) -> tuple[Region, ...]:
        """Return the regions outside of which an element is invisible; none if nothing is clipped for sure.

        Args:
            element: with the properties ``clip-path`` or ``mask``.
            matrix: map of its user space to the workpiece [m], (4, 4).
            viewport: what lengths refer to.

        Raises:
            ToolpathError: what clips it is not understood.
        """
        return tuple(self._regions(element, matrix, viewport, 0))

    def _regions(self, element: Any, matrix: Array, viewport: Viewport, depth: int) -> Iterator[Region]:
        style = self._document.style(element)
        for name in ("clip-path", "mask"):
            value = style.get(name, "none").strip()
            if value in ("none", ""):
                continue
            link = _LINK.fullmatch(value)
            try:
                if link is None or depth == _MOST_INSIDE:
                    raise ToolpathError("expected the id of one in this file")
                yield from self._linked(name, self._document.linked(link[1].strip()), matrix, viewport, depth)
            except ToolpathError as error:
                raise ToolpathError(
                    f"{name} = {value[:60]!r} is not understood ({error}): apply it to the shapes in the drawing "
                    "program, or take it away",
                    value=value,
                ) from error

    def _linked(self, name: str, clip: Any, matrix: Array, viewport: Viewport, depth: int) -> Iterator[Region]:
        """Yield the regions of one clipPath or mask element."""
        expected = "clipPath" if name == "clip-path" else "mask"
        if tag_of(clip) != expected:
            raise ToolpathError(f"it refers to {tag_of(clip)}, expected {expected}", value=tag_of(clip))
        yield from self._regions(clip, matrix, viewport, depth + 1)
        get, style = self._document.attributes(clip), self._document.style(clip)
        if name == "mask":
            yield from _mask_region(get, matrix, viewport)
        units = get("clipPathUnits" if name == "clip-path" else "maskContentUnits")
        boxed = units == "objectBoundingBox"
        place = (np.eye(4) if boxed else matrix) @ transform(style.get("transform", ""))
        region = Region(tuple(self._polygons(clip, place, Viewport(1, 1, 96) if boxed else viewport, name == "mask")))
        if not boxed:
            yield region
        elif not region.holds([Polyline(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]))]):
            raise ToolpathError("it is smaller than the box around what it clips")

    def _polygons(self, clip: Any, matrix: Array, viewport: Viewport, mask: bool) -> Iterator[Array]:
        for child in clip:
            tag, style = tag_of(child), self._document.style(child)
            if tag in (None, "title", "desc", "metadata") or style.get("display") == "none":
                continue
            place = matrix @ transform(style.get("transform", ""))
            if tag == "use" and not mask and not _CLIPS & style.keys():
                get = self._document.attributes(child)
                shift = np.eye(4)
                shift[:2, 3] = [viewport.length(get(name) or "0", name) for name in ("x", "y")]
                child, place = self._document.target(child), place @ shift
                tag, style = tag_of(child), self._document.style(child)
                place = place @ transform(style.get("transform", ""))
            if tag not in SHAPES or _CLIPS & style.keys():
                raise ToolpathError(f"it holds {tag}, expected a shape such as rect", value=tag)
            if mask and not self._lets_through(clip, child):
                raise ToolpathError(f"its {tag} is not opaque and bright", value=tag)
            drawn = subpaths(tag, self._document.attributes(child), viewport)
            if len(drawn) == 1:
                yield from _convex(drawn[0].pieces, place)

    def _lets_through(self, mask: Any, child: Any) -> bool:
        """Return whether a shape of a mask shows what lies behind it at all."""
        paint = Paint().inside(self._document.style(mask)).inside(self._document.style(child))
        alpha = "alpha" in (mask.get("mask-type") or "") or re.search(r"mask-type\s*:\s*alpha", mask.get("style") or "")
        return paint.fills and bool(alpha or not is_black(paint.fill))


def _mask_region(get: Any, matrix: Array, viewport: Viewport) -> Iterator[Region]:
    """Yield the box of a mask; by default it is larger than what is masked."""
    names, defaults = ("x", "y", "width", "height"), ("-10%", "-10%", "120%", "120%")
    texts = [get(name) or default for name, default in zip(names, defaults, strict=True)]
    if get("maskUnits") == "userSpaceOnUse":
        x, y, w, h = (viewport.length(text, name) for text, name in zip(texts, names, strict=True))
        corners = np.array([[x, y, 0], [x + w, y, 0], [x + w, y + h, 0], [x, y + h, 0]])
        yield Region(tuple(_convex([Lines(corners)], matrix)))
        return
    x, y, w, h = (Viewport(1, 1, 96).length(text, name) for text, name in zip(texts, names, strict=True))
    if x > _NEAR or y > _NEAR or x + w < 1 - _NEAR or y + h < 1 - _NEAR:
        raise ToolpathError("it is smaller than the box around what it masks")


def _convex(pieces: Sequence[Piece], matrix: Array) -> Iterator[Array]:
    """Yield the polygon (k, 2), counterclockwise, inside an outline of pieces, if it is convex."""
    points = np.concatenate([_outline(piece) for piece in pieces])
    plane = (points @ matrix[:3, :3].T + matrix[:3, 3])[:, :2]
    if not np.isfinite(plane).all():
        return
    apart = np.abs(plane - np.roll(plane, 1, axis=0)).max(1)
    plane = plane[apart > 1e-9 * np.ptp(plane)]
    if len(plane) < 3:
        return
    edges = np.roll(plane, -1, axis=0) - plane
    turns = _cross(edges, np.roll(edges, -1, axis=0))
    whole = np.arctan2(turns, (edges * np.roll(edges, -1, axis=0)).sum(1)).sum()
    if whole < 0:
        plane, turns, whole = plane[::-1], -turns, -whole
    if turns.min() >= -1e-9 * np.square(np.ptp(plane, axis=0).max()) and abs(whole - 2 * np.pi) < 1e-3:
        yield plane


def _outline(piece: Piece) -> Array:
    """Return points on a piece."""
    u = np.linspace(0.0, 1.0, _SAMPLES)
    if isinstance(piece, Lines):
        return piece.points
    if isinstance(piece, EllipticArc):
        return piece.at(piece.start + u * piece.sweep)
    return np.concatenate([segment.point(u) for segment in piece.segments()])


def _contains(polygon: Array, segments: Sequence[Segment]) -> bool:
    """Return whether segments lie in a convex polygon (k, 2), up to a millionth of its size."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    outward = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    most = (outward * polygon).sum(1) + _NEAR * float(np.ptp(polygon, axis=0).max())
    return all((_reach(segment, outward, most) <= most).all() for segment in segments)


def _reach(segment: Segment, outward: Array, most: Array) -> Array:
    """Return the extent of a segment in each direction (k, 2) [m], (k,), or a bound that is within ``most`` (k,)."""
    if isinstance(segment, Polyline | Bezier):
        hull = (outward @ segment.points[:, :2].T).max(1)
        if isinstance(segment, Polyline) or (hull <= most).all():
            return hull
        return (outward @ segment.point(np.linspace(0.0, 1.0, 1025))[:, :2].T).max(1)
    assert isinstance(segment, Arc)  # it reaches farthest at an end, or where its tangent is square to the direction
    farthest = np.arctan2(outward @ segment.y[:2], outward @ segment.x[:2])
    turns = np.mod((farthest - segment.start) * np.sign(segment.sweep), 2 * np.pi) / abs(segment.sweep)
    u = np.column_stack([np.where(turns <= 1, turns, 0.0), np.zeros(len(outward)), np.ones(len(outward))])
    return (segment.point(u)[..., :2] @ outward[:, :, None])[..., 0].max(1)


def _cross(a: Array, b: Array) -> Array:
    """Return the cross product of vectors in the plane."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
