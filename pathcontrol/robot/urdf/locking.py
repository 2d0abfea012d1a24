"""The joints of a URDF that are locked, with their positions: named ones, their mimics, or all but some."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from lxml import etree

from pathcontrol._arrays import as_scalar
from pathcontrol._expect import did_you_mean
from pathcontrol.errors import InputError, UnknownNameError, about
from pathcontrol.robot.urdf.elements import MOVABLE_TYPES, link_at
from pathcontrol.robot.urdf.numbers import read_numbers


def locked_angles(
    root: etree._Element,
    lock: Mapping[str, float] | None = None,
    keep: Sequence[str] = (),
    tip: str | None = None,
) -> dict[str, float]:
    """Return the position [rad or m] of each joint that is locked, including those that mimic a locked one.

    A joint that mimics another is at multiplier × position + offset of that one. Where ``keep`` or ``tip`` says what
    stays free, all others are locked: where ``lock`` says, else at 0, or at the limit that is nearest to 0.

    Args:
        root: the ``<robot>``, whose form need not be sound.
        lock: joints to lock, with their positions.
        keep: names of joints that stay free.
        tip: a link or joint; the joints that move it stay free.

    Raises:
        InputError: a joint is to be kept and locked, or to be kept though it mimics another; ``keep`` is no names, or
            ``tip`` no name.
        UnknownNameError: a joint, or the tip, does not exist.
    """
    joints = {joint.get("name", ""): joint for joint in root.iterfind("joint") if joint.get("type") in MOVABLE_TYPES}
    given, keep = _positions(lock, joints), names_to_keep(keep)
    check_tip(tip)
    kept = {
        *(_check_known("keep", name, joints) for name in keep),
        *(() if tip is None else _supporting_joints(root, tip, joints)),
    }
    if both := sorted(kept & given.keys()):
        raise InputError(
            f"{', '.join(both)}: to be locked and kept; take it out of lock, keep or tip",
            argument="lock",
            joint=both[0],
        )
    if following := sorted(name for name in kept if _leaders(name, joints)):
        raise InputError(
            f"{', '.join(following)} follows another joint and cannot stay free; keep or lock that one",
            argument="keep",
            joint=following[0],
        )
    chosen = bool(keep) or tip is not None
    wanted = [name for name in joints if name in given or (chosen and name not in kept)]
    wanted += [name for name in joints if not given.keys().isdisjoint(_leaders(name, joints))]
    return {name: _position(name, joints, given, frozenset()) for name in wanted}


def locked_beyond_limits(
    root: etree._Element, angles: Mapping[str, float], given: Collection[str] = ()
) -> Iterator[str]:
    """Yield a warning for each joint that is to be locked outside its limits, with the cause.

    Args:
        root: the ``<robot>``.
        angles: where joints are to be locked [rad or m].
        given: those whose position was given: likely in degrees, or millimetres. The others follow one.
    """
    joints = {joint.get("name", ""): joint for joint in root.iterfind("joint") if joint.get("type") in MOVABLE_TYPES}
    for name, joint in joints.items():
        if name not in angles or (limits := _range(joint)) is None:
            continue
        (lower, upper), at = limits, float(angles[name])
        slack = 1e-6 * max(1.0, abs(lower), abs(upper))
        if lower - slack <= at <= upper + slack:
            continue
        beyond = f"outside its limits of {lower:g} to {upper:g} {_unit(joint)}"
        leaders = [] if name in given else [leader for leader in _leaders(name, joints) if leader in angles]
        if leaders:
            leader = next((leader for leader in leaders if leader in given), leaders[-1])
            by = f"{leader} = {float(angles[leader]):g} {_unit(joints[leader])}"
            yield f"lock: {by} puts {name}, which follows it, at {at:g} {_unit(joint)}, {beyond}"
        else:
            yield f"lock: {name} = {at:g} {_unit(joint)} is {beyond}{_ask_unit(joint, at, lower, upper)}"


def _range(joint: etree._Element) -> tuple[float, float] | None:
    """Return the limits of a joint, ``None`` where there are none."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return None
    lower, upper = _number(limit, "lower", 0.0), _number(limit, "upper", 0.0)
    return (lower, upper) if lower < upper else None


def _unit(joint: etree._Element) -> str:
    """Return the unit of a joint's position."""
    return "m" if joint.get("type") == "prismatic" else "rad"


def _ask_unit(joint: etree._Element, at: float, lower: float, upper: float) -> str:
    """Ask whether degrees or millimetres were meant, if the number would be within the limits as such."""
    slides = _unit(joint) == "m"
    scaled = at / 1000 if slides else math.radians(at)
    if abs(at) < 1 or not lower <= scaled <= upper:
        return ""
    return f"; did you mean {'millimetres' if slides else 'degrees'}?"


def _positions(lock: Mapping[str, float] | None, joints: Collection[str]) -> dict[str, float]:
    """Check the joints to lock and their positions."""
    if lock is None:
        return {}
    if not isinstance(lock, Mapping):
        raise InputError(
            f"lock = {lock!r}, expected angles by joint, as {{'joint name': 0.0}}", argument="lock", value=lock
        )
    return read_angles({_check_known("lock", name, joints): angle for name, angle in lock.items()})


def read_angles(lock: Mapping[str, float]) -> dict[str, float]:
    """Check that the positions of joints to lock are finite numbers."""
    found: dict[str, float] = {}
    for name, angle in lock.items():
        with about(argument="lock", joint=name):
            found[name] = as_scalar(f"angle of {name}", angle)
    return found


def names_to_keep(keep: str | Sequence[str] | None) -> list[str]:
    """Return the names of joints that are to stay free: several, one, or none.

    Raises:
        InputError: they are no names.
    """
    names = [] if keep is None else [keep] if isinstance(keep, str) else keep
    if not isinstance(names, Iterable) or not all(isinstance(name, str) for name in names):
        raise InputError(
            f"keep = {keep!r}, expected names of joints, as ['joint name', ...]", argument="keep", value=keep
        )
    return list(names)


def check_tip(tip: str | None) -> None:
    """Refuse a tip that is not the name of one frame.

    Raises:
        InputError: it is not.
    """
    if tip is not None and not isinstance(tip, str):
        raise InputError(
            f"tip = {tip!r}, expected the name of one frame; keep=[...] takes several joints", argument="tip", value=tip
        )


def _check_known(argument: str, name: str, joints: Collection[str]) -> str:
    """Check that a joint exists and moves."""
    if name not in joints:
        raise UnknownNameError(
            f"{argument}: the robot has no movable joint {name!r}; it has {', '.join(joints)}"
            f"{did_you_mean(name, joints)}",
            argument=argument,
            joint=name,
            value=name,
            choices=tuple(joints),
        )
    return name


def _supporting_joints(root: etree._Element, tip: str, joints: Collection[str]) -> Iterator[str]:
    """Yield the movable joints between the base and a link, or a joint and those that carry it."""
    over = {link_at(joint, "child"): joint for joint in root.iterfind("joint")}
    links = [link.get("name", "") for link in root.iterfind("link")]
    by_name = {joint.get("name", ""): joint for joint in root.iterfind("joint")}
    if tip not in links and tip not in by_name:
        raise UnknownNameError(
            f"tip = {tip!r}: there is no such frame; there are {', '.join(links)}",
            argument="tip",
            value=tip,
            choices=tuple(links),
        )
    joint, seen = over.get(tip) if tip in links else by_name[tip], set()
    while joint is not None and joint not in seen:  # a loop is refused by the checks
        seen.add(joint)
        if joint.get("name") in joints:
            yield joint.get("name")
        joint = over.get(link_at(joint, "parent"))


def _position(
    name: str, joints: Mapping[str, etree._Element], given: Mapping[str, float], passed: frozenset[str]
) -> float:
    """Return the position of a locked joint: as given, as its mimic formula gives, or as near to 0 as possible."""
    if name in given:
        return given[name]
    mimic = joints[name].find("mimic")
    leader = "" if mimic is None else mimic.get("joint", "")
    if mimic is None or leader not in joints or leader in passed:
        return _nearest_to_zero(joints[name])
    followed = _position(leader, joints, given, passed | {name})
    return _number(mimic, "multiplier", 1.0) * followed + _number(mimic, "offset", 0.0)


def _leaders(name: str, joints: Mapping[str, etree._Element]) -> list[str]:
    """Return the chain of joints that a joint mimics, the nearest first."""
    found: list[str] = []
    while (mimic := joints[name].find("mimic")) is not None and (name := mimic.get("joint", "")) in joints:
        if name in found:
            break
        found.append(name)
    return found


def _nearest_to_zero(joint: etree._Element) -> float:
    """Return the position within the limits of a joint that is nearest to 0."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return 0.0
    return min(max(0.0, _number(limit, "lower", 0.0)), _number(limit, "upper", 0.0))


def _number(element: etree._Element, name: str, default: float) -> float:
    """Return an attribute as a number, or the default; text that is no number is left to the checks."""
    values = read_numbers(element.get(name, ""), 1)
    return default if values is None else values[0]
