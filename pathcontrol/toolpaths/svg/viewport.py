"""The viewport of an SVG element: width, height, viewBox and preserveAspectRatio."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.svg.attributes import Viewport, numbers
from pathcontrol.toolpaths.svg.shapes import Attributes

_ALIGN = re.compile("none|x(Min|Mid|Max)Y(Min|Mid|Max)")
_SHARE = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
_INCH = 0.0254  # m


class View(NamedTuple):
    """A viewport and the map from its content to the surrounding coordinates, (4, 4)."""

    viewport: Viewport
    matrix: Array


def page_view(get: Attributes, ppi: float) -> View:
    """Return the view of the outermost element, in metres, y up, from the lower left corner of the page."""
    box = _view_box(get)
    width, height = _page_size(get, box, ppi)
    inner = _fit(box, Viewport(width, height, ppi), get)
    scale = _INCH / ppi
    metres = np.array([[scale, 0, 0, 0], [0, -scale, 0, scale * height], [0, 0, 1, 0], [0, 0, 0, 1]])
    return View(inner.viewport, metres @ inner.matrix)


def nested_view(get: Attributes, outer: Viewport, size: Attributes) -> View:
    """Return the view of an inner svg or symbol element; ``size`` gives width and height, by default 100 %."""
    place = np.eye(4)
    place[:2, 3] = [outer.length(get(name) or "0", name) for name in ("x", "y")]
    width, height = (outer.length(_explicit_size(size, name) or "100%", name) for name in ("width", "height"))
    if width < 0 or height < 0:
        raise ToolpathError(
            f"width = {width:g}, height = {height:g}, expected lengths not below 0", value=(width, height), limit=0.0
        )
    inner = _fit(_view_box(get), Viewport(width, height, outer.ppi), get)
    return View(inner.viewport, place @ inner.matrix)


def page_unit(get: Attributes) -> str:
    """Return the unit that the size of the page is given in."""
    for name in ("width", "height"):
        unit = (_explicit_size(get, name) or "").strip().lstrip("+-.0123456789eE").strip()
        if unit and unit != "%":
            return unit
    return "px"


def _page_size(get: Attributes, box: list[float] | None, ppi: float) -> tuple[float, float]:
    """Return width and height in px; missing ones follow from the viewBox, as in browsers."""
    sizes = [_explicit_size(get, name) for name in ("width", "height")]
    sizes = [None if size is None or size.strip().endswith("%") else size for size in sizes]
    unknown = Viewport(0.0, 0.0, ppi)
    width, height = (
        None if size is None else unknown.length(size, name)
        for size, name in zip(sizes, ("width", "height"), strict=True)
    )
    if box is None:
        if height is None:
            raise ToolpathError(
                "the page has neither a height nor a viewBox, so that its lower edge, y = 0, is unknown: give it one"
            )
        return width or 0.0, height
    if width is None and height is None:
        width, height = box[2], box[3]
    width = height * box[2] / box[3] if width is None and height is not None else width
    height = width * box[3] / box[2] if height is None and width is not None else height
    assert width is not None
    assert height is not None
    if not (width > 0 and height > 0):
        raise ToolpathError(
            f"the page is {width:g} px wide and {height:g} px high, expected more than 0",
            value=(width, height),
            limit=0.0,
        )
    return width, height


def _explicit_size(get: Attributes, name: str) -> str | None:
    """Return the text of a size, None for ``auto`` or none."""
    text = get(name)
    return None if text is None or text.strip() == "auto" else text


def _view_box(get: Attributes) -> list[float] | None:
    """Return the viewBox, None where there is none."""
    text = get("viewBox")
    if text is None:
        return None
    box = numbers(text, "viewBox")
    if len(box) != 4 or not min(box[2:]) > 0:
        raise ToolpathError(f"viewBox = {text[:60]!r}, expected x, y, a width and a height greater than 0", value=text)
    return box


def _fit(box: list[float] | None, viewport: Viewport, get: Attributes) -> View:
    """Fit the viewBox into a viewport, https://www.w3.org/TR/SVG2/coords.html#ComputingAViewportsTransform."""
    matrix = np.eye(4)
    if box is None:
        return View(viewport, matrix)
    text = get("preserveAspectRatio") or "xMidYMid"
    word, *fit = text.split() or [""]
    aspect = _ALIGN.fullmatch(word)
    if aspect is None or fit not in ([], ["meet"], ["slice"]):
        raise ToolpathError(f"preserveAspectRatio = {text[:60]!r}, expected none or such as xMidYMid meet", value=text)
    size = np.array([viewport.width, viewport.height])
    scale = size / box[2:]
    if word != "none":
        scale[:] = scale.max() if fit == ["slice"] else scale.min()
    share = [_SHARE[align or "Min"] for align in aspect.groups()]
    matrix[[0, 1], [0, 1]] = scale
    matrix[:2, 3] = share * (size - scale * box[2:]) - scale * box[:2]
    return View(Viewport(box[2], box[3], viewport.ppi), matrix)
