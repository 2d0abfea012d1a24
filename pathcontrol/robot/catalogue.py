"""Look-up of a URDF by the name of a known robot, by a path, or as text."""

from __future__ import annotations

import re
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import Any

from pathcontrol._expect import did_you_mean
from pathcontrol._extras import load_extra
from pathcontrol._files import read_bounded
from pathcontrol.errors import MissingExtraError, UnknownNameError, UrdfError
from pathcontrol.robot.arm_dynamics import UrdfSource
from pathcontrol.robot.urdf.xml.encoding import decode
from pathcontrol.robot.urdf.xml.parse import MAX_BYTES

_OWN_NAME = re.compile(r"<robot\b[^>]*?\sname\s*=\s*[\"']([^\"']*)[\"']")


def known_robots() -> dict[str, str]:
    """Return the names that :func:`load_robot` takes, each with its source."""
    bundled = {path.stem: "bundled" for path in sorted(_bundled_dir().glob("*.urdf"))}
    try:
        catalogue = _example_robots()
    except MissingExtraError:
        return bundled
    arms = {name: "example-robot-data" for name, c in catalogue.items() if c.urdf_filename and not c.free_flyer}
    return bundled | arms


def find_urdf(source: str | Path, package_dirs: tuple[Path, ...] = ()) -> UrdfSource:
    """Find the text of a URDF given as a name, a path or a string, without parsing it.

    Raises:
        UrdfError: there is no such regular file, it is larger than 64 MiB, or it is no text.
        UnknownNameError: no such robot; the message lists the known ones.
    """
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return UrdfSource(source, None, package_dirs)
    if isinstance(source, str) and source.isidentifier():  # a file of that name would have a suffix
        return _find_by_name(source, package_dirs)
    if not isinstance(source, str | PathLike):
        raise UrdfError(
            f"robot = {source!r:.80}, expected the name of a known robot, the path of a URDF or its text",
            argument="robot",
            value=source,
        )
    path = Path(source).expanduser()
    try:
        text = _read(path)
    except UrdfError as error:
        raise UrdfError(
            f"cannot read the URDF file {str(path)!r} ({error}); give a file, a URDF string or one of: {_names()}",
            file=str(path),
        ) from error
    return UrdfSource(text, path.resolve().parent, (*package_dirs, *_folders_of_link(path)))


def _folders_of_link(path: Path) -> list[Path]:
    """Return the folder of a symbolic link to a URDF and the one above: its meshes may be there."""
    beside = path.absolute().parent
    return [] if beside.resolve() == path.resolve().parent else [beside, beside.parent]


def _read(path: Path) -> str:
    """Read a URDF file as text."""
    return decode(read_bounded(path, MAX_BYTES, "a URDF", UrdfError), path.name)


def _find_by_name(name: str, package_dirs: tuple[Path, ...]) -> UrdfSource:
    """Find the URDF of a robot by its name."""
    bundled = {path.stem: path for path in _bundled_dir().glob("*.urdf")}.get(name)
    if bundled is not None:
        return UrdfSource(_read(bundled), bundled.parent, package_dirs, name)
    try:
        catalogue = _example_robots()
    except MissingExtraError as missing:
        raise UnknownNameError(f"unknown robot {name!r}; known here: {_names()}. {missing}", value=name) from missing
    loader = catalogue.get(name)
    if loader is None and Path(name).is_dir():
        raise UrdfError(
            f"{name!r} is a folder, expected a URDF file; give the one that is in it", value=name, file=name
        )
    if loader is None or not loader.urdf_filename or loader.free_flyer:
        reason = "has a floating base" if loader is not None and loader.free_flyer else "is unknown"
        meant = did_you_mean(name, known_robots())
        raise UnknownNameError(
            f"robot {name!r} {reason}; known arms: {_names()}, or the path of a URDF{meant}",
            value=name,
            choices=tuple(known_robots()),
        )
    return _example_urdf(name, loader, package_dirs)


def _example_urdf(name: str, loader: Any, package_dirs: tuple[Path, ...]) -> UrdfSource:
    # instantiating the loader would read every collision mesh; its class attributes say where the file is
    """Find the URDF of a robot of example-robot-data."""
    from example_robot_data.robots_loader import getModelPath

    relative = Path(loader.path, loader.urdf_subpath, loader.urdf_filename)
    root = Path(getModelPath(str(relative))).resolve()
    path, text = own_urdf(name, root / relative, set(_example_robots()))
    return UrdfSource(text, path.parent, (*package_dirs, root, root.parent.parent), name)


def own_urdf(name: str, path: Path, known: set[str]) -> tuple[Path, str]:
    """Return the file that describes the robot ``name``, and its text: ``path``, or the right one beside it.

    A description that calls itself as another ``known`` robot is one of that robot: some releases of
    example-robot-data give the file of a UR5 for ``"ur3"``.

    Raises:
        UrdfError: it is another robot's, and no file beside it calls itself ``name``.
    """
    text = _read(path)
    own = _own_name(text)
    if own not in known or name.startswith(own):  # "panda_collision" is a "panda"
        return path, text
    for other in sorted(path.parent.glob(f"{name}*.urdf")):
        if _own_name(text := _read(other)) == name:
            return other, text
    raise UrdfError(
        f"robot {name!r}: its file {str(path)!r} describes the robot {own!r}, and none beside it calls itself "
        f"{name!r}; update example-robot-data, or give the path of a URDF",
        value=own,
        file=str(path),
    )


def _own_name(text: str) -> str:
    """Return the name that a URDF gives its robot, or an empty text."""
    found = _OWN_NAME.search(text)
    return found[1] if found else ""


def _example_robots() -> dict[str, Any]:
    """Return the loaders of example-robot-data."""
    place, package = "example_robot_data.robots_loader", "example-robot-data-loaders"
    return load_extra(place, "robots", "loading other robots by name", package).ROBOTS


def _bundled_dir() -> Path:
    """Return the folder ``urdf/`` of an installed wheel, or the one beside the package in a checkout."""
    installed = Path(str(resources.files("pathcontrol"))) / "urdf"
    return installed if installed.is_dir() else installed.parent.parent / "urdf"


def _names() -> str:
    """Enumerate the names of known robots."""
    return ", ".join(known_robots())
