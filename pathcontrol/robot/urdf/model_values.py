"""The values of a robot whose form is sound: its links, its joints, and the bodies that they move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from lxml import etree

from pathcontrol.robot.urdf.elements import MOVABLE_TYPES, names_of
from pathcontrol.robot.urdf.links import Inertial, Joint, Link, read_joint, read_link

NO_AXIS = 1e-12


@dataclass(frozen=True)
class Arm:
    """The values of a robot whose form is sound, as the checks of values need them.

    Attributes:
        links: The links by name.
        joints: The joints, from the root outwards.
        mimics: The joint that each mimic joint follows, by name of the mimic joint.
        locked: Names of the joints the caller is going to lock.
        shaped: Names of the links that have something to draw or to collide with.
    """

    links: dict[str, Link]
    joints: tuple[Joint, ...]
    mimics: dict[str, str]
    locked: frozenset[str]
    shaped: frozenset[str]

    @property
    def movable(self) -> tuple[Joint, ...]:
        """The joints that turn or slide, locked or not."""
        return tuple(joint for joint in self.joints if joint.type in MOVABLE_TYPES)

    @property
    def free(self) -> tuple[Joint, ...]:
        """The joints that turn or slide and stay free."""
        return tuple(joint for joint in self.movable if joint.name not in self.locked)

    @property
    def inertials(self) -> dict[str, Inertial]:
        """Mass and inertia of the links that have them, by name of the link."""
        return {name: link.inertial for name, link in self.links.items() if link.inertial is not None}

    @property
    def moving(self) -> frozenset[str]:
        """Names of the links that move."""
        return frozenset(name for body in moving_bodies(self) for name in body.poses)


@dataclass(frozen=True)
class Body:
    """Links that are rigidly attached to each other.

    Attributes:
        joint: The joint that moves the body.
        poses: Pose of each link in the frame of the joint, shape (4, 4), lengths in m.
        outer: The bodies that hang from this one.
    """

    joint: Joint
    poses: dict[str, np.ndarray]
    outer: list[Body]


def read_arm(root: etree._Element, locked: Iterable[str] = ()) -> Arm:
    """Read the values of a robot without errors of form, some of its joints locked."""
    mimics = {joint.get("name", ""): joint.find("mimic") for joint in root.iterfind("joint")}
    drawn = [link for link in root.iterfind("link") if {"visual", "collision"} & {part.tag for part in link}]
    return Arm(
        links={link.name: link for link in map(read_link, root.iterfind("link"))},
        joints=_sort_outwards([read_joint(joint) for joint in root.iterfind("joint")]),
        mimics={name: mimic.get("joint", "") for name, mimic in mimics.items() if mimic is not None},
        locked=frozenset(locked),
        shaped=frozenset(names_of(drawn)),
    )


def moving_bodies(arm: Arm) -> list[Body]:
    """Group the links that move into rigid bodies, from the root outwards."""
    bodies: list[Body] = []
    body_of: dict[str, Body] = {}
    for joint in arm.joints:
        parent = body_of.get(joint.parent)
        if joint.type == "fixed" or joint.name in arm.locked:
            if parent is not None:
                parent.poses[joint.child] = parent.poses[joint.parent] @ _pose(joint)
                body_of[joint.child] = parent
            continue
        body_of[joint.child] = Body(joint, {joint.child: np.eye(4)}, [])
        bodies.append(body_of[joint.child])
        if parent is not None:
            parent.outer.append(body_of[joint.child])
    return bodies


def link_pose(arm: Arm, link: str) -> np.ndarray:
    """Return the pose of a link that does not move in the frame of the root, shape (4, 4), lengths in m."""
    over, pose = {joint.child: joint for joint in arm.joints}, np.eye(4)
    while (joint := over.get(link)) is not None:
        pose, link = _pose(joint) @ pose, joint.parent
    return pose


def axis_inertia(arm: Arm, body: Body) -> float:
    """Return the moment of inertia of a body about the axis of its joint [kg m^2].

    Each link adds a' I a + m |a x c|^2 (the parallel axis theorem), with a the unit axis, I the inertia about
    the centre of mass c, and m the mass.
    """
    axis = body.joint.axis / np.linalg.norm(body.joint.axis)
    total = 0.0
    for name, pose in body.poses.items():
        if (inertial := arm.links[name].inertial) is not None:
            centre = pose @ _pose(inertial)
            turned = centre[:3, :3].T @ axis
            total += turned @ inertial.inertia @ turned
            total += inertial.mass * np.sum(np.cross(axis, centre[:3, 3]) ** 2)
    return float(total)


def has_direction(joint: Joint) -> bool:
    """Return whether the axis of a joint is long enough to have a direction."""
    return bool(np.linalg.norm(joint.axis) > NO_AXIS)


def _sort_outwards(joints: Sequence[Joint]) -> tuple[Joint, ...]:
    """Sort the joints of a tree so that each comes after the one that carries it."""
    hanging: dict[str, list[Joint]] = {}
    for joint in joints:
        hanging.setdefault(joint.parent, []).append(joint)
    children = {joint.child for joint in joints}
    ordered = [joint for joint in joints if joint.parent not in children]
    for joint in ordered:  # grows while it is walked
        ordered.extend(hanging.get(joint.child, ()))
    return tuple(ordered)


def _pose(element: Joint | Inertial) -> np.ndarray:
    """Return the pose of an element in its parent, (4, 4)."""
    return np.eye(4) if element.origin is None else element.origin
