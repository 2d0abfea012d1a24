"""Sections of an experiment file, derived from the signatures of the classes that they are for."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Mapping
from contextlib import suppress
from dataclasses import is_dataclass
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, get_args, get_origin

from pydantic import Field, PlainValidator, TypeAdapter, create_model
from pydantic_core import PydanticCustomError

from pathcontrol._expect import did_you_mean
from pathcontrol.arguments import Form, Parameter, parameters_of
from pathcontrol.experiments.schema.section import Section, choose
from pathcontrol.experiments.schema.validators import Text, check_forms, expected
from pathcontrol.registry import Kind, find_kind, load

_OWN = re.compile(r"(?P<file>.+\.py|[^\W\d]\w*(\.[^\W\d]\w*)*):(?P<name>[^\W\d]\w*)")
_FORMS = {float: Form.NUMBER, int: Form.WHOLE, bool: Form.FLAG, str: Form.TEXT}


class Chosen(Section):
    """A section for one class of a kind, which ``type`` names."""

    type: str = ""
    target: ClassVar[Callable[..., Any]]


def _own_type(value: Any) -> str:
    if not _OWN.fullmatch(value):
        raise expected("'FILE.py:ClassName'")
    return value


class OwnSection(Section):
    """A class in a Python file, ``type = "FILE.py:ClassName"``, or in an installed module, ``"module:ClassName"``.

    ``parameters`` are the keyword arguments of the class. They are taken as they are, but where its annotations have
    a :class:`Unit` or a :class:`Form`.
    """

    type: Annotated[str, PlainValidator(_own_type)]
    parameters: dict[str, Any] = Field(default_factory=dict)

    @property
    def place(self) -> tuple[str, str]:
        """The file or the module, and the name of the class in it."""
        match = _OWN.fullmatch(self.type)
        assert match is not None
        return match["file"], match["name"]


def make_chooser(
    kind: Kind,
    base: type[Section] = Chosen,
    own: type[Section] | None = OwnSection,
    more: Mapping[str, Callable[[], type[Section]]] = MappingProxyType({}),
    key: str = "type",
    default: str | None = None,
) -> Callable[[Any], Any]:
    """Return a validator that takes a section for a class of the ``kind``, or one of ``more``, as ``key`` names it.

    Args:
        kind: the classes, of which the user's own are found too.
        base: what the sections derive from.
        own: the section for a class that is named with its file.
        more: sections beside those of the classes, by the name of each; one is made on first use.
        key: the key whose value names the class.
        default: the name where the file gives none.
    """

    def find(name: str) -> type[Section] | None:
        if own is not None and (".py" in name or ":" in name):
            return own
        if name in more:
            return more[name]()
        target = kind.find(name)
        return None if target is None else section_of(target, base, kind.given)

    choices, also = [*kind.members, *more], "" if own is None else " or 'FILE.py:ClassName'"
    return partial(choose, key=key, find=find, choices=choices, default=default, also=also)


def accept_several(validate: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a validator that takes what ``validate`` does, or a list of it."""
    several = TypeAdapter(list[Annotated[Any, PlainValidator(validate)]])
    return lambda value: several.validate_python(value) if isinstance(value, list) and value else validate(value)


@lru_cache(maxsize=256)
def section_of(target: Callable[..., Any], base: type[Section] = Section, given: tuple[str, ...] = ()) -> type[Section]:
    """Return the section whose keys are the parameters of a class or function, but for those that are ``given``.

    A key that ``base`` has stays as it is there.
    """
    fields = fields_of(target, (*given, *base.model_fields))
    made = create_model(getattr(target, "__name__", "section"), __base__=base, **fields)
    made.target = target  # type: ignore[attr-defined]
    return made


def fields_of(target: Callable[..., Any], given: Container[str] = ()) -> dict[str, Any]:
    """Return the annotation and the default of a field for each parameter of a class or function, but the ``given``."""
    return {
        name: (annotation_of(parameter), ... if parameter.required else None)
        for name, parameter in parameters_of(target).items()
        if name not in given
    }


def table_for(place: str, given: tuple[str, ...] = (), base: type[Section] = Section) -> PlainValidator:
    """Return the validator of a table for the class or function at a ``place``, which is loaded on first use."""
    return PlainValidator(lambda value: section_of(load(place), base, given).model_validate(value))


def annotation_of(parameter: Parameter) -> Any:
    """Return the annotation of a field for a parameter."""
    literals = [value for kind in parameter.types if get_origin(kind) is Literal for value in get_args(kind)]
    forms = [parameter.form] if parameter.form else [_FORMS[kind] for kind in parameter.types if kind in _FORMS]
    table = next(filter(None, map(_table_of, parameter.types)), None)
    if forms == [Form.TEXTS]:
        return list[Text]  # its errors name the entry
    if literals and not forms and table is None:
        return Literal[tuple(literals)]
    validate = check_forms(*forms) if forms else _accept
    words = [form.value for form in forms]
    if table is not None:
        validate, words = partial(_table_or, table, validate), [*words, "a table with the key 'type'"]
    if literals:
        validate = partial(_one_or, literals, ", or ".join(words), validate)
    return Annotated[Any, PlainValidator(validate), *parameter.marks]


def _table_of(kind: Any) -> Callable[[Any], Any] | None:
    """Return what makes a section of a table for an object that a parameter may be, if it may be one."""
    if (known := find_kind(kind)) is not None:
        return make_chooser(known)
    return section_of(kind).model_validate if isinstance(kind, type) and is_dataclass(kind) else None


def _table_or(table: Callable[[Any], Any], validate: Callable[[Any], Any], value: Any) -> Any:
    """Return the section that a table is, or what ``validate`` makes of any other value."""
    return table(value) if isinstance(value, dict | Section) or validate is _accept else validate(value)


def _accept(value: Any) -> Any:
    """Return what its class has to check."""
    return value


def _one_or(literals: Iterable[str], words: str, validate: Callable[[Any], Any], value: Any) -> Any:
    """Return one of some texts, or what ``validate`` makes of any other value."""
    if isinstance(value, str) and value in literals:
        return value
    if not isinstance(value, str):
        with suppress(PydanticCustomError):
            return validate(value)
    raise expected(f"one of {', '.join(map(repr, literals))}, or {words}{did_you_mean(value, literals)}")
