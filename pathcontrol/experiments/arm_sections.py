"""``[robot]`` and ``[plant]``: the controller's model of the arm, and the arm that is simulated."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import PlainValidator, model_validator

from pathcontrol.experiments.section import Section, Units
from pathcontrol.experiments.values import Number, Numbers, Text, expected


class Payload(Section):
    """A point mass [kg] carried by ``frame``, at ``com`` [m] in it."""

    units: ClassVar[Units] = {"mass": "kg", "com": "m"}
    mass: Number
    frame: Text
    com: Numbers | None = None


class ToolFrame(Section):
    """A frame ``name`` more, at ``position`` [m] and ``rpy``, in ``angle_unit``, in ``frame``."""

    units: ClassVar[Units] = {"position": "m", "rpy": "rad"}
    angles = ("rpy",)
    frame: Text
    position: Numbers | None = None
    rpy: Numbers | None = None
    name: Text = "tip"


def _density(value: Any) -> Any:
    if not isinstance(value, bool) and not (isinstance(value, int | float) and 0 < value < math.inf):
        raise expected("true, false, or a density [kg/m³] greater than 0")
    return value


class Robot(Section):
    """The arm as the controller knows it. ``lock`` is in ``angle_unit``, and in metres for sliding joints."""

    units: ClassVar[Units] = {"lock": ("rad", "m")}
    source: Text
    lock: dict[str, Number] | None = None
    keep: list[Text] | None = None
    tip: Text | None = None
    estimated_inertia: Annotated[bool | float, PlainValidator(_density)] = False
    package_dirs: list[Text] | None = None
    payload: Payload | None = None
    tool: ToolFrame | None = None


class Directions(Section):
    """Coulomb levels [N m] by the direction of motion, one for each joint."""

    units: ClassVar[Units] = {"positive": "N m", "negative": "N m"}
    positive: Numbers
    negative: Numbers


class StribeckFriction(Section):
    """Dry friction that falls from ``static`` to ``coulomb`` [N m] at ``velocity``, one for each joint."""

    units: ClassVar[Units] = {"coulomb": "N m", "static": "N m", "velocity": "rad/s"}
    angles = ("velocity",)
    coulomb: Numbers
    static: Numbers
    velocity: Numbers


def _levels(value: Any) -> Any:
    if isinstance(value, dict | Directions):
        return Directions.model_validate(value)
    if not isinstance(value, list) or not value:
        raise expected("a list with one number for each joint, or a table of 'positive' and 'negative' lists")
    return value


class FrictionTable(Section):
    """The sum of the friction laws given."""

    units: ClassVar[Units] = {"viscous": "N m s/rad", "coulomb": "N m"}
    viscous: Numbers | None = None
    coulomb: Annotated[list[float] | Directions, PlainValidator(_levels)] | None = None
    stribeck: StribeckFriction | None = None

    @model_validator(mode="after")
    def _one_dry_law(self) -> Self:
        if self.coulomb is not None and self.stribeck is not None:
            raise expected("either 'coulomb' or 'stribeck', which has a Coulomb level of its own")
        if self.viscous is None and self.coulomb is None and self.stribeck is None:
            raise expected("'viscous', 'coulomb' or 'stribeck' in it, or \"none\" in its place")
        return self


def _friction(value: Any) -> Any:
    if isinstance(value, dict | FrictionTable):
        return FrictionTable.model_validate(value)
    if value not in ("urdf", "none"):
        raise expected("'urdf', 'none' or a table of 'viscous', 'coulomb' and 'stribeck'")
    return value


class Plant(Section):
    """The arm that is simulated: the controller's model, but for what is said here."""

    friction: Annotated[Literal["urdf", "none"] | FrictionTable, PlainValidator(_friction)] = "urdf"
    payload: Payload | None = None
