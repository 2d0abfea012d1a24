"""Recipes of contours as plain values and arrays, exact for lines, arcs and Bézier curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline, Segment

_NEAR = 1e-7  # m, from segments of any other kind to the polylines that are kept of them
_FINEST = 1 << 20

Put = Callable[[Array], dict[str, Any]]  # stores an array and returns its reference in the recipe
Get = Callable[[Mapping[str, Any]], Array]


def contour_recipe(contour: Contour, put: Put) -> dict[str, Any]:
    """Return the recipe of a contour, from which :func:`contour_of` rebuilds it; ``put`` stores arrays."""
    recipe: dict[str, Any] = {"segments": [_segment_recipe(segment, put) for segment in contour.segments]}
    recipe |= {"closed": contour.closed, "feed": contour.feed, "rapid": contour.rapid, "name": contour.name}
    return recipe if contour.normals is None else recipe | {"normals": put(contour.normals)}


def contour_of(recipe: dict[str, Any], get: Get) -> Contour:
    """Rebuild the contour of a recipe, whose arrays ``get`` loads."""
    segments = tuple(_segment_of(segment, get) for segment in recipe["segments"])
    normals = get(recipe["normals"]) if "normals" in recipe else None
    return Contour(segments, recipe["closed"], recipe["feed"], recipe["rapid"], recipe["name"], normals)


def _segment_recipe(segment: Segment, put: Put) -> dict[str, Any]:
    """Return the recipe of a segment."""
    if type(segment) is Arc:
        vectors = [segment.center, segment.x, segment.y, segment.rise]
        return {"arc": put(np.concatenate([*vectors, [segment.start, segment.sweep]]))}
    if type(segment) is Bezier:
        weights = None if segment.weights is None else put(segment.weights)
        return {"bezier": put(segment.points), "weights": weights}
    return {"line": put(segment.points if type(segment) is Polyline else _polyline(segment))}


def _segment_of(recipe: dict[str, Any], get: Get) -> Segment:
    """Rebuild the segment of a recipe."""
    if "line" in recipe:
        return Polyline(get(recipe["line"]))
    if "arc" in recipe:
        center, x, y, rise, (start, sweep) = np.split(get(recipe["arc"]), [3, 6, 9, 12])
        return Arc(center, x, y, float(start), float(sweep), rise)
    if "bezier" in recipe:
        return Bezier(get(recipe["bezier"]), None if recipe["weights"] is None else get(recipe["weights"]))
    raise InputError(
        f"a segment is said to be {', '.join(recipe)}, expected a line, an arc or a Bézier curve", value=list(recipe)
    )


def _polyline(segment: Segment) -> Array:
    """Return points (k, 3) on a segment of any kind, whose edges are within 0.1 µm of it."""
    edges = 64
    while True:
        points = segment.point(np.linspace(0.0, 1.0, 2 * edges + 1))
        sag = np.linalg.norm(points[1::2] - (points[:-2:2] + points[2::2]) / 2, axis=-1).max()
        if sag <= _NEAR / 2 or edges >= _FINEST:
            return points
        edges *= 2
