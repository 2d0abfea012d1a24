"""The controller's model and the simulated arm, made of ``[robot]`` and ``[plant]``."""

from __future__ import annotations

from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import ExperimentError, InputError
from pathcontrol.experiments.builders.file_errors import refuse_unit, report_by_key
from pathcontrol.experiments.builders.making import Place, make
from pathcontrol.experiments.builders.poses import pose_of
from pathcontrol.experiments.schema.arm_sections import Directions, FrictionTable
from pathcontrol.experiments.schema.experiment import Experiment
from pathcontrol.experiments.schema.section import Section, convert_numbers
from pathcontrol.registry import FRICTION_LAWS
from pathcontrol.robot.catalogue import find_urdf
from pathcontrol.robot.extent import question_offset
from pathcontrol.robot.friction import Coulomb, FrictionLaw, Stribeck, Viscous
from pathcontrol.robot.loading import load_robot
from pathcontrol.robot.model import RobotModel
from pathcontrol.robot.urdf import parse_urdf


def build_arms(experiment: Experiment, base_dir: Path) -> tuple[RobotModel, RobotModel]:
    """Return the controller's model and the simulated arm.

    Raises:
        ExperimentError: a robot, joint or frame does not exist, or a value is out of range.
    """
    bare, model = build_models(experiment, base_dir)
    return model, build_plant(experiment, bare, model, base_dir)


def build_models(experiment: Experiment, base_dir: Path) -> tuple[RobotModel, RobotModel]:
    """Return the arm without a payload, with the friction of its URDF, and the controller's model.

    Raises:
        ExperimentError: a robot, joint or frame does not exist, or a value is out of range.
    """
    bare = _with_tool(_load(experiment, base_dir), experiment)
    loaded, place = _add_payload("robot.payload", bare, experiment.robot.payload), _place(experiment, base_dir)
    model = with_friction("robot.friction", loaded, experiment.robot.friction, place)
    if not model.has_mass:
        raise ExperimentError(
            f"robot: no link of {model.name} has a mass, so there are kinematics and no dynamics; give "
            "estimated_inertia = true, a density as in estimated_inertia = 2700.0, or <inertial> in the URDF",
            argument="robot",
        )
    return bare, model


def build_plant(experiment: Experiment, bare: RobotModel, model: RobotModel, base_dir: Path) -> RobotModel:
    """Return the simulated arm, made of the arm without a payload and the controller's model.

    Raises:
        ExperimentError: a frame does not exist, or a value is out of range.
    """
    plant = experiment.plant
    carrier = model if plant.payload is None else _add_payload("plant.payload", bare, plant.payload)
    if plant.friction is None:
        return carrier if carrier is model else carrier.with_friction(model.friction)
    if plant.friction == "urdf":
        return carrier.with_friction(bare.friction)
    return with_friction("plant.friction", carrier, plant.friction, _place(experiment, base_dir))


def _place(experiment: Experiment, base_dir: Path) -> Place:
    """Return the place of an experiment."""
    return Place(base_dir, experiment.to_radians)


def _load(experiment: Experiment, base_dir: Path) -> RobotModel:
    section = experiment.robot
    options = section.arguments(float)
    package_dirs = options["package_dirs"] = [base_dir / folder for folder in options.get("package_dirs", ())]
    with report_by_key("robot.source"):
        source = _source(section.source, base_dir)
        urdf = find_urdf(source, tuple(package_dirs))
        needed = section.lock or experiment.angle_unit == "deg"
        sliding = _sliding_joints(urdf.text) if needed else set()
    options["lock"] = {
        joint: value if joint in sliding else convert_numbers(value, experiment.to_radians)
        for joint, value in (section.lock or {}).items()
    }
    for joint, value in options["lock"].items():
        refuse_unit(f"robot.lock.{joint}", value, "m" if joint in sliding else "rad")
    with report_by_key("robot", tuple(options)):
        robot = load_robot(source, **options)
    if experiment.angle_unit == "deg":
        _refuse_degrees(robot, sliding)
    return robot


def _with_tool(robot: RobotModel, experiment: Experiment) -> RobotModel:
    tool = experiment.robot.tool
    if tool is None:
        return robot
    pose = pose_of("robot.tool", tool.arguments(experiment.to_radians))
    question_offset("robot.tool.position", tool.position or (0.0,), robot)
    with report_by_key("robot.tool", ("name", "frame")):
        return robot.with_frame(tool.name, tool.frame, pose)


def _source(source: str, base_dir: Path) -> str | Path:
    """Return a URDF as text or the name of a robot as it is, and anything else as a path relative to the file."""
    if source.lstrip().startswith("<"):
        return source
    path = base_dir / source
    return path if Path(source).suffix or Path(source).name != source or path.is_file() else source


def _sliding_joints(urdf: str) -> set[str]:
    return {str(joint.get("name")) for joint in parse_urdf(urdf).iterfind("joint[@type='prismatic']")}


def _refuse_degrees(robot: RobotModel, sliding: set[str]) -> None:
    free = [name for name in robot.joint_names if name in sliding]
    if free:
        raise ExperimentError(
            f"angle_unit = 'deg', but {', '.join(free)} of {robot.name} slides, and a length is no angle; "
            "write the file in 'rad' and metres, or lock the joint",
            argument="angle_unit",
            value="deg",
            joint=free[0],
        )


def _add_payload(key: str, robot: RobotModel, payload: Section | None) -> RobotModel:
    if payload is None:
        return robot
    given = payload.arguments(float)
    question_offset(f"{key}.com", given.get("com", (0.0,)), robot)
    with report_by_key(key, ("mass", "com", "inertia")):
        return robot.with_payload(**given)


def with_friction(key: str, robot: RobotModel, section: Any, place: Place) -> RobotModel:
    """Return ``robot`` with the friction that it has, with none, or with the laws of a section or of several.

    Raises:
        ExperimentError: a coefficient is negative, or there is not one for each joint.
    """
    if section is None or isinstance(section, str):
        return robot.with_friction(None) if section == "none" else robot
    with report_by_key(key, list(FrictionTable.model_fields)):
        if isinstance(section, FrictionTable):
            laws = _laws(section, robot.n, place)
        elif isinstance(section, list):
            laws = [make(f"{key}[{i}]", one, FRICTION_LAWS, place) for i, one in enumerate(section)]
        else:
            laws = [make(key, section, FRICTION_LAWS, place)]
        return robot.with_friction(reduce(add, laws))


def _laws(section: FrictionTable, n: int, place: Place) -> list[FrictionLaw]:
    laws: list[FrictionLaw] = []
    if section.viscous is not None:
        laws.append(Viscous(_each_joint("viscous", section.viscous, n)))
    if section.coulomb is not None:
        laws.append(_coulomb(section.coulomb, n))
    if section.stribeck is not None:
        values = section.stribeck.arguments(place.to_radians)
        laws.append(Stribeck(**{name: _each_joint(f"stribeck.{name}", v, n) for name, v in values.items()}))
    return laws


def _coulomb(levels: Directions | list[float], n: int) -> Coulomb:
    if not isinstance(levels, Directions):
        return Coulomb(_each_joint("coulomb", levels, n))
    names = ("positive", "negative")
    return Coulomb(*(_each_joint(f"coulomb.{name}", getattr(levels, name), n) for name in names))


def _each_joint(name: str, values: list[float], n: int) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (n,) or (array < 0).any():
        raise InputError(
            f"{name} = {values}, expected {n} numbers not below 0, one for each joint", argument=name, value=values
        )
    return array
