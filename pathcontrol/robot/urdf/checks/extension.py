"""The ``<pathcontrol>`` extension of URDF: Coulomb friction by direction of motion, and encoders.

<pathcontrol>
<joint name="elbow">
<coulomb positive="1.7" negative="1.9"/>        levels [N m] for q̇ > 0 and q̇ < 0
<encoder counts_per_revolution="4096"/>
</joint>
</pathcontrol>
"""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from pathcontrol.robot.urdf.checks.finding import Finding, quote
from pathcontrol.robot.urdf.elements import MOVABLE_TYPES
from pathcontrol.robot.urdf.numbers import ABSURD, read_numbers

#: the attributes of each element, all required
_ATTRIBUTES = {"coulomb": ("positive", "negative"), "encoder": ("counts_per_revolution",)}


def extension_values(root: etree._Element, tag: str) -> dict[str, tuple[float, ...]]:
    """Return the attributes of each ``<tag>`` of a checked URDF as numbers, by joint."""
    found = {joint.get("name"): joint.find(tag) for joint in root.iterfind("pathcontrol/joint")}
    return {
        name: tuple(float(element.get(key)) for key in _ATTRIBUTES[tag])
        for name, element in found.items()
        if element is not None
    }


def check_extension(root: etree._Element) -> Iterator[Finding]:
    """Check that every joint named exists and moves, that elements are known, and that numbers are valid."""
    movable = [joint.get("name") for joint in root.iterfind("joint") if joint.get("type") in MOVABLE_TYPES]
    for joint in root.iterfind("pathcontrol/*"):
        name, where = joint.get("name"), f"<pathcontrol> joint {quote(joint.get('name'))}"
        if joint.tag != "joint" or name not in movable:
            message = f"<{joint.tag}> names {quote(name)}; expected <joint name=...> of one of: {', '.join(movable)}"
            yield Finding("error", "extension-joint", where, message)
            continue
        for element in joint.iterchildren(etree.Element):
            yield from _check_element(element, where)
    yield from _check_encoders(root, movable)


def _check_element(element: etree._Element, where: str) -> Iterator[Finding]:
    """Check one element of the extension."""
    if element.tag not in _ATTRIBUTES:
        message = f"<{element.tag}> is unknown; expected one of: {', '.join(_ATTRIBUTES)}"
        yield Finding("error", "extension-element", where, message)
        return
    for key in _ATTRIBUTES[element.tag]:
        values = read_numbers(element.get(key, ""), 1)
        least = "above" if element.tag == "encoder" else "not below"
        if values is None or not 0 <= values[0] < ABSURD or (element.tag == "encoder" and values[0] == 0):
            message = f"{key} of <{element.tag}> is {quote(element.get(key))}; expected a number {least} 0"
            yield Finding("error", "extension-number", where, message)


def _check_encoders(root: etree._Element, movable: list[str]) -> Iterator[Finding]:
    """Check that every joint has an encoder or none has."""
    having = {joint.get("name") for joint in root.iterfind("pathcontrol/joint[encoder]")}
    missing = [name for name in movable if name not in having]
    if having and missing:
        message = f"no <encoder> for {', '.join(missing)}; expected one for each joint, else none is used"
        yield Finding("warning", "extension-encoders", "<pathcontrol>", message)
