"""Objects of a scene as three.js reads them from JSON, in the words of Meshcat's protocol.

The format is that of ``ObjectLoader`` of three.js; its typed arrays are extensions of Meshcat's MessagePack.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import umsgpack

from pathcontrol._arrays import Array
from pathcontrol.view.bodies.body_shapes import Box, Color, Cylinder, Mesh, Shape, Sphere

Description: TypeAlias = dict[str, Any]
BACK, BOTH = 1, 2  # which side of a triangle is drawn
WHITE: Color = (1.0, 1.0, 1.0, 1.0)
_ROUND, _BALL = 50, 20  # edges around a cylinder, and around and along a sphere
_ARRAYS = {"Uint32Array": (np.uint32, 0x16), "Float32Array": (np.float32, 0x17)}  # types of Meshcat's extensions


def describe_object(kind: str, geometry: Description, material: Description, count: int) -> Description:
    """Return an object, whose parts have the next three numbers after ``count`` as names."""
    thing, shape, surface = (str(count + k) for k in (1, 2, 3))
    matrix = np.eye(4).ravel().tolist()
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [{"uuid": shape} | geometry],
        "materials": [{"uuid": surface} | material],
        "object": {"uuid": thing, "type": kind, "geometry": shape, "material": surface, "matrix": matrix},
    }


def describe_material(kind: str, color: Color, side: int, *, of_vertices: bool = False) -> Description:
    """Return a material in one colour, or in those of the vertices; it is see-through where its opacity is below 1."""
    return {
        "type": kind,
        "color": _rgb(color),
        "reflectivity": 0.5,
        "side": side,
        "transparent": bool(color[3] != 1),
        "opacity": color[3],
        "linewidth": 1.0,
        "wireframe": False,
        "wireframeLinewidth": 1.0,
        "vertexColors": 2 if of_vertices else 0,
    }


def describe_shape(shape: Shape) -> Description:
    """Return a shape as geometry; a cylinder of three.js is along y."""
    if isinstance(shape, Box):
        width, height, depth = shape.size.tolist()
        return {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}
    if isinstance(shape, Cylinder):
        ends = {"radiusTop": shape.radius, "radiusBottom": shape.radius}
        return {"type": "CylinderGeometry", **ends, "height": shape.length, "radialSegments": _ROUND}
    if isinstance(shape, Sphere):
        segments = {"widthSegments": _BALL, "heightSegments": _BALL}
        return {"type": "SphereGeometry", "radius": shape.radius, **segments}
    return describe_surface(shape)


def describe_surface(mesh: Mesh, colors: Array | None = None) -> Description:
    """Return triangles as geometry, with colours (k, 3) of their vertices if any."""
    attributes = {"position": _array("Float32Array", mesh.vertices)}
    if colors is not None:
        attributes["color"] = _array("Float32Array", colors)
    return {"type": "BufferGeometry", "data": {"attributes": attributes, "index": _array("Uint32Array", mesh.faces)}}


def describe_segments(segments: Array) -> Description:
    """Return line segments [m], (k, 2, 3), as geometry."""
    attributes = {"position": _array("Float32Array", segments.reshape(-1, 3))}
    return {"type": "BufferGeometry", "data": {"attributes": attributes}}


def _array(kind: str, values: Any) -> Description:
    """Return rows of three numbers as a typed array of JavaScript."""
    number, code = _ARRAYS[kind]
    data = np.ascontiguousarray(values, dtype=number).tobytes()
    return {"itemSize": 3, "type": kind, "array": umsgpack.Ext(code, data), "normalized": False}


def _rgb(color: Color) -> int:
    """Return a colour as one number."""
    red, green, blue = (round(255 * channel) for channel in color[:3])
    return red << 16 | green << 8 | blue
