"""Checks of the form of a URDF, which come before any check of values.

Form is names, references, one tree, numbers that are numbers. The rules are those of the URDF reader inside
Pinocchio (urdfdom), which says only "not a valid URDF model" when one is broken, or drops an inertial without
a word to the caller. A check is a function that yields findings; to add one, write it and list it in
`FORM_CHECKS`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from lxml import etree

from pathcontrol.robot.urdf.checks.finding import Finding, place, quote
from pathcontrol.robot.urdf.elements import JOINT_TYPES, MOMENTS, first, link_at, links_and_joints, place_of
from pathcontrol.robot.urdf.numbers import check_numbers

MAX_LINKS = 1000  # the reader recurses: a chain of some thousand links ends the process
VERSIONS = ("1.0", "1.1", "1.2")

_TYPE_CHOICES = "one of " + ", ".join(JOINT_TYPES)
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


def check_ends(root: etree._Element) -> Iterator[Finding]:
    """Check that every joint connects two links that exist."""
    links = {link.get("name") for link in root.findall("link")}
    for joint in root.findall("joint"):
        for end in ("parent", "child"):
            name = link_at(joint, end)
            if name is not None and name not in links:
                message = f"the {end} link {quote(name)} does not exist; add that <link> or correct the name"
                yield Finding("error", f"{end}-unknown", place_of(joint), message)


def check_tree(root: etree._Element) -> Iterator[Finding]:
    """Check that the links form one tree: one root, one parent for every other link, no loop."""
    parents: dict[str, str] = {}
    holders: dict[str, list[str]] = {}
    for joint in root.findall("joint"):
        if (child := link_at(joint, "child")) is not None:
            parents[child] = link_at(joint, "parent") or ""
            holders.setdefault(child, []).append(joint.get("name", ""))
    links = dict.fromkeys(link.get("name", "") for link in root.findall("link"))
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        message = f"{len(roots)} root links ({_enumerate(roots)}); expected one, join the others to it"
        yield Finding("error", "several-roots", "robot", message)
    for name, joints in holders.items():
        if len(joints) > 1:
            message = f"it is the child of the joints {_enumerate(joints)}; expected one, remove the others"
            yield Finding("error", "two-parents", place("link", name), message)
    if loop := _loop(parents):
        chain = " -> ".join(map(quote, loop))
        message = f"the links {chain} form a loop; expected a tree, remove one of the joints"
        yield Finding("error", "loop", place("link", loop[0]), message)


def _loop(parents: dict[str, str]) -> list[str]:
    """Return the links of a loop in a map from child to parent, the first repeated at the end, or an empty list."""
    settled: set[str] = set()
    for start in parents:
        path: dict[str, None] = {}
        name = start
        while name in parents and name not in settled and name not in path:
            path[name] = None
            name = parents[name]
        if name in path:
            names = list(path)
            return [*names[names.index(name) :], name]
        settled.update(path)
    return []


def _enumerate(names: Sequence[str], most: int = 5) -> str:
    """Write names, separated by commas, at most so many of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(quote, names[:most])) + more


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
