"""Checks that links and joints have the parts a reader needs, each once and in a known form."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lxml import etree

from pathcontrol.robot.urdf.checks.finding import Finding, quote
from pathcontrol.robot.urdf.elements import MOMENTS, first, links_and_joints, place_of

_REQUIRED_ATTRIBUTES: dict[str, dict[str, tuple[str, ...]]] = {
    "link": {"inertial/mass": ("value",), "inertial/inertia": MOMENTS},
    "joint": {
        "parent": ("link",),
        "child": ("link",),
        "axis": ("xyz",),
        "limit": ("effort", "velocity"),
        "mimic": ("joint",),
        "safety_controller": ("k_velocity",),
    },
}
_REQUIRED_CHILDREN = {"inertial": ("mass", "inertia"), "joint": ("parent", "child")}


def check_required(root: etree._Element) -> Iterator[Finding]:
    """Check that every element has the parts without which the reader refuses it or drops it."""
    for element in links_and_joints(root):
        for path, names in _REQUIRED_ATTRIBUTES[element.tag].items():
            part = first(element, path)
            for name in names:
                if part is not None and part.get(name) is None:
                    yield _missing(element, f"the attribute {name} of <{part.tag}>")
        for holder in (element, element.find("inertial")):
            for tag in () if holder is None else _REQUIRED_CHILDREN.get(holder.tag, ()):
                if holder.find(tag) is None:
                    yield _missing(element, f"the element <{tag}> of <{holder.tag}>")
        dynamics = element.find("dynamics") if element.tag == "joint" else None
        if dynamics is not None and not {"damping", "friction"} & set(dynamics.attrib):
            yield _missing(element, "damping or friction of <dynamics>")


def check_quaternions(root: etree._Element) -> Iterator[Finding]:
    """Check that no orientation is a quaternion: readers of URDF 1.0 silently take it as zero rotation."""
    for element in links_and_joints(root):
        for origin in element.iter("origin"):
            if (value := origin.get("quat_xyzw")) is not None:
                message = f"quat_xyzw {quote(value)} is not read everywhere; write the rotation as rpy"
                yield Finding("error", "origin-quaternion", place_of(element), message)


def check_repeated(root: etree._Element) -> Iterator[Finding]:
    """Check that no part is given twice: readers silently take the first."""
    parts = {path.split("/")[0] for paths in _REQUIRED_ATTRIBUTES.values() for path in paths}
    for element in links_and_joints(root):
        for tag, count in Counter(part.tag for part in element).items():
            if count > 1 and tag in parts | {"origin", "dynamics"}:
                message = f"<{tag}> is given {count} times and only the first counts; remove the others"
                yield Finding("warning", "repeated-element", place_of(element), message)


def _missing(element: etree._Element, what: str) -> Finding:
    """Return the finding about a missing part."""
    message = f"{what} is missing; expected it there, add it"
    return Finding("error", "part-missing", place_of(element), message)
