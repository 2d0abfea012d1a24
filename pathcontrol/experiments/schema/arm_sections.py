"""``[robot]`` and ``[plant]``: the controller's model of the arm, and the arm that is simulated."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Self

from pydantic import PlainValidator, model_validator

from pathcontrol.arguments import Unit
from pathcontrol.experiments.schema.derived import accept_several, make_chooser, table_for
from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.validators import Number, Numbers, Text, expected
from pathcontrol.registry import FRICTION_LAWS

#: the arguments of :meth:`pathcontrol.RobotModel.with_payload`
Payload = Annotated[Any, table_for("robot.model:RobotModel.with_payload")]


class Pose(Section):
    """The place of a frame in another one.

    Attributes:
        position: its origin [m], three numbers.
        rpy: roll, pitch and yaw, in ``angle_unit``: turned about the other frame's x, then y, then z, as in a URDF.
    """

    position: Annotated[Numbers | None, Unit("m")] = None
    rpy: Annotated[Numbers | None, Unit("rad")] = None


class ToolFrame(Pose):
    """A frame ``name`` more, at its pose in ``frame``."""

    frame: Text
    name: Text = "tip"


def _density(value: Any) -> Any:
    if not isinstance(value, bool) and not (isinstance(value, int | float) and 0 < value < math.inf):
        raise expected("true, false, or a density [kg/m³] greater than 0")
    return value


class Directions(Section):
    """Coulomb levels [N m] by the direction of motion, one for each joint."""

    positive: Annotated[Numbers, Unit("N m")]
    negative: Annotated[Numbers, Unit("N m")]


def _levels(value: Any) -> Any:
    if value is None or isinstance(value, dict | Directions):
        return value if value is None else Directions.model_validate(value)
    if not isinstance(value, list) or not value:
        raise expected("a list with one number for each joint, or a table of 'positive' and 'negative' lists")
    return value


class FrictionTable(Section):
    """The sum of the friction laws given."""

    viscous: Annotated[Numbers | None, Unit("N m s/rad")] = None
    coulomb: Annotated[list[float] | Directions | None, PlainValidator(_levels), Unit("N m")] = None
    stribeck: Annotated[Any, table_for(FRICTION_LAWS.members["stribeck"])] = None

    @model_validator(mode="after")
    def _one_dry_law(self) -> Self:
        if self.coulomb is not None and self.stribeck is not None:
            raise expected("either 'coulomb' or 'stribeck', which has a Coulomb level of its own")
        if self.viscous is None and self.coulomb is None and self.stribeck is None:
            raise expected("'viscous', 'coulomb' or 'stribeck' in it, or \"none\" in its place")
        return self


_LAWS = accept_several(make_chooser(FRICTION_LAWS))


def _friction(value: Any) -> Any:
    if isinstance(value, FrictionTable) or (isinstance(value, dict) and "type" not in value):
        return FrictionTable.model_validate(value)
    if isinstance(value, Section | list | dict) and value:
        return _LAWS(value)
    if value not in ("urdf", "none"):
        raise expected(
            "'urdf', 'none', a table of 'viscous', 'coulomb' and 'stribeck', a friction law with its 'type', or a list "
            "of such laws"
        )
    return value


#: the friction of an arm, as it is or as the controller knows it
Friction = Annotated[Any, PlainValidator(_friction)]


class RobotSection(Section):
    """The arm as the controller knows it: the arguments of :func:`pathcontrol.load_robot`, and what is mounted on it.

    ``lock`` is in ``angle_unit``, and in metres for sliding joints.
    """

    not_arguments: ClassVar[tuple[str, ...]] = ("source", "payload", "tool", "friction")
    source: Text
    lock: Annotated[dict[str, Number] | None, Unit("rad", "m")] = None
    estimated_inertia: Annotated[bool | float | None, PlainValidator(_density)] = None
    friction: Friction = None
    payload: Payload = None
    tool: ToolFrame | None = None


#: a robot section with the rest of the arguments
Robot = Annotated[RobotSection, table_for("robot.loading:load_robot", ("threads",), RobotSection)]


class Plant(Section):
    """The arm that is simulated: the controller's model, but for what is said here."""

    friction: Friction = None
    payload: Payload = None
