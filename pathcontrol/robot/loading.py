"""From a name, a file or a string to a checked :class:`RobotModel`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from pathcontrol._arrays import Array, readonly
from pathcontrol.errors import InputError, MissingExtraError, UnknownNameError, UrdfError
from pathcontrol.robot.actuation import Actuation, Limits
from pathcontrol.robot.friction import Coulomb, FrictionLaw, Viscous
from pathcontrol.robot.model import RobotModel, UrdfSource, build_model
from pathcontrol.robot.urdf import check_urdf, parse_urdf
from pathcontrol.robot.urdf.extension import extension_values

_UNLIMITED = 1e30  # some URDFs write 1.8e308 for "no limit"


def load_robot(
    source: str | Path,
    *,
    lock: Mapping[str, float] | None = None,
    package_dirs: Sequence[str | Path] = (),
    threads: int = 1,
) -> RobotModel:
    """The model of an arm.

    Args:
        source: the name of a bundled robot (``"cicese_2dof"``) or of one of example-robot-data (extra ``robots``), the
            path of a URDF file, or the URDF itself as a string.
        lock: joints to lock, ``{"joint name": angle [rad]}``, such as the fingers of a gripper.
        package_dirs: folders in which ``package://`` mesh files are looked up.
        threads: threads for batched calls.

    Raises:
        UrdfError: the URDF is missing or cannot be used; the message lists every reason found.
        UnknownNameError: no such robot; the message lists the known ones.
    """
    urdf = find_urdf(source, tuple(Path(d) for d in package_dirs))
    if lock is not None and not isinstance(lock, Mapping):
        raise InputError(f"lock = {lock!r}, expected angles by joint, as {{'joint name': 0.0}}")
    label = "this URDF" if str(source).lstrip().startswith("<") else repr(str(source))
    robot = checked_model(urdf, label, tuple(lock or ()), threads)
    return robot.reduced(lock) if lock else robot


def checked_model(urdf: UrdfSource, label: str, locked: Sequence[str] = (), threads: int = 1) -> RobotModel:
    """The model of a URDF, which errors call ``label``; joints that are going to be ``locked`` may mimic others.

    Raises:
        UrdfError: it cannot be used; the message lists every reason found.
    """
    report = check_urdf(urdf.text, base_dir=urdf.base_dir, package_dirs=urdf.package_dirs, allow_mimic=tuple(locked))
    if not report.ok:
        raise UrdfError("\n".join([f"{label} cannot be used:", *(f"  {finding}" for finding in report.errors)]))
    return _build(urdf, threads)


def known_robots() -> dict[str, str]:
    """Names that :func:`load_robot` takes, each with where it comes from."""
    bundled = {path.stem: "bundled" for path in sorted(_bundled_dir().glob("*.urdf"))}
    try:
        catalogue = _example_robots()
    except MissingExtraError:
        return bundled
    arms = {name: "example-robot-data" for name, c in catalogue.items() if c.urdf_filename and not c.free_flyer}
    return bundled | arms


def find_urdf(source: str | Path, package_dirs: tuple[Path, ...] = ()) -> UrdfSource:
    """The text of a URDF given as a name, a path or a string, without looking at what it says."""
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return UrdfSource(source, None, package_dirs)
    if isinstance(source, str) and source.isidentifier():  # a file of that name would have a suffix
        return _named(source, package_dirs)
    path = Path(source)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UrdfError(
            f"cannot read the URDF file {str(path)!r} ({error.strerror}); "
            f"give a file, a URDF string or one of: {_names()}"
        ) from error
    except UnicodeDecodeError as error:
        raise UrdfError(f"{str(path)!r} is not a text file in UTF-8: {error}") from error
    return UrdfSource(text, path.resolve().parent, package_dirs)


def _named(name: str, package_dirs: tuple[Path, ...]) -> UrdfSource:
    bundled = {path.stem: path for path in _bundled_dir().glob("*.urdf")}.get(name)
    if bundled is not None:
        return UrdfSource(bundled.read_text(encoding="utf-8"), bundled.parent, package_dirs, name)
    try:
        loader = _example_robots().get(name)
    except MissingExtraError as missing:
        raise UnknownNameError(f"unknown robot {name!r}; known here: {_names()}. {missing}") from missing
    if loader is None or not loader.urdf_filename or loader.free_flyer:
        reason = "has a floating base" if loader is not None and loader.free_flyer else "is unknown"
        raise UnknownNameError(f"robot {name!r} {reason}; known arms: {_names()}")
    return _example_urdf(name, loader, package_dirs)


def _example_urdf(name: str, loader: Any, package_dirs: tuple[Path, ...]) -> UrdfSource:
    # instantiating the loader would read every collision mesh; its class attributes say where the file is
    from example_robot_data.robots_loader import getModelPath

    relative = Path(loader.path, loader.urdf_subpath, loader.urdf_filename)
    root = Path(getModelPath(str(relative))).resolve()
    path = root / relative
    folders = (*package_dirs, root, root.parent.parent)
    return UrdfSource(path.read_text(encoding="utf-8"), path.parent, folders, name)


def _example_robots() -> dict[str, Any]:
    try:
        from example_robot_data.robots_loader import ROBOTS
    except ImportError as error:
        raise MissingExtraError("example-robot-data-loaders", "robots", "loading other robots by name") from error
    return ROBOTS


def _bundled_dir() -> Path:
    """``urdf/`` inside an installed wheel; beside the package in a checkout."""
    installed = Path(str(resources.files("pathcontrol"))) / "urdf"
    return installed if installed.is_dir() else installed.parent.parent / "urdf"


def _names() -> str:
    return ", ".join(known_robots())


def _build(urdf: UrdfSource, threads: int) -> RobotModel:
    root = parse_urdf(urdf.text)
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
    free = np.array([name in endless for name in names])

    def magnitude(values: Any) -> Array:
        values = np.array(values, dtype=np.float64)
        return readonly(np.where(np.abs(values) >= _UNLIMITED, np.copysign(np.inf, values), values))

    lower = np.where(free, -np.inf, model.lowerPositionLimit)
    upper = np.where(free, np.inf, model.upperPositionLimit)
    return Limits(*map(magnitude, (lower, upper, model.upperVelocityLimit, model.upperEffortLimit)))


def _friction(root: Any, names: Sequence[str]) -> FrictionLaw:
    """Viscous and Coulomb friction of ``<dynamics>``; ``<pathcontrol>`` may give the latter by direction."""
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
    """Encoder resolution [counts per revolution] of ``<pathcontrol>``, if every joint has one."""
    counts = extension_values(root, "encoder")
    return readonly(np.array([counts[name][0] for name in names])) if set(names) <= set(counts) else None
