"""Traversal of an SVG document, shape by shape."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.chains import Strand
from pathcontrol.toolpaths.drawing.pieces import Budget
from pathcontrol.toolpaths.notes import Notes
from pathcontrol.toolpaths.svg.attributes import Viewport, transform
from pathcontrol.toolpaths.svg.clip import Clips, Region
from pathcontrol.toolpaths.svg.document import Document, label_of, tag_of
from pathcontrol.toolpaths.svg.layers import Chosen, layer_name
from pathcontrol.toolpaths.svg.paint import Paint
from pathcontrol.toolpaths.svg.shapes import SHAPES, Attributes, subpaths
from pathcontrol.toolpaths.svg.style_sheet import REFUSED
from pathcontrol.toolpaths.svg.viewport import nested_view, page_view

_GROUPS = frozenset({"g", "a", "svg", "switch", "use"})
_WORDS = frozenset({"text", "flowRoot", "tspan"})
_DEFINITIONS = frozenset({"defs", "symbol", "clipPath", "mask", "marker", "pattern", "linearGradient"}) | {
    *("radialGradient", "filter", "style", "script", "title", "desc", "metadata", "view", "animate", "set"),
    *("animateTransform", "animateMotion", "font", "font-face", "cursor", "color-profile"),
}
_MOST_USES = 64  # depth of nesting
_MOST_ELEMENTS = 200_000


class _Place(NamedTuple):
    """The place of an element: the map, the viewport and the style that it inherits.

    Attributes:
        matrix: map from its user space to the workpiece [m], (4, 4).
        viewport: what its lengths refer to.
        chosen: whether it is in what is to be read.
        visible: whether it is not hidden.
        paint: what it inherits.
        clips: regions outside of which nothing is seen.
        layer: the layer it is on.
        uses: how many use elements led here.
    """

    matrix: Array
    viewport: Viewport
    chosen: bool
    visible: bool = True
    paint: Paint = Paint()
    clips: tuple[Region, ...] = ()
    layer: str = ""
    uses: int = 0


class Walk:
    """A traversal of a document, depth first, which enters referenced elements at the place of their use.

    Args:
        document: the drawing.
        chosen: what of it is read.
        skip: tags, in lower case, of what is left out.
        passed: takes note of what is not cut.
    """

    def __init__(self, document: Document, chosen: Chosen, skip: frozenset[str], passed: Notes) -> None:
        self._document, self._chosen, self._skip, self._passed = document, chosen, skip, passed
        self._clips = Clips(document)
        self._ahead: list[tuple[Any, _Place]] = []
        self._shapes, self._count, self._budget = 0, 0, Budget()

    def strands(self, ppi: float) -> Iterator[Strand]:
        """Traverse all that is drawn; return a strand for each subpath that has a length."""
        root = self._document.root
        with self._document.at(root):
            if "transform" in self._document.style(root):
                raise ToolpathError("transform of the outermost element is not read; put it on a group inside")
            view = page_view(self._document.attributes(root), ppi)
        self._ahead = [(root, _Place(view.matrix, view.viewport, self._chosen.all))]
        for _ in range(_MOST_ELEMENTS):
            if not self._ahead:
                return
            element, place = self._ahead.pop()
            with self._document.at(element):
                found = self._visit(element, place)
            yield from found
        raise ToolpathError(
            f"{self._document.path} draws more than {_MOST_ELEMENTS} elements; split it into several files",
            limit=_MOST_ELEMENTS,
            file=str(self._document.path),
        )

    def _visit(self, element: Any, place: _Place, sized: Attributes | None = None) -> list[Strand]:
        """Return the strands of a shape; the content of a group is put on the stack.

        A use element enters the symbol or svg element that it refers to with its own ``sized``, width and height.
        """
        tag, style = tag_of(element), self._document.style(element)
        if tag is None or (tag in _DEFINITIONS and sized is None) or tag.lower() in self._skip:
            return []
        if element.get("requiredExtensions"):
            return []
        group = tag in _GROUPS or sized is not None
        place = self._seen(element, style, place)
        if not place.chosen and (not group or tag == "use"):
            return []
        if place.chosen and style.get("display") == "none" and not self._chosen.named(element):
            self._passed.pass_over("a hidden element", self._where(element))
            return []
        if tag not in SHAPES and not group:
            if place.visible and (_has_words(element, place) if tag in _WORDS else place.paint.opacity > 0):
                self._passed.unless_refused(tag, self._where(element), _cannot_cut(tag))
            return []
        return self._entered(element, style, place, sized)

    def _seen(self, element: Any, style: dict[str, str], place: _Place) -> _Place:
        """Return the place with the properties that decide whether an element is visible."""
        visible = {"visible": True, "hidden": False, "collapse": False}.get(style.get("visibility", ""), place.visible)
        named = self._chosen.named(element)
        return place._replace(
            chosen=place.chosen or named,
            visible=visible if place.chosen and not named else True,
            paint=place.paint.inside(style),
            layer=layer_name(element) or place.layer,
        )

    def _entered(self, element: Any, style: dict[str, str], place: _Place, sized: Attributes | None) -> list[Strand]:
        """Return the strands of a shape in its own user space, or go on with the content of a group."""
        _refuse(style, element)
        if "transform" in style:
            place = place._replace(matrix=place.matrix @ transform(style["transform"]))
            if _flat(place.matrix):
                return []  # by the specification it is not drawn
        tag = tag_of(element)
        if tag in SHAPES and not self._is_painted(element, place):
            return []
        if "clip-path" in style or "mask" in style:
            place = place._replace(clips=place.clips + self._clips.of(element, place.matrix, place.viewport))
        if tag in SHAPES:
            return self._cut(element, place)
        if tag == "use":
            return self._use(element, place)
        self._enter(element, place, sized)
        return []

    def _is_painted(self, element: Any, place: _Place) -> bool:
        """Return whether a shape is visible; one that is not, or is dashed, is noted."""
        if not place.visible:
            self._passed.pass_over("a hidden element", self._where(element))
        elif not place.paint.seen:
            self._passed.pass_over(
                "a shape that paints nothing (no fill, no stroke, or transparent)", self._where(element)
            )
        elif place.paint.dashed:
            self._passed.pass_over("a dashed outline, which is cut solid,", self._where(element), "was found")
        return place.visible and place.paint.seen

    def _use(self, element: Any, place: _Place) -> list[Strand]:
        if place.uses == _MOST_USES:
            raise ToolpathError(
                f"more than {_MOST_USES} use elements inside each other; does it refer to itself?", limit=_MOST_USES
            )
        get, target = self._document.attributes(element), self._document.target(element)
        shift = np.eye(4)
        shift[:2, 3] = [place.viewport.length(get(name) or "0", name) for name in ("x", "y")]
        place = place._replace(matrix=place.matrix @ shift, uses=place.uses + 1)
        if tag_of(target) not in ("symbol", "svg"):
            self._ahead.append((target, place))
            return []
        own = self._document.attributes(target)
        return self._visit(target, place, lambda name: own(name) if get(name) is None else get(name))

    def _enter(self, element: Any, place: _Place, sized: Attributes | None) -> None:
        if tag_of(element) in ("svg", "symbol") and element is not self._document.root:
            get = self._document.attributes(element)
            view = nested_view(get, place.viewport, sized or get)
            place = place._replace(matrix=place.matrix @ view.matrix, viewport=view.viewport)
        inside = list(element)
        if tag_of(element) == "switch":
            inside = [child for child in inside if tag_of(child) and not child.get("requiredExtensions")][:1]
        self._ahead.extend((child, place) for child in reversed(inside))

    def _cut(self, element: Any, place: _Place) -> list[Strand]:
        """Return a strand for each subpath that has a length."""
        self._shapes += 1
        tag = tag_of(element) or ""
        drawn = subpaths(tag, self._document.attributes(element), place.viewport)
        name = element.get("id") or f"{tag} {self._shapes}"
        found = []
        for k, subpath in enumerate(drawn, 1):
            self._budget.take(subpath.pieces)
            segments = [s for piece in subpath.pieces for s in piece.mapped(place.matrix).segments()]
            if segments:
                self._count += 1
                found.append(Strand(f"{name}/{k}" if len(drawn) > 1 else name, place.layer, self._count, segments))
        if not found:
            self._passed.pass_over("a shape without length", self._where(element))
        if not all(region.holds(strand.segments) for region in place.clips for strand in found):
            raise ToolpathError(
                "a clip path or mask cuts part of it off: apply that in the drawing program, or take it away"
            )
        return found

    def _where(self, element: Any) -> str:
        return f"{label_of(element)} (line {element.sourceline})"


def _refuse(style: dict[str, str], element: Any) -> None:
    """Refuse a style that makes the visible drawing differ from what is cut."""
    if element.get("systemLanguage") is not None:
        raise ToolpathError("systemLanguage decides whether it is drawn; take that attribute away")
    for name in sorted(REFUSED & style.keys()):
        moot = name.startswith("transform-") and "transform" not in style
        if style[name] not in ("none", "1", "") and not moot:
            raise ToolpathError(
                f"{name} = {style[name][:60]!r} is not understood: apply it to the shapes in the drawing program, "
                "or take it away",
                value=style[name],
            )


def _has_words(element: Any, place: _Place) -> bool:
    """Return whether a text is visible; drawing programs leave empty ones behind."""
    return place.paint.seen and bool("".join(element.itertext()).strip())


def _flat(matrix: Array) -> bool:
    """Return whether a map has no inverse."""
    a, c, b, d = matrix[:2, :2].ravel().tolist()
    return a * d == b * c


def _cannot_cut(tag: str) -> str:
    ways = f"trace it, take it away, hide it, or leave it out with skip={tag!r}"
    if tag in _WORDS:
        return f"text cannot be cut: convert text to paths in the drawing program, {ways.partition(', ')[2]}"
    return f"{tag} is no outline that can be cut: {ways}"
