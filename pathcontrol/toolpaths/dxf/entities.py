"""Conversion of DXF entities to pieces, in the units and world coordinates of the drawing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.pieces import EllipticArc, Lines, Piece
from pathcontrol.toolpaths.dxf.polylines import light_polyline, polyline
from pathcontrol.toolpaths.dxf.splines import b_spline, interpolate
from pathcontrol.toolpaths.dxf.values import check_given, number, object_axes, sweep_between, vector

_CLOSED = 1


def pieces(entity: Any) -> list[Piece] | None:
    """Return the pieces of an entity, one after another; None if it cannot be cut.

    Raises:
        ToolpathError: something is missing in it, or not finite.
    """
    draw = _DRAW.get(entity.dxftype())
    return None if draw is None else draw(entity)


def _line(entity: Any) -> list[Piece]:
    """Return the pieces of a LINE."""
    check_given(entity, "start", "end")
    return [Lines(np.stack([vector(entity, "start"), vector(entity, "end")]))]


def _circle(entity: Any) -> list[Piece]:
    """Return the pieces of a CIRCLE."""
    return [_arc_between(entity, 0.0, 360.0)]


def _arc(entity: Any) -> list[Piece]:
    """Return the pieces of an ARC."""
    check_given(entity, "start_angle", "end_angle")
    return [_arc_between(entity, number(entity, "start_angle"), number(entity, "end_angle"))]


def _arc_between(entity: Any, start: float, end: float) -> EllipticArc:
    """Return the counterclockwise arc from one angle to the other [°], a full turn if they are the same."""
    check_given(entity, "center", "radius")
    radius, axes = number(entity, "radius"), object_axes(entity)
    if radius <= 0:
        raise ToolpathError(f"its radius is {radius:g}, expected more than 0")
    center, first = axes @ vector(entity, "center"), float(np.radians(start))
    return EllipticArc(
        center, radius * axes[:, 0], radius * axes[:, 1], first, sweep_between(first, float(np.radians(end)))
    )


def _ellipse(entity: Any) -> list[Piece]:
    """Return the pieces of an ELLIPSE."""
    check_given(entity, "center", "major_axis", "ratio")
    major, ratio = vector(entity, "major_axis"), number(entity, "ratio")
    minor = ratio * np.cross(object_axes(entity)[:, 2], major)
    start, end = number(entity, "start_param"), number(entity, "end_param")
    return [EllipticArc(vector(entity, "center"), major, minor, start, sweep_between(start, end))]


def _spline(entity: Any) -> list[Piece]:
    """Return the pieces of a SPLINE."""
    closed = bool(entity.dxf.get("flags", 0) & _CLOSED)
    control, fit = (_points(v) for v in (entity.control_points, entity.fit_points))
    if len(control):
        weights = np.array(entity.weights, dtype=np.float64)
        knots = np.array(entity.knots, dtype=np.float64)
        return b_spline(int(entity.dxf.degree), knots, control, weights if len(weights) else None)
    if not np.isfinite(fit).all():
        raise ToolpathError("it has a fit point that is not finite")
    tangents = None
    if entity.dxf.hasattr("start_tangent") and entity.dxf.hasattr("end_tangent"):
        tangents = (vector(entity, "start_tangent"), vector(entity, "end_tangent"))
        if not all(np.linalg.norm(t) > 0 for t in tangents):
            tangents = None
    return interpolate(fit, tangents, closed)


_DRAW: dict[str, Callable[[Any], list[Piece] | None]] = {
    "LINE": _line,
    "CIRCLE": _circle,
    "ARC": _arc,
    "ELLIPSE": _ellipse,
    "LWPOLYLINE": light_polyline,
    "POLYLINE": polyline,
    "SPLINE": _spline,
    "HELIX": _spline,
}


#: types of entities that are read
DRAWN = frozenset(_DRAW)


def _points(vertices: Any) -> Array:
    return np.array([tuple(vertex) for vertex in vertices], dtype=np.float64).reshape(-1, 3)
