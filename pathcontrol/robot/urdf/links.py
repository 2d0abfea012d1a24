"""The values of links and joints of a robot whose form is sound.

yourdfpy reads the same, but brings along a library of meshes, which takes most of a second to load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from lxml import etree


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass [kg], inertia about the centre of mass (3, 3) [kg m²], and the pose of its frame (4, 4) or None."""

    mass: float
    inertia: np.ndarray
    origin: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Link:
    """A link, whose inertial may be missing."""

    name: str
    inertial: Inertial | None


@dataclass(frozen=True)
class Limit:
    """Limits of effort [N m or N], velocity and position [rad or m]; None for a position limit that is not given."""

    effort: float
    velocity: float
    lower: float | None
    upper: float | None


@dataclass(frozen=True)
class Dynamics:
    """Viscous and dry friction of a joint, None for one that is not given."""

    damping: float | None
    friction: float | None


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint from a parent to a child link, with its pose (4, 4) in the parent, None for the identity."""

    name: str
    type: str
    parent: str
    child: str
    origin: np.ndarray | None
    axis: np.ndarray
    limit: Limit | None
    dynamics: Dynamics | None


def read_link(element: etree._Element) -> Link:
    """Return the values of a ``<link>``."""
    inertial = element.find("inertial")
    return Link(element.get("name", ""), None if inertial is None else _inertial(inertial))


def read_joint(element: etree._Element) -> Joint:
    """Return the values of a ``<joint>``."""
    limit, dynamics = element.find("limit"), element.find("dynamics")
    return Joint(
        element.get("name", ""),
        element.get("type", ""),
        element.find("parent").get("link"),
        element.find("child").get("link"),
        read_pose(element.find("origin")),
        _vector(element.find("axis"), "xyz", "1 0 0"),
        None if limit is None else Limit(**_numbers(limit, "effort", "velocity", "lower", "upper")),  # type: ignore[arg-type]
        None if dynamics is None else Dynamics(**_numbers(dynamics, "damping", "friction")),
    )


def _inertial(element: etree._Element) -> Inertial:
    """Read an ``<inertial>``."""
    mass, inertia = element.find("mass"), element.find("inertia")
    ixx, ixy, ixz, iyy, iyz, izz = (float(inertia.get(f"i{axes}")) for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
    tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    return Inertial(float(mass.get("value")), tensor, read_pose(element.find("origin")))


def _numbers(element: etree._Element, *names: str) -> dict[str, float | None]:
    """Return the values of attributes by name, None for one that is not given."""
    given = {name: element.get(name) for name in names}
    return {name: None if text is None else float(text) for name, text in given.items()}


def _vector(element: etree._Element | None, name: str, default: str) -> np.ndarray:
    """Return the three numbers of an attribute, (3,)."""
    text = default if element is None else element.get(name, default)
    return np.array([float(word) for word in text.split()])


def read_pose(origin: etree._Element | None) -> np.ndarray | None:
    """Return the transform (4, 4) of an ``<origin>``, None where there is none.

    It turns about x, then y, then z, fixed axes, and then shifts.
    """
    if origin is None:
        return None
    (cr, cp, cy), (sr, sp, sy) = (turn(_vector(origin, "rpy", "0 0 0")) for turn in (np.cos, np.sin))
    pose = np.eye(4)
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = _vector(origin, "xyz", "0 0 0")
    return pose
