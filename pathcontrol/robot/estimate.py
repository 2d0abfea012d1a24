"""Estimates of the masses and inertias of links that have none, from their shapes at a density."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from lxml import etree

from pathcontrol._arrays import LARGEST, SMALLEST, Array
from pathcontrol.errors import UrdfError, warn
from pathcontrol.robot.arm_dynamics import UrdfSource
from pathcontrol.robot.lump import Lump, ball, combine
from pathcontrol.robot.meshes import load_parts
from pathcontrol.robot.urdf.checks.finding import quote
from pathcontrol.robot.urdf.checks.form import check_form
from pathcontrol.robot.urdf.mesh_files import find_mesh
from pathcontrol.robot.urdf.model_values import moving_bodies, read_arm
from pathcontrol.robot.urdf.numbers import read_numbers
from pathcontrol.robot.urdf.xml.parse import parse_urdf

#: [kg/m³], mean density of links, castings, motors and air: the median of ten arms of example-robot-data,
#: which are between 375 (TIAGo) and 1890 (Z1)
DENSITY = 1300.0

_THINNEST = 1e-3  # m, of a box in the place of a mesh that is flat
_BALL = 0.05  # m, radius of a ball in the place of a link that has no shape


def with_estimated_inertia(urdf: UrdfSource, density: float = DENSITY) -> UrdfSource:
    """Return the same URDF with an ``<inertial>`` for each link that has a shape and no mass.

    The collision shapes of a link are taken as solid and of one ``density`` [kg/m³], or where there are none its visual
    ones. A mesh that is not closed is taken as its convex hull. A body between two joints that has neither a mass nor a
    shape that can be read becomes a ball at its joint, with a warning.
    """
    root = parse_urdf(urdf.text)
    if any(finding.level == "error" for finding in check_form(root)):
        return urdf  # refused by the checks
    arm, links = read_arm(root), {link.get("name", ""): link for link in root.iterfind("link")}
    empty = {name for name in links if not has_mass(arm.links[name].inertial)}
    unread: dict[str, str] = {}
    lumps = {name: _estimate_link(links[name], urdf, density, unread) for name in links if name in empty}
    balls = []
    for body in moving_bodies(arm):
        if empty.issuperset(body.poses) and not any(lumps[name] for name in body.poses):
            lumps[body.joint.child] = ball(density * 4 / 3 * np.pi * _BALL**3, _BALL)
            balls.append(body.joint.child)
            reasons = [unread.pop(name) for name in body.poses if name in unread]
            unread |= {body.joint.child: reasons[0]} if reasons else {}
    for name, lump in lumps.items():
        if lump is not None:
            _write(links[name], lump)
    _warn_of_guesses(balls, unread)
    return replace(urdf, text=etree.tostring(root, encoding="unicode"))


def _warn_of_guesses(balls: list[str], unread: dict[str, str]) -> None:
    """Warn of links that became balls, and of shapes that are missing from the estimated masses."""
    light = [name for name in unread if name not in balls]
    if balls:
        because = next((f": {unread[name]}" for name in balls if name in unread), "; give them shapes, or <inertial>")
        _warn(f"no shape of {', '.join(balls)} can be read, each is taken as a ball of {_BALL:g} m radius{because}")
    if light:
        _warn(f"the mass of {', '.join(light)} lacks shapes that cannot be read: {unread[light[0]]}")


def _warn(sentence: str) -> None:
    """Warn about an estimate, in the name of the caller of ``load_robot``."""
    warn(f"estimated_inertia: {sentence}")


def has_mass(inertial: object) -> bool:
    """Return whether a link has an inertial with mass or inertia."""
    return inertial is not None and bool(inertial.mass or np.any(inertial.inertia))  # type: ignore[attr-defined]


def _estimate_link(link: etree._Element, urdf: UrdfSource, density: float, unread: dict[str, str]) -> Lump | None:
    """Return the body of the shapes of a link, ``None`` if none can be read; note in ``unread`` why one cannot."""
    missing: list[str] = []
    for tag in ("collision", "visual"):
        lumps: list[Lump] = []
        reasons: list[str] = []
        for holder in link.iterchildren(tag):
            try:
                lumps.append(_shape(holder, urdf, density))
            except UrdfError as error:
                reasons.append(str(error))
        missing = reasons if lumps else missing or reasons
        if lumps:
            break
    if missing:
        unread[link.get("name", "")] = missing[0]
    return combine(lumps) if lumps else None


def _shape(holder: etree._Element, urdf: UrdfSource, density: float) -> Lump:
    """Return the body of one ``<visual>`` or ``<collision>`` in the frame of its link."""
    shape = next(holder.iterfind("geometry/*"), None)
    if shape is None:
        raise UrdfError(f"a <{holder.tag}> holds no shape")
    solid = _mesh(shape, urdf) if shape.tag == "mesh" else _primitive(shape)
    solid.apply_transform(_pose(holder.find("origin")))
    solid.density = density
    lump = Lump(float(solid.mass), np.array(solid.center_mass), np.array(solid.moment_inertia))
    if not (SMALLEST <= lump.mass < LARGEST and np.isfinite(lump.com).all() and np.isfinite(lump.inertia).all()):
        raise UrdfError(
            f"a <{shape.tag}> of {lump.mass:g} kg at {density:g} kg/m³ is too small or too large",
            value=lump.mass,
            limit=(SMALLEST, LARGEST),
        )
    return lump


def _primitive(shape: etree._Element) -> trimesh.Trimesh:
    """Return a box, cylinder or ball as a polyhedron of the same volume to 1 % or better."""
    size, radius, length = (
        read_numbers(shape.get(name, ""), count) for name, count in (("size", 3), ("radius", 1), ("length", 1))
    )
    if shape.tag == "box" and size and min(size) > 0:
        return trimesh.creation.box(size)
    if shape.tag == "cylinder" and radius and length and min(*radius, *length) > 0:
        return trimesh.creation.cylinder(radius[0], length[0], sections=64)
    if shape.tag == "sphere" and radius and radius[0] > 0:
        return trimesh.creation.icosphere(subdivisions=4, radius=radius[0])
    raise UrdfError(f"a <{shape.tag}> has no size that can be read")


def _mesh(shape: etree._Element, urdf: UrdfSource) -> trimesh.Trimesh:
    """Return a mesh if it is closed, else its convex hull, or a box around it if it is flat."""
    name, scale = shape.get("filename", ""), read_numbers(shape.get("scale", "1 1 1"), 3)
    try:
        parts = load_parts(find_mesh(name, urdf.base_dir, urdf.package_dirs))
    except UrdfError as error:
        raise UrdfError(f"mesh {quote(name)}: {error}") from error
    if scale is None:
        raise UrdfError(
            f"mesh {quote(name)}: its scale is {quote(shape.get('scale'))}, expected 3 numbers",
            value=shape.get("scale"),
        )
    whole: Any = trimesh.util.concatenate([trimesh.Trimesh(part.vertices, part.faces) for part in parts])
    whole.apply_scale(scale)
    return whole if whole.is_volume else _hull(whole)


def _hull(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the convex hull of a mesh, or a box around a flat one."""
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
    """Return the pose (4, 4) of an ``<origin>``."""
    if origin is None:
        return np.eye(4)
    xyz, rpy = (read_numbers(origin.get(name, "0 0 0"), 3) or (0.0, 0.0, 0.0) for name in ("xyz", "rpy"))
    pose = trimesh.transformations.euler_matrix(rpy[0], rpy[1], rpy[2], axes="sxyz")
    pose[:3, 3] = xyz
    return pose


def _write(link: etree._Element, lump: Lump) -> None:
    """Replace the massless inertials of a link by an ``<inertial>`` with the values of ``lump``."""
    for old in link.findall("inertial"):
        link.remove(old)
    inertial = etree.Element("inertial")
    etree.SubElement(inertial, "origin", xyz=" ".join(map(_shortest, lump.com)), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=_shortest(lump.mass))
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = (map(_shortest, row) for row in lump.inertia)
    etree.SubElement(inertial, "inertia", ixx=ixx, ixy=ixy, ixz=ixz, iyy=iyy, iyz=iyz, izz=izz)
    link.insert(0, inertial)


def _shortest(value: float) -> str:
    """Write a number with as few digits as identify it to the last bit."""
    return repr(float(value))
