"""A section of an experiment file, and the choice between sections of several kinds."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, ModelWrapValidatorHandler, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from pathcontrol._expect import did_you_mean
from pathcontrol._units import Quantity, is_number, is_quantity, list_units, parse_quantity
from pathcontrol.arguments import Unit
from pathcontrol.errors import InputError
from pathcontrol.experiments.schema.validators import expected, show_value

#: the SI units of each field that is a quantity, one or several
Units = Mapping[str, tuple[str, ...]]
Finder = Callable[[str], type["Section"] | None]
_EXPLAINED = "explained"
_MOST_LISTED = 21  # errors of a section: one more than a message has
_Wrong = dict[tuple[int | str, ...], InitErrorDetails]


class Section(BaseModel):
    """A table of an experiment file. Its fields are named as the arguments of what is built from it.

    A field that is a quantity has a :class:`Unit` in its annotation; it may be a text, as ``"50 mm/s"``.

    Attributes:
        not_arguments: names of the fields that are no arguments.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)
    not_arguments: ClassVar[tuple[str, ...]] = ("type", "mode")

    def arguments(self, to_radians: Callable[[float], float]) -> dict[str, Any]:
        """Return keyword arguments in SI units; what the file leaves out is left to the defaults."""
        names = [name for name in type(self).model_fields if name not in self.not_arguments]
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        units = self.units_of(given)
        return {name: convert_angles(value, units.get(name, ()), to_radians) for name, value in given.items()}

    @model_validator(mode="wrap")
    @classmethod
    def _explain(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Read texts with units, and say in every error what to write instead; here the valid keys are known."""
        wrong: _Wrong = {}
        if isinstance(value, dict):
            units = cls.units_of(value)
            value = {key: read_quantities((key,), v, units.get(key, ()), wrong) for key, v in value.items()}
        try:
            made = handler(value)
        except ValidationError as error:
            errors = [e for e in error.errors(include_url=False) if not _is_listed(e["loc"], wrong)]
            found = [_detail(cls, e) for e in errors[:_MOST_LISTED]]
            raise ValidationError.from_exception_data(cls.__name__, [*wrong.values(), *found]) from None
        if wrong:
            raise ValidationError.from_exception_data(cls.__name__, [*wrong.values()])
        return made

    @classmethod
    def units_of(cls, given: Mapping[str, Any]) -> Units:
        """Return the units of the fields that are quantities, which may depend on whether a frame is ``given``."""
        return units_of(_quantities(cls), given)


@lru_cache(maxsize=256)
def _quantities(section: type[Section]) -> dict[str, Unit]:
    fields = section.model_fields.items()
    return {name: mark for name, field in fields for mark in field.metadata if isinstance(mark, Unit)}


def units_of(quantities: Mapping[str, Unit], given: Mapping[str, Any]) -> Units:
    """Return the units that quantities have beside what else is ``given``: of a frame's motion, or of the joints'."""
    motion = given.get("motion")
    frame = given.get("frame") or (motion.get("frame") if isinstance(motion, dict) else getattr(motion, "frame", None))
    return {name: (unit.tool,) if frame and unit.tool else unit.names for name, unit in quantities.items()}


def choose(
    value: Any, key: str, find: Finder, choices: Iterable[str], default: str | None = None, also: str = ""
) -> Any:
    """Make of a table the section that its value of ``key`` names; errors list the ``choices`` and ``also``."""
    if isinstance(value, Section):
        return value
    if not isinstance(value, dict):
        raise expected(f"a table with the key {key!r}")
    kind = value.get(key, default)
    section = find(kind) if isinstance(kind, str) else None
    if section is None:
        raise _wrong_choice(key, kind, list(choices), also)
    return section.model_validate(value)


def read_quantities(at: tuple[int | str, ...], value: Any, units: tuple[str, ...], wrong: _Wrong) -> Any:
    """Return ``value`` with each text in it read as a quantity; what is none goes to ``wrong``, by where it is."""
    if not units or isinstance(value, int | float):
        return value
    if isinstance(value, list):
        return [read_quantities((*at, i), item, units, wrong) for i, item in enumerate(value)]
    if isinstance(value, dict) and "type" not in value:  # one that has it is a section, which has its own units
        return {key: read_quantities((*at, key), item, units, wrong) for key, item in value.items()}
    if isinstance(value, str) and (is_quantity(value) or (len(at) > 1 and is_number(value))):  # one among others
        try:
            if len(wrong) > _MOST_LISTED:
                return value
            return parse_quantity(value, *units)
        except InputError as error:
            wrong[at] = _explained(at, value, f" = {show_value(value)}, {error}")
    return value


def _is_listed(at: tuple[int | str, ...], wrong: _Wrong) -> bool:
    """Return whether something is wrong at a key that is ``at``, in it, or around it."""
    return any(all(a == b for a, b in zip(at, other, strict=False)) for other in wrong)


def convert_angles(value: Any, units: tuple[str, ...], to_radians: Callable[[float], float]) -> Any:
    """Return an angle or an angular rate converted from the file's ``angle_unit``, and anything else as it is."""
    return convert_numbers(value, to_radians) if units and units[0].startswith("rad") else value


def convert_numbers(value: Any, function: Callable[[float], float]) -> Any:
    """Return ``value`` with ``function`` applied to each number in it that was given without a unit."""
    if isinstance(value, Quantity | bool | str):
        return value
    if isinstance(value, dict):
        return {key: convert_numbers(item, function) for key, item in value.items()}
    return [convert_numbers(item, function) for item in value] if isinstance(value, list) else function(value)


def _wrong_choice(key: str, kind: Any, names: list[str], also: str) -> ValidationError:
    choices = ", ".join(map(repr, names)) + also
    text = f": missing; choose one of {choices}"
    if kind is not None:
        text = f" = {show_value(kind)}, expected one of {choices}{did_you_mean(kind, names)}"
    return ValidationError.from_exception_data("choice", [_explained((key,), kind, text)])


def _detail(section: type[Section], error: Any) -> InitErrorDetails:
    """Return a line of a validation error, as what follows the key path in the message."""
    return _explained(error["loc"], error["input"], _text(section, error))


def _explained(loc: tuple[int | str, ...], value: Any, text: str) -> InitErrorDetails:
    error = PydanticCustomError(_EXPLAINED, "{text}", {"text": text})
    return InitErrorDetails(type=error, loc=loc, input=value)


def _text(section: type[Section], error: Any) -> str:
    kind, value = error["type"], error["input"]
    if kind == _EXPLAINED:
        return error["ctx"]["text"]
    if kind == "missing":
        needed = [name for name, field in section.model_fields.items() if field.is_required()]
        return f": missing; needed here: {', '.join(needed)}"
    if kind == "extra_forbidden":
        keys = sorted(section.model_fields, key=lambda name: name not in section.not_arguments)
        return f": unknown key{did_you_mean(error['loc'][-1], keys) or ';'} valid keys: {', '.join(keys)}"
    return f" = {show_value(value)}, expected {_wanted(error)}{_closest_literal(error)}{_or_with_unit(section, error)}"


def _or_with_unit(section: type[Section], error: Any) -> str:
    """Return the units that a text might have had, where it stands for a quantity."""
    about_text = error["loc"] and isinstance(error["input"], str)
    units = section.units_of({}).get(error["loc"][0]) if about_text else None
    return "" if units is None else f", or one with a unit: {list_units(units)}"


def _wanted(error: Any) -> str:
    if error["type"] in ("model_type", "model_attributes_type", "dict_type"):
        return "a table"
    return error["msg"].removeprefix("Input should be ").replace("a valid ", "a ")


def _closest_literal(error: Any) -> str:
    if error["type"] != "literal_error":
        return ""
    return did_you_mean(error["input"], re.findall("'(.*?)'", error["ctx"]["expected"]))
