"""From ``plant.friction`` to the friction of the simulated arm."""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.experiments.builders.file_errors import keyed
from pathcontrol.experiments.builders.making import Place, make
from pathcontrol.experiments.schema.arm_sections import Directions, FrictionTable
from pathcontrol.registry import FRICTION_LAWS
from pathcontrol.robot.friction import Coulomb, FrictionLaw, Stribeck, Viscous
from pathcontrol.robot.model import RobotModel

_KEY = "plant.friction"


def with_friction(robot: RobotModel, section: Any, place: Place) -> RobotModel:
    """``robot`` with the friction of its URDF, with none, or with the laws of a section or of several.

    Raises:
        ExperimentError: a coefficient is negative, or there is not one for each joint.
    """
    if isinstance(section, str):
        return robot if section == "urdf" else robot.with_friction(None)
    with keyed(_KEY, FrictionTable.model_fields):
        if isinstance(section, FrictionTable):
            laws = _laws(section, robot.n, place)
        elif isinstance(section, list):
            laws = [make(f"{_KEY}[{i}]", one, FRICTION_LAWS, place) for i, one in enumerate(section)]
        else:
            laws = [make(_KEY, section, FRICTION_LAWS, place)]
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
        raise InputError(f"{name} = {values}, expected {n} numbers not below 0, one for each joint")
    return array
