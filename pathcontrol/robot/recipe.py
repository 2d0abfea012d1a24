"""The recipe of a robot model as plain values for JSON, and the model rebuilt from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, freeze
from pathcontrol._json import to_json
from pathcontrol.errors import InputError, MissingExtraError, PathControlError, UnknownNameError, warn
from pathcontrol.robot.actuation import Actuation, Limits
from pathcontrol.robot.arm_dynamics import UrdfSource
from pathcontrol.robot.catalogue import find_urdf
from pathcontrol.robot.friction import FrictionLaw, no_friction, rebuild_law
from pathcontrol.robot.loading import build_checked_model
from pathcontrol.robot.model import RobotModel, lock_joints

_METHODS = ("reduced", "with_payload", "with_frame", "with_armature", "with_masses")
_LIMITS = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf, "effort": np.inf}  # null stands for these


def recipe_of(robot: RobotModel) -> dict[str, Any]:
    """Return the recipe of a robot: URDF text, mesh folders, changes to the model, limits, friction and encoders.

    Numbers are kept to the last bit. The text is that of the robot, not of its meshes; a robot with a name that
    :func:`load_robot` knows is found again by it, and so are its meshes.
    """
    source, actuation = robot.source, robot.actuation
    counts = actuation.encoder_counts
    return {
        "urdf": source.text,
        "name": source.name,
        "base_dir": None if source.base_dir is None else str(source.base_dir),
        "package_dirs": [str(folder) for folder in source.package_dirs],
        "steps": [list(step) for step in robot.steps],
        "limits": {name: to_json(getattr(robot.limits, name)) for name in _LIMITS},
        "friction": robot.friction.describe(),
        "encoder_counts": None if counts is None else counts.tolist(),
    }


def robot_of(recipe: Mapping[str, Any]) -> RobotModel:
    """Rebuild the model of a :func:`recipe_of`, with the same kinematics and dynamics; meshes may be missing.

    A friction law that is not of the library is left out with a warning.

    Raises:
        InputError: it is no recipe, or its parts do not fit together.
        UrdfError: the URDF cannot be used.
    """
    try:
        return _rebuild(recipe)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RuntimeError) as error:
        if isinstance(error, PathControlError):
            raise
        raise InputError(f"this is no recipe of a robot ({type(error).__name__}: {error})", value=recipe) from error


def _rebuild(recipe: Mapping[str, Any]) -> RobotModel:
    """Rebuild the model; errors are those of Python."""
    steps = [(method, arguments) for method, arguments in recipe["steps"]]
    locked = [joint for method, arguments in steps if method == "reduced" for joint in arguments["lock"]]
    robot = build_checked_model(_source(recipe), "the recorded URDF", locked)
    for method, arguments in steps:
        if method not in _METHODS:
            raise InputError(
                f"step {method!r} of the robot, expected one of {', '.join(_METHODS)}",
                value=method,
                choices=tuple(_METHODS),
            )
        robot = lock_joints(robot, arguments["lock"]) if method == "reduced" else getattr(robot, method)(**arguments)
    limits = Limits(*(_array(recipe["limits"][name], robot.n, missing) for name, missing in _LIMITS.items()))
    counts = recipe["encoder_counts"]
    encoders = None if counts is None else _array(counts, robot.n, np.nan)
    return replace(robot, actuation=Actuation(limits, _friction(recipe["friction"], robot.n), encoders))


def _source(recipe: Mapping[str, Any]) -> UrdfSource:
    """Return the recorded text with mesh folders; those of a known robot are looked up on this machine."""
    text, name = str(recipe["urdf"]), recipe["name"]
    base_dir = None if recipe["base_dir"] is None else Path(recipe["base_dir"])
    folders = tuple(Path(folder) for folder in recipe["package_dirs"])
    if name is None or not str(name).isidentifier():  # anything else would be looked for as a file
        return UrdfSource(text, base_dir, folders)
    try:
        here = find_urdf(name, folders)
    except (UnknownNameError, MissingExtraError):
        return UrdfSource(text, base_dir, folders, name)
    return replace(here, text=text, package_dirs=tuple(dict.fromkeys(here.package_dirs)))


def _friction(description: Mapping[str, Any], n: int) -> FrictionLaw:
    """Rebuild the friction law; one that is unknown is left out with a warning."""
    try:
        law = rebuild_law(description)
    except UnknownNameError as error:
        warn(f"the robot is rebuilt without its friction: {error}")
        return no_friction(n)
    if law.n != n:
        raise InputError(f"the recorded friction law is for {law.n} joints, the robot has {n}", value=law.n)
    return law


def _array(values: Sequence[float | None], n: int, missing: float) -> Array:
    """Convert values of JSON to an array (n,): null becomes ``missing``."""
    array = freeze(np.array([missing if value is None else value for value in values], dtype=np.float64))
    if array.shape != (n,):
        raise InputError(f"{array.shape} values are recorded of the joints, expected ({n},)", value=array.shape)
    return array
