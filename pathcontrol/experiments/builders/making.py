"""The making of the object that a section of an experiment file names."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from pydantic import TypeAdapter, ValidationError

from pathcontrol._expect import did_you_mean
from pathcontrol._units import list_units
from pathcontrol.arguments import Parameter, parameters_of
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.file_errors import refuse_unit, report_by_key, report_users_code
from pathcontrol.experiments.builders.own_class import find_own_class
from pathcontrol.experiments.load import describe_finding
from pathcontrol.experiments.schema.derived import OwnSection, annotation_of
from pathcontrol.experiments.schema.section import Section, convert_angles, read_quantities, units_of
from pathcontrol.registry import Kind, find_kind
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel

_NOTHING: Mapping[str, Any] = MappingProxyType({})


class Place(NamedTuple):
    """The folder and the angles of an experiment file.

    Attributes:
        folder: the folder that paths in it are relative to.
        to_radians: converts from its ``angle_unit``.
    """

    folder: Path
    to_radians: Callable[[float], float]


def make(
    key: str,
    section: Any,
    kind: Kind | None,
    place: Place,
    given: Mapping[str, Any] = _NOTHING,
    more: Mapping[str, Any] = _NOTHING,
) -> Any:
    """Return the object of a section, which errors call ``key``.

    Args:
        key: of the section.
        section: a section for a class of the ``kind``.
        kind: what the class has to be.
        place: where the file is, and its angles.
        given: what the class may ask for by the name of a parameter that is in no file, such as ``robot``.
        more: arguments instead of those of the file.

    Raises:
        ExperimentError: it cannot be made.
    """
    target = target_of(key, section, kind, place)
    arguments = arguments_of(key, section, kind, place, given) | dict(more)
    needed = {name: one for name, one in given.items() if name in parameters_of(target)}
    needed = {name: one for name, one in needed.items() if parameters_of(target)[name].required} | arguments
    where = f"{key}.parameters" if isinstance(section, OwnSection) else key
    if "robot" in given:
        check_joint_units(where, target, arguments, given["robot"])
    try:
        inspect.signature(target).bind(**needed)
    except TypeError as error:
        raise ExperimentError(f"{where}: {error}; it is {_call_of(target)}", argument=where) from error
    with report_users_code(where, target.__name__, [name for name in parameters_of(target) if name not in given]):
        return target(**needed)


def check_joint_units(
    key: str, target: Callable[..., Any], arguments: Mapping[str, Any], robot: RobotModel | RobotBatch
) -> None:
    """Check that each quantity of a joint has the unit in which that moves, as N where it slides.

    Raises:
        ExperimentError: one has another.
    """
    for name, parameter in parameters_of(target).items():
        if parameter.unit is None or len(parameter.unit.names) != 2 or name not in arguments:
            continue
        value, turning_and_sliding = arguments[name], parameter.unit.names
        for i, kind in enumerate(robot.position_units):
            place, entry = (f"{name}[{i}]", value[i : i + 1]) if isinstance(value, list) else (name, [value])
            for one in entry:
                refuse_unit(f"{key}.{place}", one, turning_and_sliding[kind == "m"])


def _call_of(target: Callable[..., Any]) -> str:
    """Return the name of a class with the names and defaults of its parameters, without annotations."""
    parameters = inspect.signature(target).parameters.values()
    plain = inspect.Signature([parameter.replace(annotation=parameter.empty) for parameter in parameters])
    return f"`{target.__name__}{plain}`"


def target_of(key: str, section: Any, kind: Kind | None, place: Place) -> Callable[..., Any]:
    """Return the class that a section is for; a file of the user is run to define it.

    Raises:
        ExperimentError: there is no such class.
    """
    if not isinstance(section, OwnSection):
        return type(section).target
    assert kind is not None
    with report_by_key(f"{key}.type"):
        return find_own_class(place.folder, *section.place, kind)


def arguments_of(
    key: str, section: Section, kind: Kind | None, place: Place, given: Mapping[str, Any] = _NOTHING
) -> dict[str, Any]:
    """Return the arguments that a section gives, in SI units, with objects in the place of sections.

    Raises:
        ExperimentError: a quantity is of another dimension, or an object cannot be made.
    """
    if isinstance(section, OwnSection):
        return _own_arguments(f"{key}.parameters", target_of(key, section, kind, place), section.parameters, place)
    found = section.arguments(place.to_radians)
    return {
        name: make(f"{key}.{name}", value, _kind_of(section, name), place, given)
        if isinstance(value, Section)
        else value
        for name, value in found.items()
    }


def _kind_of(section: Section, name: str) -> Kind | None:
    """Return the kind of object that an argument of a section's class is, or ``None`` where files name none."""
    target = getattr(section, "target", None)  # toolpaths are made of several
    types = parameters_of(target)[name].types if target is not None else ()
    return next(filter(None, map(find_kind, types)), None)


def _own_arguments(key: str, target: Callable[..., Any], parameters: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """Return keyword arguments for a class of the user, with the units and the forms that its annotations have."""
    known = parameters_of(target)
    units = units_of({name: one.unit for name, one in known.items() if one.unit is not None}, parameters)
    wrong: dict[Any, Any] = {}
    values = {name: read_quantities((name,), value, units.get(name, ()), wrong) for name, value in parameters.items()}
    for (name, *_), error in wrong.items():
        raise ExperimentError(
            f"{key}.{name}{error['type'].message()}", argument=f"{key}.{name}", value=parameters[name]
        )
    for name, value in values.items():
        if name in known:
            _check_form(f"{key}.{name}", known[name], value, units.get(name, ()))
        elif not any(one.kind is one.VAR_KEYWORD for one in inspect.signature(target).parameters.values()):
            meant = did_you_mean(name, known)
            raise ExperimentError(
                f"{key}.{name}: unknown key{meant or ';'} it is {_call_of(target)}",
                argument=f"{key}.{name}",
                value=value,
                choices=tuple(known),
            )
    return {name: convert_angles(value, units.get(name, ()), place.to_radians) for name, value in values.items()}


def _check_form(key: str, parameter: Parameter, value: Any, units: tuple[str, ...]) -> None:
    """Check that the value of a key has the form that the annotation of its parameter states, if it states one."""
    if parameter.form is not None:
        try:
            TypeAdapter(annotation_of(parameter)).validate_python(value)
        except ValidationError as error:
            unit = f", or one with a unit: {list_units(units)}" if units and isinstance(value, str) else ""
            raise ExperimentError(
                f"{describe_finding(error.errors()[0] | {'loc': (key,)})}{unit}", argument=key, value=value
            ) from None
