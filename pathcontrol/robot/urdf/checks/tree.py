"""Checks that the joints connect the links of a robot to one tree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lxml import etree

from pathcontrol.robot.urdf.checks.finding import Finding, place, quote
from pathcontrol.robot.urdf.elements import place_of


def check_ends(root: etree._Element) -> Iterator[Finding]:
    """Check that every joint connects two links that exist."""
    links = {link.get("name") for link in root.findall("link")}
    for joint in root.findall("joint"):
        for end in ("parent", "child"):
            name = _end(joint, end)
            if name is not None and name not in links:
                message = f"the {end} link {quote(name)} does not exist; add that <link> or correct the name"
                yield Finding("error", f"{end}-unknown", place_of(joint), message)


def check_tree(root: etree._Element) -> Iterator[Finding]:
    """Check that the links form one tree: one root, one parent for every other link, no loop."""
    parents: dict[str, str] = {}
    holders: dict[str, list[str]] = {}
    for joint in root.findall("joint"):
        if (child := _end(joint, "child")) is not None:
            parents[child] = _end(joint, "parent") or ""
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


def _end(joint: etree._Element, end: str) -> str | None:
    """Return the name of the link at an end of a joint."""
    element = joint.find(end)
    return None if element is None else element.get("link")


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
