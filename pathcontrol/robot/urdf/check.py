"""The check of a URDF for errors and doubtful values, before Pinocchio reads it.

A check of values is a function from an arm to findings; to add one, write it and list it in `VALUE_CHECKS`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from pathcontrol._files import read_bounded
from pathcontrol.errors import InputError, UrdfError
from pathcontrol.robot.urdf.checks.extension import check_extension
from pathcontrol.robot.urdf.checks.finding import Finding, Level, UrdfReport, quote
from pathcontrol.robot.urdf.checks.form import check_form
from pathcontrol.robot.urdf.checks.inertia import check_inertials, check_inertias, check_mass_matrix, check_masses
from pathcontrol.robot.urdf.checks.joints import (
    check_axes,
    check_dynamics,
    check_efforts,
    check_joint_types,
    check_limits,
    check_mimics,
)
from pathcontrol.robot.urdf.checks.visuals import check_meshes, check_shapes
from pathcontrol.robot.urdf.elements import MOVABLE_TYPES, names_of
from pathcontrol.robot.urdf.locking import locked_angles
from pathcontrol.robot.urdf.model_values import read_arm
from pathcontrol.robot.urdf.xml.encoding import decode
from pathcontrol.robot.urdf.xml.parse import MAX_BYTES, Parsed, parse_and_mend

_ORDER: tuple[Level, ...] = ("error", "warning", "note")
_MOST_KEPT = 64

_kept: dict[tuple[bytes, tuple[str, ...]], tuple[Finding, ...]] = {}  # of texts that were checked before

VALUE_CHECKS = (
    check_joint_types,
    check_mimics,
    check_axes,
    check_limits,
    check_masses,
    check_inertias,
    check_inertials,
    check_mass_matrix,
    check_dynamics,
    check_efforts,
)


def check_urdf(
    text: str | Path,
    *,
    base_dir: Path | None = None,
    package_dirs: Sequence[Path] = (),
    allow_mimic: Sequence[str] = (),
) -> UrdfReport:
    """Check a URDF and report everything a user should know; a bad URDF is a finding, never an exception.

    A robot without errors is read by Pinocchio from ``etree.tostring(parse_urdf(text), encoding="unicode")``.
    Values are looked at once the form is sound, so a second run may find more than the first.

    Args:
        text: The XML of the robot, or the path of a file as a :class:`~pathlib.Path`.
        base_dir: Folder of the URDF file, known where its path is given. Relative meshes are looked for there, and
            packages there and above.
        package_dirs: Folders that hold packages, for ``package://`` meshes.
        allow_mimic: Joints that the caller is going to lock: taken as fixed here, with those that mimic them, and
            free to mimic another.

    Returns:
        The names in the robot and the findings.

    Raises:
        InputError: ``text`` is neither.
    """
    if not isinstance(text, str | Path):
        raise InputError(
            f"text = {quote(repr(text))}, expected the XML of a robot as a string, or the Path of a file",
            argument="text",
            value=text,
        )
    if isinstance(text, Path) and base_dir is None:
        base_dir = text.resolve().parent
    try:
        parsed = parse_and_mend(_read_source(text))
    except UrdfError as error:
        return UrdfReport("", (), (), (Finding("error", "unreadable", "file", str(error)),))
    return check_parsed(parsed, base_dir, package_dirs, allow_mimic)


def check_parsed(
    parsed: Parsed, base_dir: Path | None, package_dirs: Sequence[Path], allow_mimic: Collection[str]
) -> UrdfReport:
    """Check a URDF that is parsed already, as :func:`check_urdf` does."""
    root = parsed.root
    findings = [*parsed.findings, *_check_text(parsed, tuple(allow_mimic)), *check_meshes(root, base_dir, package_dirs)]
    findings.sort(key=lambda finding: _ORDER.index(finding.level))
    links = names_of(root.iterfind("link"))
    joints = names_of(joint for joint in root.iterfind("joint") if joint.get("type") in MOVABLE_TYPES)
    return UrdfReport(root.get("name", ""), links, joints, tuple(findings))


def _check_text(parsed: Parsed, allow_mimic: tuple[str, ...]) -> tuple[Finding, ...]:
    """Return the findings that depend on nothing but the text of a URDF; those of a known text are kept."""
    key = parsed.digest, allow_mimic
    found = _kept.get(key)
    if found is None:
        found = tuple(_find_in(parsed, allow_mimic))
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        _kept[key] = found
    return found


def _find_in(parsed: Parsed, allow_mimic: tuple[str, ...]) -> Iterator[Finding]:
    """Yield the findings in the elements of a robot."""
    root, form = parsed.root, tuple(check_form(parsed.root))
    yield from form
    if not any(finding.level == "error" for finding in (*parsed.findings, *form)):
        movable = names_of(joint for joint in root.iterfind("joint") if joint.get("type") in MOVABLE_TYPES)
        arm = read_arm(root, locked_angles(root, {name: 0.0 for name in allow_mimic if name in movable}))
        for check in VALUE_CHECKS:
            yield from check(arm)
        yield from check_extension(root)
    yield from check_shapes(root)


def _read_source(source: str | Path) -> str:
    """Return the XML text; a string that looks like a file name is refused with advice."""
    if isinstance(source, Path):
        return decode(read_bounded(source, MAX_BYTES, "a URDF", UrdfError), source.name)
    if "<" not in source and source.strip().lower().endswith((".urdf", ".xml")):
        raise UrdfError(
            f"{quote(source)} is a name and not XML; give Path({quote(source)}) to have the file read",
            argument="text",
            value=source,
        )
    return source
