"""Helpers to navigate the elements of a URDF."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lxml import etree

from pathcontrol.robot.urdf.checks.finding import place

MOVABLE_TYPES = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVABLE_TYPES, "fixed", "floating", "planar")
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def place_of(element: etree._Element) -> str:
    """Name the link or joint that an element is, for a message."""
    return place(element.tag, element.get("name"))


def names_of(elements: Iterable[etree._Element]) -> tuple[str, ...]:
    """Return the names of some elements, empty where there is none."""
    return tuple(element.get("name", "") for element in elements)


def first(element: etree._Element, path: str) -> etree._Element | None:
    """Follow `path` through the first child of each name, as URDF readers do."""
    found: etree._Element | None = element
    for tag in path.split("/"):
        found = None if found is None else found.find(tag)
    return found


def links_and_joints(root: etree._Element) -> Iterator[etree._Element]:
    """Yield the links and joints of a robot, in the order of the file."""
    return root.iterchildren("link", "joint")


def link_at(joint: etree._Element, end: str) -> str | None:
    """Return the name of the link at an end of a joint, its ``"parent"`` or ``"child"``."""
    element = joint.find(end)
    return None if element is None else element.get("link")
