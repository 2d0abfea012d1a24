"""An arm of sticks, for a robot whose URDF shows nothing: no visuals, or meshes that are not here."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from pathcontrol._arrays import Array
from pathcontrol.robot.urdf import parse_urdf
from pathcontrol.view.bodies.links import joint_offset
from pathcontrol.view.bodies.shapes import Color, Cylinder, Sphere
from pathcontrol.view.bodies.visuals import LinkVisual

if TYPE_CHECKING:
    from pathcontrol.robot.model import UrdfSource

STICK: Color = (0.62, 0.65, 0.69, 1.0)
KNOB: Color = (0.27, 0.29, 0.32, 1.0)
SLENDERNESS = 0.05  # radius of a stick, of the length of the longest


def stick_figure(source: UrdfSource) -> list[LinkVisual]:
    """A stick from each link's origin to the joints it carries, and a knob at each joint."""
    joints = parse_urdf(source.text).findall("joint")
    reach = {joint: joint_offset(joint) for joint in joints}
    radius = SLENDERNESS * max((float(np.linalg.norm(x)) for x in reach.values()), default=0.0) or 0.01
    visuals = []
    for joint, x in reach.items():
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        if np.linalg.norm(x) > radius / 10:
            visuals.append(LinkVisual(parent, "stick", _along(x), _stick(x, radius), STICK))
        if joint.get("type") != "fixed":
            visuals.append(LinkVisual(child, "knob", np.eye(4), Sphere(1.6 * radius), KNOB))
    return visuals


def _stick(x: Array, radius: float) -> Cylinder:
    return Cylinder(radius, float(np.linalg.norm(x)))


def _along(x: Array) -> Array:
    """The pose of a stick whose z axis goes from the origin to x [m], (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.align_vectors([x], [[0.0, 0.0, 1.0]])[0].as_matrix()
    pose[:3, 3] = x / 2
    return pose
