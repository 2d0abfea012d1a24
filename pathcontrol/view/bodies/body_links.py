"""The chain of links of a URDF."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.urdf import parse_urdf

if TYPE_CHECKING:
    from pathcontrol.robot.arm_dynamics import UrdfSource


def reach(source: UrdfSource) -> float:
    """Return the length of the longest chain of links, from joint to joint [m]."""
    carrying = {joint.find("child").get("link"): joint for joint in parse_urdf(source.text).iterchildren("joint")}
    longest = 0.0
    for joint in carrying.values():
        length = 0.0
        while joint is not None:
            length += float(np.linalg.norm(joint_offset(joint)))
            joint = carrying.get(joint.find("parent").get("link"))
        longest = max(longest, length)
    return longest


def joint_offset(joint: Any) -> Array:
    """Return the position of a ``<joint>`` in the frame of its parent [m], (3,)."""
    origin = joint.find("origin")
    return np.zeros(3) if origin is None else np.array(origin.get("xyz", "0 0 0").split(), dtype=np.float64)
