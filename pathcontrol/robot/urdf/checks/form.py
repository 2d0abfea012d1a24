"""Checks of the form of a URDF, which come before any check of values.

Form is names, references, one tree, numbers that are numbers. The rules are those of the URDF reader inside
Pinocchio (urdfdom), which says only "not a valid URDF model" when one is broken, or drops an inertial without
a word to the caller. A check is a function that yields findings; to add one, write it and list it in
`FORM_CHECKS`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lxml import etree

from pathcontrol.robot.urdf.checks.finding import Finding, place, quote
from pathcontrol.robot.urdf.checks.parts import check_quaternions, check_repeated, check_required
from pathcontrol.robot.urdf.checks.tree import check_ends, check_tree
from pathcontrol.robot.urdf.elements import JOINT_TYPES, place_of
from pathcontrol.robot.urdf.numbers import check_numbers

MAX_LINKS = 1000  # the reader recurses: a chain of some thousand links ends the process
VERSIONS = ("1.0", "1.1", "1.2")

_TYPE_CHOICES = "one of " + ", ".join(JOINT_TYPES)


def check_form(root: etree._Element) -> Iterator[Finding]:
    """Yield all faults of the form of a robot, before its values are looked at."""
    for check in FORM_CHECKS:
        yield from check(root)


def check_robot(root: etree._Element) -> Iterator[Finding]:
    """Check that the robot has a name, a version the reader knows, and 1 to `MAX_LINKS` links."""
    if not root.get("name"):
        message = "the attribute name is missing or empty; give the robot a name"
        yield Finding("error", "name-missing", "robot", message)
    version, count = root.get("version", "1.0"), len(root.findall("link"))
    if version not in VERSIONS:
        choices = ", ".join(VERSIONS)
        message = f"version {quote(version)} is none of {choices}; remove it"
        yield Finding("error", "version-unknown", "robot", message)
    if count == 0:
        message = "there is no <link> directly inside <robot>; expected at least two"
        yield Finding("error", "no-links", "robot", message)
    if count > MAX_LINKS:
        message = f"{count} links are more than Pinocchio reads safely; expected at most {MAX_LINKS}"
        yield Finding("error", "too-many-links", "robot", message)


def check_names(root: etree._Element) -> Iterator[Finding]:
    """Check that every link and joint has a name, and that no two links, joints or materials share one."""
    for kind in ("link", "joint", "material"):
        names = Counter(element.get("name", "") for element in root.findall(kind))
        if names[""] and kind != "material":
            message = f"{names['']} <{kind}> without a name; expected a name on each"
            yield Finding("error", "name-missing", place(kind, ""), message)
        for name, count in names.items():
            if count > 1:
                message = f"{count} <{kind}> elements have this name; expected one, rename the others"
                yield Finding("error", f"duplicate-{kind}", place(kind, name), message)


def check_types(root: etree._Element) -> Iterator[Finding]:
    """Check that every joint states a known type."""
    for joint in root.findall("joint"):
        kind = joint.get("type")
        if kind is None:
            message = f"the type is missing; expected {_TYPE_CHOICES}"
            yield Finding("error", "type-missing", place_of(joint), message)
        elif kind not in JOINT_TYPES:
            message = f"type {quote(kind)}; expected {_TYPE_CHOICES}"
            yield Finding("error", "type-unknown", place_of(joint), message)


FORM_CHECKS = (
    check_robot,
    check_names,
    check_types,
    check_ends,
    check_tree,
    check_required,
    check_numbers,
    check_quaternions,
    check_repeated,
)
