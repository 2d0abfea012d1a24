"""Conversion of DXF entities to pieces, in the units and world coordinates of the drawing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.pieces import Curve, EllipticArc, Lines, Piece
from pathcontrol.toolpaths.dxf.splines import b_spline, interpolate
from pathcontrol.toolpaths.dxf.values import check_given, in_space, number, object_axes, sweep_between, vector

_CLOSED = 1
_SHALLOW = 1e-3  # bulge below which the centre of an arc is too far away to start from
_FRAME = 16  # a vertex that only steers a spline


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
        raise ToolpathError(f"its radius is {radius:g}, expected more than 0", value=radius, limit=0.0)
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


def _points(vertices: Any) -> Array:
    return np.array([tuple(vertex) for vertex in vertices], dtype=np.float64).reshape(-1, 3)


def light_polyline(entity: Any) -> list[Piece]:
    """Return the pieces of an LWPOLYLINE."""
    points = np.array(entity.get_points("xyb"), dtype=np.float64).reshape(-1, 3)
    return _convert(entity, points[:, :2], number(entity, "elevation"), points[:, 2], bool(entity.closed))


def polyline(entity: Any) -> list[Piece] | None:
    """Return the pieces of a POLYLINE; None if it is a mesh."""
    if not (entity.is_2d_polyline or entity.is_3d_polyline):
        return None
    vertices = [v for v in entity.vertices if not v.dxf.get("flags", 0) & _FRAME]
    points = np.array([tuple(vector(v, "location")) for v in vertices]).reshape(-1, 3)
    closed = bool(entity.is_closed)
    if entity.is_3d_polyline:
        return [Lines(np.concatenate([points, points[:1]]) if closed else points)] if len(points) else []
    bulges = np.array([number(v, "bulge") for v in vertices])
    return _convert(entity, points[:, :2], float(vector(entity, "elevation")[2]), bulges, closed)


def _convert(entity: Any, points: Array, elevation: float, bulges: Array, closed: bool) -> list[Piece]:
    """Return a polyline in object coordinates; a bulge is tan(Δφ/4) of the arc to the next point."""
    if not (np.isfinite(points).all() and np.isfinite(bulges).all()):
        raise ToolpathError("it has a coordinate or a bulge that is not finite")
    to_world = np.eye(4)
    to_world[:3, :3] = object_axes(entity)
    to_world[:3, 3] = elevation * to_world[:3, 2]
    corners = points[:, 0] + 1j * points[:, 1]
    corners = np.append(corners, corners[:1]) if closed else corners
    drawn: list[Piece] = []
    turns = [int(i) for i in np.flatnonzero(bulges[: max(len(corners) - 1, 0)]) if corners[i] != corners[i + 1]]
    begin = 0
    for i in turns:
        drawn += [Lines(in_space(corners[begin : i + 1])), _bulge(corners[i], corners[i + 1], bulges[i])]
        begin = i + 1
    if len(corners):
        drawn.append(Lines(in_space(corners[begin:])))
    return [piece.mapped(to_world) for piece in drawn]


def _bulge(start: complex, end: complex, bulge: float) -> Piece:
    """Return the arc between two vertices with a bulge."""
    middle, half = (start + end) / 2, (end - start) / 2
    if abs(bulge) < _SHALLOW:  # a rational parabola between the ends and where their tangents meet
        pole = middle - 2j * half * bulge / (1 - bulge**2)
        weight = (1 - bulge**2) / (1 + bulge**2)
        return Curve(in_space(np.array([start, pole, end])), np.array([1.0, weight, 1.0]))
    center = middle + 0.5j * half * (1 / bulge - bulge)
    c, x, y = in_space(np.array([center, start - center, 1j * (start - center)]))
    return EllipticArc(c, x, y, 0.0, 4 * float(np.arctan(bulge)))


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
