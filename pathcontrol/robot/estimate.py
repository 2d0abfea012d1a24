"""Masses and inertias of links that have none, from their shapes at a density."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from lxml import etree

from pathcontrol._arrays import Array
from pathcontrol.errors import PathControlWarning, UrdfError
from pathcontrol.robot.lump import Lump, ball, combined
from pathcontrol.robot.meshes import load_parts
from pathcontrol.robot.model import UrdfSource
from pathcontrol.robot.urdf.arm import moving_bodies, read_arm
from pathcontrol.robot.urdf.form import check_form
from pathcontrol.robot.urdf.mesh_files import find_mesh_file
from pathcontrol.robot.urdf.numbers import read_numbers
from pathcontrol.robot.urdf.parse import parse_urdf

#: [kg/m³] of what a link's shape encloses, castings, motors and air: the median of ten arms of example-robot-data,
#: which are between 375 (TIAGo) and 1890 (Z1)
DENSITY = 1300.0

_THINNEST = 1e-3  # m, of a box in the place of a mesh that is flat
_BALL = 0.05  # m, radius of a ball in the place of a link that has no shape


def with_estimated_inertia(urdf: UrdfSource, density: float = DENSITY) -> UrdfSource:
    """The same URDF with an ``<inertial>`` for each link that has a shape and no mass.

    The collision shapes of a link are taken as solid and of one ``density`` [kg/m³], or where there are none its visual
    ones. A mesh that is not closed is taken as its convex hull. A body between two joints that has neither a mass nor a
    shape that can be read becomes a ball at its joint, with a warning.
    """
    root = parse_urdf(urdf.text)
    if any(finding.level == "error" for finding in check_form(root)):
        return urdf  # which the checks refuse
    arm, links = read_arm(root), {link.get("name", ""): link for link in root.iterfind("link")}
    empty = {name for name in links if not has_mass(arm.links[name].inertial)}
    lumps = {name: _solid(links[name], urdf, density) for name in links if name in empty}
    balls = []
    for body in moving_bodies(arm):
        if empty.issuperset(body.poses) and not any(lumps[name] for name in body.poses):
            lumps[body.joint.child] = ball(density * 4 / 3 * np.pi * _BALL**3, _BALL)
            balls.append(body.joint.child)
    for name, lump in lumps.items():
        if lump is not None:
            _write(links[name], lump)
    if balls:
        what = f"no shape of {', '.join(balls)} can be read"
        message = f"{what}: each is taken as a ball of {_BALL:g} m radius; give package_dirs, or <inertial>"
        warnings.warn(message, PathControlWarning, stacklevel=3)
    return replace(urdf, text=etree.tostring(root, encoding="unicode"))


def has_mass(inertial: object) -> bool:
    """Whether the inertial of a link, if it has one, is that of a body."""
    return inertial is not None and bool(inertial.mass or np.any(inertial.inertia))  # type: ignore[attr-defined]


def _solid(link: etree._Element, urdf: UrdfSource, density: float) -> Lump | None:
    """What the shapes of a link weigh, ``None`` if none can be read."""
    for tag in ("collision", "visual"):
        lumps = [lump for holder in link.iterchildren(tag) for lump in _shape(holder, urdf, density)]
        if lumps:
            return combined(lumps)
    return None


def _shape(holder: etree._Element, urdf: UrdfSource, density: float) -> Iterator[Lump]:
    """The shape of one ``<visual>`` or ``<collision>`` in the frame of its link, if it can be read."""
    shape = next(holder.iterfind("geometry/*"), None)
    solid = None if shape is None else _mesh(shape, urdf) if shape.tag == "mesh" else _primitive(shape)
    if solid is None:
        return
    solid.apply_transform(_pose(holder.find("origin")))
    solid.density = density
    yield Lump(float(solid.mass), np.array(solid.center_mass), np.array(solid.moment_inertia))


def _primitive(shape: etree._Element) -> trimesh.Trimesh | None:
    """A box, cylinder or ball: polyhedra of the same volume to 1 % or better."""
    size, radius, length = (
        read_numbers(shape.get(name, ""), count) for name, count in (("size", 3), ("radius", 1), ("length", 1))
    )
    if shape.tag == "box" and size and min(size) > 0:
        return trimesh.creation.box(size)
    if shape.tag == "cylinder" and radius and length and min(*radius, *length) > 0:
        return trimesh.creation.cylinder(radius[0], length[0], sections=64)
    if shape.tag == "sphere" and radius and radius[0] > 0:
        return trimesh.creation.icosphere(subdivisions=4, radius=radius[0])
    return None


def _mesh(shape: etree._Element, urdf: UrdfSource) -> trimesh.Trimesh | None:
    """What a mesh encloses, or its convex hull, or where it is flat a box around it."""
    path = find_mesh_file(shape.get("filename", ""), urdf.base_dir, urdf.package_dirs)
    scale = read_numbers(shape.get("scale", "1 1 1"), 3)
    if path is None or scale is None:
        return None
    try:
        parts = load_parts(path)
    except UrdfError:
        return None
    whole: Any = trimesh.util.concatenate([trimesh.Trimesh(part.vertices, part.faces) for part in parts])
    whole.apply_scale(scale)
    return whole if whole.is_volume else _hull(whole)


def _hull(mesh: trimesh.Trimesh) -> trimesh.Trimesh | None:
    try:
        hull = mesh.convex_hull
        if hull.volume > 0:
            return hull
    except Exception:  # Qhull says so of points in a plane in its own way
        pass
    low, high = mesh.bounds
    box = trimesh.creation.box(np.maximum(high - low, _THINNEST))
    box.apply_translation((low + high) / 2)
    return box


def _pose(origin: etree._Element | None) -> Array:
    if origin is None:
        return np.eye(4)
    xyz, rpy = (read_numbers(origin.get(name, "0 0 0"), 3) or (0.0, 0.0, 0.0) for name in ("xyz", "rpy"))
    pose = trimesh.transformations.euler_matrix(rpy[0], rpy[1], rpy[2], axes="sxyz")
    pose[:3, 3] = xyz
    return pose


def _write(link: etree._Element, lump: Lump) -> None:
    """Give a link an ``<inertial>`` in the place of one without mass."""
    for old in link.findall("inertial"):
        link.remove(old)
    inertial = etree.Element("inertial")
    etree.SubElement(inertial, "origin", xyz=" ".join(map(_shortest, lump.com)), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=_shortest(lump.mass))
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = (map(_shortest, row) for row in lump.inertia)
    etree.SubElement(inertial, "inertia", ixx=ixx, ixy=ixy, ixz=ixz, iyy=iyy, iyz=iyz, izz=izz)
    link.insert(0, inertial)


def _shortest(value: float) -> str:
    """A number as it is read again to the last bit."""
    return repr(float(value))
