"""A stick figure of an arm, for a robot whose URDF has no visuals, or whose meshes are not here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.rotations import rotation_between, rotation_of_rpy
from pathcontrol.robot.urdf import parse_urdf
from pathcontrol.robot.urdf.numbers import read_numbers
from pathcontrol.view.bodies.body_links import joint_offset
from pathcontrol.view.bodies.body_shapes import Box, Color, Cylinder, Sphere
from pathcontrol.view.bodies.body_visuals import LinkVisual

if TYPE_CHECKING:
    from pathcontrol.robot.arm_dynamics import UrdfSource

STICK: Color = (0.62, 0.65, 0.69, 1.0)
KNOB: Color = (0.27, 0.29, 0.32, 1.0)
SLENDERNESS = 0.05  # radius of a stick, of the length of the longest

_LONGEST_RAIL = 10.0  # m: a limit that is farther limits nothing
_RAIL = 0.6  # radius of a rail, of that of a stick


def stick_figure(source: UrdfSource) -> list[LinkVisual]:
    """Return a stick from each link's origin to the joints it carries, and a knob at each joint that turns.

    A joint that slides is a block on a rail, which is as long as the joint can go, so that they stay together.
    """
    joints = parse_urdf(source.text).findall("joint")
    ends = {joint: joint_offset(joint) for joint in joints}
    rails = {joint: _rail(joint, ends[joint]) for joint in joints if joint.get("type") == "prismatic"}
    lengths = [np.linalg.norm(x) for x in ends.values()] + [np.linalg.norm(b - a) for a, b in rails.values()]
    radius = SLENDERNESS * float(max(lengths, default=0.0)) or 0.01
    visuals = []
    for joint, x in ends.items():
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        visuals += stick(parent, "stick", np.zeros(3), x, radius)
        if joint in rails:
            visuals += stick(parent, "rail", *rails[joint], _RAIL * radius)
            visuals.append(LinkVisual(child, "block", np.eye(4), Box(np.full(3, 3.2 * radius)), KNOB))
        elif joint.get("type") != "fixed":
            visuals.append(LinkVisual(child, "knob", np.eye(4), Sphere(1.6 * radius), KNOB))
    return visuals


def _rail(joint: Any, x: Array) -> tuple[Array, Array]:
    """Return the ends of the rail of a sliding joint at ``x``, zero and limits included, in its parent's frame."""
    origin, axis = joint.find("origin"), joint.find("axis")
    rpy = None if origin is None else read_numbers(origin.get("rpy", "0 0 0"), 3)
    along = None if axis is None else read_numbers(axis.get("xyz", ""), 3)
    direction = rotation_of_rpy(rpy or (0.0, 0.0, 0.0)) @ (along or (1.0, 0.0, 0.0))
    direction = direction / (np.linalg.norm(direction) or 1.0)
    low, high = (_limit(joint, name) for name in ("lower", "upper"))
    return x + min(low, 0.0) * direction, x + max(high, 0.0) * direction


def _limit(joint: Any, name: str) -> float:
    """Return a limit of a joint."""
    limit = joint.find("limit")
    values = None if limit is None else read_numbers(limit.get(name, ""), 1)
    return 0.0 if values is None else float(np.clip(values[0], -_LONGEST_RAIL, _LONGEST_RAIL))


def stick(link: str, name: str, start: Array, end: Array, radius: float) -> list[LinkVisual]:
    """Return a stick between two points [m], or none where they coincide up to rounding."""
    length = float(np.linalg.norm(end - start))
    if length <= radius / 10:
        return []
    pose = np.eye(4)
    pose[:3, :3] = rotation_between([0.0, 0.0, 1.0], end - start)
    pose[:3, 3] = (start + end) / 2
    return [LinkVisual(link, name, pose, Cylinder(radius, length), STICK)]
