"""The visuals of a robot's links, from the ``<visual>`` elements of its URDF."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import UrdfError, warn
from pathcontrol.robot.urdf import parse_urdf
from pathcontrol.robot.urdf.links import read_pose
from pathcontrol.robot.urdf.mesh_files import find_mesh
from pathcontrol.view.bodies.body_links import reach
from pathcontrol.view.bodies.body_shapes import Box, Color, Cylinder, Shape, Sphere

if TYPE_CHECKING:
    from pathcontrol.robot.arm_dynamics import UrdfSource

UNPAINTED: Color = (0.72, 0.74, 0.77, 1.0)


@dataclass(frozen=True, eq=False)
class LinkVisual:
    """One shape of one colour that moves with a link.

    Attributes:
        link: name of the link, which is also the name of its frame.
        name: name of the visual, empty if it has none.
        origin: pose of the shape in the frame of the link [m], (4, 4) homogeneous.
        shape: what it looks like.
        color: red, green, blue and opacity.
    """

    link: str
    name: str
    origin: Array
    shape: Shape
    color: Color

    @cached_property
    def outline(self) -> Array:
        """The outermost points in the frame of the link [m], (k, 3)."""
        return self.shape.outline @ self.origin[:3, :3].T + self.origin[:3, 3]


def link_visuals(source: UrdfSource, fineness: float = 0.0) -> list[LinkVisual]:
    """Return the visuals of every link, in the order of the URDF, without collision shapes.

    Meshes are thinned out where that moves their surface by no more than ``fineness`` times the reach of the arm.

    A visual that cannot be read, or whose mesh file cannot, is left out with a warning that names it. The
    colours inside a mesh file win over the URDF's, as in RViz.
    """
    root = parse_urdf(source.text)
    palette, detail = _palette(root), fineness * reach(source)
    visuals: list[LinkVisual] = []
    for link in root.iterchildren("link"):
        for element in link.iterchildren("visual"):
            visuals += _visuals(link.get("name", ""), element, palette, source, detail)
    return visuals


def leaf_links(source: UrdfSource) -> set[str]:
    """Return the names of the links that carry no other link: tools, fingers, marker frames."""
    root = parse_urdf(source.text)
    parents = {parent.get("link") for parent in root.iterfind("joint/parent")}
    return {link.get("name", "") for link in root.iterchildren("link")} - parents


def _visuals(
    link: str, element: Any, palette: dict[str, Color], source: UrdfSource, detail: float
) -> Iterator[LinkVisual]:
    """Yield the visuals of one element."""
    try:
        pose = read_pose(element.find("origin"))
        shapes = _shapes(next(element.iterfind("geometry/*"), None), source, detail)
        color = _color(element.find("material"), palette)
    except (UrdfError, LookupError, TypeError, ValueError) as error:
        mesh = element.find("geometry/mesh")
        what = "a visual" if mesh is None else f"mesh {mesh.get('filename')!r}"
        sentence = f"{what} of link {link!r} is left out of the picture: {error}"
        warn(sentence)
        return
    for shape, own_color in shapes:
        yield LinkVisual(link, element.get("name", ""), np.eye(4) if pose is None else pose, shape, own_color or color)


def _shapes(shape: Any, source: UrdfSource, detail: float) -> list[tuple[Shape, Color | None]]:
    """Return the shapes of an element inside ``<geometry>``, those of a mesh with their own colours."""
    if shape is None:
        raise UrdfError("it has no geometry")
    if shape.tag == "mesh":
        from pathcontrol.view.bodies.body_meshes import read_mesh  # loads trimesh, which takes half a second

        path = find_mesh(shape.get("filename", ""), source.base_dir, source.package_dirs)
        return [*read_mesh(path, _numbers(shape.get("scale", "").strip() or "1"), detail)]
    if shape.tag == "box":
        return [(Box(np.broadcast_to(_numbers(shape.attrib["size"]), 3)), None)]
    if shape.tag == "cylinder":
        return [(Cylinder(float(shape.attrib["radius"]), float(shape.attrib["length"])), None)]
    if shape.tag == "sphere":
        return [(Sphere(float(shape.attrib["radius"])), None)]
    raise UrdfError(f"it is a <{shape.tag}>, expected a box, cylinder, sphere or mesh", value=shape.tag)


def _numbers(text: str) -> Array:
    """Return numbers with spaces or commas between."""
    return np.array(text.replace(",", " ").split(), dtype=np.float64)


def _palette(root: Any) -> dict[str, Color]:
    """Return colours by the name of their material; the first definition of a name counts."""
    found: dict[str, Color] = {}
    for material in [*root.iterchildren("material"), *root.iterfind("link/visual/material")]:
        rgba = material.find("color")
        if rgba is not None and material.get("name"):
            found.setdefault(material.get("name"), _rgba(rgba.get("rgba", "").split()))
    return found


def _color(material: Any, palette: dict[str, Color]) -> Color:
    """Return the colour of a ``<material>``, or of another one with its name."""
    if material is None:
        return UNPAINTED
    if (own := material.find("color")) is not None:
        return _rgba(own.get("rgba", "1 1 1 1").split())
    return palette.get(material.get("name", ""), UNPAINTED)


def _rgba(values: Any) -> Color:
    """Return a colour from its values."""
    try:
        red, green, blue, opacity = np.clip(np.asarray(values, dtype=np.float64), 0.0, 1.0).tolist()
    except ValueError:
        return UNPAINTED
    return red, green, blue, opacity
