"""Reader of SVG drawings.

lxml parses the document; what its elements draw is worked out here, by the specification. Libraries were tried:
svgelements 1.9.6 places nested svg elements wrongly, draws symbols, masks and markers that only define, takes an inch
for 25.39999 mm, cuts malformed path data off without a word and recurses on a use element inside itself until Python
stops it; svgpathtools 1.8.0 and svg.path 7.1 read path data, but know no units, styles or use elements, and forgive
or lose part of what they read. A contour that is silently another one is a scrapped part.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array, scalar
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.contour import Contour, Toolpath
from pathcontrol.toolpaths.passed import Passed
from pathcontrol.toolpaths.pieces import Budget, contour_of
from pathcontrol.toolpaths.svg_document import Document, tag_of
from pathcontrol.toolpaths.svg_shapes import SHAPES, Attributes, subpaths
from pathcontrol.toolpaths.svg_style import REFUSED
from pathcontrol.toolpaths.svg_values import Viewport, transform
from pathcontrol.toolpaths.svg_view import nested, page, page_unit

_GROUPS = frozenset({"g", "a", "svg", "switch", "use"})
_DEFINITIONS = frozenset({"defs", "symbol", "clipPath", "mask", "marker", "pattern", "linearGradient"}) | {
    *("radialGradient", "filter", "style", "script", "title", "desc", "metadata", "view", "animate", "set"),
    *("animateTransform", "animateMotion", "font", "font-face", "cursor", "color-profile"),
}
_MOST_USES = 64  # inside each other
_MOST_ELEMENTS = 200_000


def read_svg(
    path: str | os.PathLike[str], ppi: float = 96.0, feed: float | None = None, unknown: str = "refuse"
) -> Toolpath:
    """The outlines that an SVG file draws, in its order: a contour for each subpath, named after the element's id.

    Lengths are those on the page, by its width and height (mm, cm, in, pt, pc, Q, px) and its viewBox. The drawing
    stands upright, x to the right and y up from the page's lower left corner, z = 0. Everything visible is cut, be it
    stroke or fill, of whatever colour, and also beyond the edges of the page; what is hidden or only defined is not.
    Bézier curves and elliptic arcs stay what they are.

    Args:
        path: the file.
        ppi: pixels per inch, 96 by CSS; some programs write 72 or 90.
        feed: speed of the tool [m/s] along all contours, or None: SVG has none.
        unknown: ``"refuse"`` what is not understood, or ``"warn"``, pass it over where it cannot change what is cut.

    Raises:
        ToolpathError: the file is no SVG, defines entities, or holds what is not understood or cannot be cut: text,
            images, clipping, malformed attributes. The message says in which line and element.
        InputError: ``ppi`` or ``feed`` is not greater than 0, ``unknown`` is no choice.
    """
    scalar("ppi", ppi, positive=True)
    if feed is not None:
        scalar("feed", feed, positive=True)
    passed = Passed(unknown)
    document = Document(path)
    contours = tuple(_Walk(document, feed).contours(ppi))
    if not contours:
        raise ToolpathError(f"{document.path} draws no outline; expected paths or shapes that are not hidden")
    return Toolpath(contours, document.path, page_unit(document.attributes(document.root)), passed.notes)


class _Place(NamedTuple):
    """Where and how an element is drawn: the map to the workpiece [m], the viewport, and how many uses led here."""

    matrix: Array
    viewport: Viewport
    visible: bool = True
    uses: int = 0


class _Walk:
    """The way through a document, depth first, entering what use elements refer to as if it stood there."""

    def __init__(self, document: Document, feed: float | None) -> None:
        self._document, self._feed = document, feed
        self._ahead: list[tuple[Any, _Place]] = []
        self._shapes, self._budget = 0, Budget()

    def contours(self, ppi: float) -> Iterator[Contour]:
        """The contours of all that is drawn."""
        root = self._document.root
        with self._document.at(root):
            if "transform" in self._document.style(root):
                raise ToolpathError("transform of the outermost element is not read; put it on a group inside")
            view = page(self._document.attributes(root), ppi)
        self._ahead = [(root, _Place(view.matrix, view.viewport))]
        for _ in range(_MOST_ELEMENTS):
            if not self._ahead:
                return
            element, place = self._ahead.pop()
            with self._document.at(element):
                found = self._visit(element, place)
            yield from found
        raise ToolpathError(
            f"{self._document.path} draws more than {_MOST_ELEMENTS} elements; split it into several files"
        )

    def _visit(self, element: Any, place: _Place, sized: Attributes | None = None) -> list[Contour]:
        """The contours of a shape; what is inside a group goes on the stack.

        A use element enters the symbol or svg element that it refers to with its own ``sized``, width and height.
        """
        tag, style = tag_of(element), self._document.style(element)
        if tag is None or (tag in _DEFINITIONS and sized is None) or style.get("display") == "none":
            return []
        if element.get("requiredExtensions"):
            return []
        visible = {"visible": True, "hidden": False, "collapse": False}.get(style.get("visibility", ""), place.visible)
        if tag not in SHAPES and tag not in _GROUPS and sized is None:
            if visible:
                raise ToolpathError(_cannot_cut(tag))
            return []
        _refuse(style, element)
        place = place._replace(visible=visible)
        if "transform" in style:
            place = place._replace(matrix=place.matrix @ transform(style["transform"]))
            if _flat(place.matrix):
                return []  # by the specification it is not drawn
        if tag in SHAPES:
            return self._cut(element, place) if visible else []
        if tag == "use":
            return self._use(element, place)
        self._enter(element, place, sized)
        return []

    def _use(self, element: Any, place: _Place) -> list[Contour]:
        if place.uses == _MOST_USES:
            raise ToolpathError(f"more than {_MOST_USES} use elements inside each other; does it refer to itself?")
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
            view = nested(get, place.viewport, sized or get)
            place = place._replace(matrix=place.matrix @ view.matrix, viewport=view.viewport)
        inside = list(element)
        if tag_of(element) == "switch":
            inside = [child for child in inside if tag_of(child) and not child.get("requiredExtensions")][:1]
        self._ahead.extend((child, place) for child in reversed(inside))

    def _cut(self, element: Any, place: _Place) -> list[Contour]:
        """One contour for each subpath that has a length."""
        self._shapes += 1
        tag = tag_of(element) or ""
        drawn = subpaths(tag, self._document.attributes(element), place.viewport)
        name = element.get("id") or f"{tag} {self._shapes}"
        found = []
        for k, subpath in enumerate(drawn, 1):
            self._budget.take(subpath.pieces)
            segments = [s for piece in subpath.pieces for s in piece.mapped(place.matrix).segments()]
            if segments:
                found.append(contour_of(segments, self._feed, f"{name}/{k}" if len(drawn) > 1 else name))
        return found


def _refuse(style: dict[str, str], element: Any) -> None:
    """An error for what would make what is seen something else than what is cut."""
    if element.get("systemLanguage") is not None:
        raise ToolpathError("systemLanguage decides whether it is drawn; take that attribute away")
    for name in sorted(REFUSED & style.keys()):
        moot = name.startswith("transform-") and "transform" not in style
        if style[name] not in ("none", "1", "") and not moot:
            raise ToolpathError(
                f"{name} = {style[name][:60]!r} is not understood: apply it to the shapes in the drawing program, "
                "or take it away"
            )


def _flat(matrix: Array) -> bool:
    """Whether a map has no inverse."""
    a, c, b, d = matrix[:2, :2].ravel().tolist()
    return a * d == b * c


def _cannot_cut(tag: str) -> str:
    if tag in ("text", "flowRoot", "tspan"):
        return "text cannot be cut: convert text to paths in the drawing program, or hide it"
    return f"{tag} is no outline that can be cut: trace it, take it away or hide it"
