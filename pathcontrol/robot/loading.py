"""Loading of a :class:`RobotModel` from a name, a file or a string, with all checks."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from lxml import etree

from pathcontrol._arrays import LARGEST, Array, as_quantity, freeze
from pathcontrol._expect import expect
from pathcontrol._files import as_path
from pathcontrol.arguments import Form
from pathcontrol.errors import UrdfError, warn
from pathcontrol.robot.actuation import Actuation, Limits
from pathcontrol.robot.arm_dynamics import UrdfSource, build_model
from pathcontrol.robot.catalogue import find_urdf
from pathcontrol.robot.friction import Coulomb, FrictionLaw, Viscous
from pathcontrol.robot.model import RobotModel, lock_joints
from pathcontrol.robot.urdf import UrdfReport
from pathcontrol.robot.urdf.check import check_parsed
from pathcontrol.robot.urdf.checks.extension import extension_values
from pathcontrol.robot.urdf.locking import locked_angles, locked_beyond_limits
from pathcontrol.robot.urdf.xml.parse import Parsed, parse_and_mend

WARNED_OF = ("inertia-negative",)  # codes of the findings that become warnings, beside those of the XML
_UNLIMITED = LARGEST  # some URDFs write 1.8e308 for "no limit"


def load_robot(
    source: str | Path,
    *,
    lock: Mapping[str, float] | None = None,
    keep: Annotated[Sequence[str], Form.TEXTS] = (),
    tip: str | None = None,
    estimated_inertia: bool | float = False,
    package_dirs: Annotated[str | Path | Sequence[str | Path], Form.TEXTS] = (),
    friction: FrictionLaw | None = None,
    threads: int = 1,
) -> RobotModel:
    """Load the model of an arm.

    Args:
        source: the name of a bundled robot (``"cicese_2dof"``, ``"two_link"``) or of one of example-robot-data (extra
            ``robots``), the path of a URDF file, or the URDF itself as a string.
        lock: joints to lock, ``{"joint name": angle [rad]}``, such as the fingers of a gripper. A joint that mimics one
            of them is locked with it, at multiplier × angle + offset.
        keep: names of joints that stay free: all others are locked, where ``lock`` does not say at 0, or at the limit
            nearest to 0.
        tip: a link or joint: as ``keep`` with all joints that move it, such as one arm of two.
        estimated_inertia: give links that have a shape and no mass one from it, as solid bodies of 1300 kg/m³, or of
            the density given [kg/m³].
        package_dirs: folders in which ``package://`` mesh files are looked up: those that hold packages, or packages.
        friction: the friction of the joints that are free, in place of that in the URDF, which is kept by default;
            :meth:`RobotModel.with_friction` with ``None`` takes all of it away.
        threads: threads for batched calls.

    Raises:
        UrdfError: the URDF is missing or cannot be used; the message lists every reason found.
        UnknownNameError: no such robot, joint or tip; the message lists the known ones.
        InputError: a joint is to be locked and kept, a value is out of range, or ``friction`` is no friction law for as
            many joints.
    """
    if friction is not None:
        expect("friction", friction, FrictionLaw)
    urdf = find_urdf(source, _folders(package_dirs))
    label = "this URDF" if str(source).lstrip().startswith("<") else repr(str(source))
    parsed = _parse(urdf, label)
    mended, locked = parsed.findings, locked_angles(parsed.root, lock, keep, tip)
    if estimated_inertia is not False:
        from pathcontrol.robot.estimate import DENSITY, with_estimated_inertia  # reading meshes takes half a second

        density = DENSITY if estimated_inertia is True else estimated_inertia
        urdf = with_estimated_inertia(urdf, as_quantity("estimated_inertia", density))
        parsed = _parse(urdf, label)
    report = _check(parsed, urdf, label, locked)
    for finding in (*mended, *(finding for finding in report.warnings if finding.code in WARNED_OF)):
        warn(f"{label}: {finding.where}: {finding.message}")
    for sentence in locked_beyond_limits(parsed.root, locked, lock or ()):
        warn(f"{label}: {sentence}")
    robot = _build(parsed.root, urdf, threads)
    robot = lock_joints(robot, locked) if locked else robot
    return robot if friction is None else robot.with_friction(friction)


def _parse(urdf: UrdfSource, label: str) -> Parsed:
    """Parse a URDF; errors name it by its ``label``."""
    try:
        return parse_and_mend(urdf.text)
    except UrdfError as error:
        raise UrdfError(f"{label} cannot be used: {error}", **error.details_with()) from None


def build_checked_model(urdf: UrdfSource, label: str, locked: Sequence[str] = (), threads: int = 1) -> RobotModel:
    """Check a URDF and return its model; errors call it ``label``, and joints about to be ``locked`` may mimic.

    Raises:
        UrdfError: it cannot be used; the message lists every reason found.
    """
    parsed = _parse(urdf, label)
    _check(parsed, urdf, label, locked)
    return _build(parsed.root, urdf, threads)


def _check(parsed: Parsed, urdf: UrdfSource, label: str, locked: Collection[str]) -> UrdfReport:
    """Return the report of a URDF that is without errors."""
    report = check_parsed(parsed, urdf.base_dir, urdf.package_dirs, locked)
    if not report.ok:
        message = "\n".join([f"{label} cannot be used:", *(f"  {finding}" for finding in report.errors)])
        raise UrdfError(message, findings=tuple(report.errors))
    return report


def _folders(given: str | Path | Sequence[str | Path]) -> tuple[Path, ...]:
    """Return the folders of packages; a single one may be given without a list."""
    folders = [given] if isinstance(given, str | Path) or not isinstance(given, Iterable) else given
    return tuple(as_path("package_dirs", folder).expanduser() for folder in folders)


def _build(root: Any, urdf: UrdfSource, threads: int) -> RobotModel:
    """Build the model of a URDF that has passed the checks; ``root`` is its element, which is changed."""
    endless = _make_revolute(root)
    model = build_model(etree.tostring(root, encoding="unicode"))
    names = list(model.names)[1:]
    actuation = Actuation(_limits(model, names, endless), _friction(root, names), _encoders(root, names))
    return RobotModel(model, actuation, urdf, threads)


def _make_revolute(root: Any) -> set[str]:
    """Turn continuous joints into unlimited revolute ones, which Pinocchio holds as one angle instead of (cos, sin)."""
    endless = set()
    for joint in root.iterfind("joint[@type='continuous']"):
        endless.add(joint.get("name"))
        joint.set("type", "revolute")
        limit = joint.find("limit")
        if limit is None:
            limit = etree.SubElement(joint, "limit")
            limit.attrib.update({"effort": str(_UNLIMITED), "velocity": str(_UNLIMITED)})
        limit.attrib.update({"lower": str(-_UNLIMITED), "upper": str(_UNLIMITED)})
    return endless


def _limits(model: Any, names: Sequence[str], endless: set[str]) -> Limits:
    """Return the limits of the joints, ±inf for unlimited ones."""
    free = np.array([name in endless for name in names])

    def magnitude(values: Any) -> Array:
        values = np.array(values, dtype=np.float64)
        return freeze(np.where(np.abs(values) >= _UNLIMITED, np.copysign(np.inf, values), values))

    lower = np.where(free, -np.inf, model.lowerPositionLimit)
    upper = np.where(free, np.inf, model.upperPositionLimit)
    return Limits(*map(magnitude, (lower, upper, model.upperVelocityLimit, model.upperEffortLimit)))


def _friction(root: Any, names: Sequence[str]) -> FrictionLaw:
    """Read viscous and Coulomb friction from ``<dynamics>``; ``<pathcontrol>`` may give the latter by direction."""
    joints = {joint.get("name"): joint for joint in root.iterfind("joint")}
    by_direction = extension_values(root, "coulomb")
    viscous, plus, minus = np.zeros((3, len(names)))
    for i, name in enumerate(names):
        dynamics = joints[name].find("dynamics")
        given: Mapping[str, str] = {} if dynamics is None else dynamics.attrib
        viscous[i], level = float(given.get("damping", 0)), float(given.get("friction", 0))
        plus[i], minus[i] = by_direction.get(name, (level, level))
    return Viscous(viscous) + Coulomb(plus, minus)


def _encoders(root: Any, names: Sequence[str]) -> Array | None:
    """Read the encoder resolutions [counts per revolution] of ``<pathcontrol>``; None unless every joint has one."""
    counts = extension_values(root, "encoder")
    return freeze(np.array([counts[name][0] for name in names])) if set(names) <= set(counts) else None
