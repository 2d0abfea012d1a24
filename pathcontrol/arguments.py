"""Annotations of the arguments of a class: their units and the forms they may have in a file.

A file is read by them: ``speed: Annotated[float, Form.POSITIVE, Unit("m/s")]`` may be given as ``"50 mm/s"`` there.
"""

from __future__ import annotations

import builtins
import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from types import NoneType, SimpleNamespace, UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

from numpy.typing import ArrayLike


class Form(Enum):
    """The form of an argument in a file; the value says it in words."""

    TEXT = "a text in quotes"
    TEXTS = "a list of texts in quotes"
    JOINT = "the name of a joint, or its number from 0"
    FLAG = "true or false"
    WHOLE = "a whole number"
    WHOLES = "a list of whole numbers"
    NUMBER = "a finite number"
    NUMBERS = "a list of finite numbers"
    POSITIVE = "a number greater than 0"
    POSITIVE_OR_INF = "a number greater than 0, or inf"
    POSITIVES = "a list of numbers greater than 0"
    NOT_NEGATIVE = "a number not below 0"
    DEVIATIONS = "a number not below 0, or a list with one for each joint"
    POINTS = "a list of lists of finite numbers"
    ARRAY = "a finite number, or lists of them"
    GAIN = "a finite number, or a list with one for each joint"
    GAIN_OR_ZERO = "a finite number, 0 or more"
    LIMITS = "true, false or a list with one number above 0 for each joint"
    FORMULA = "a formula as a text, or a number"
    FORMULAS = "a list of formulas as texts, or of numbers"
    COLUMNS = "names of columns in their order, or a table with the number or the name of each"


_MAY_BE_ZERO = {Form.GAIN: False, Form.GAIN_OR_ZERO: True}


@dataclass(frozen=True)
class Unit:
    """The SI unit of an argument, in an annotation: ``Annotated[float, Unit("rad")]``.

    In an experiment file such an argument may be a text with a unit, and ``angle_unit`` applies to what is in rad,
    rad/s or rad/s^2.

    Attributes:
        names: the unit, or several of which it may have any, as ``Unit("N m", "N")`` for joints that turn or slide.
        tool: the unit instead where a frame of the arm is named whose motion is meant.
    """

    names: tuple[str, ...]
    tool: str | None = None

    def __init__(self, *names: str, tool: str | None = None) -> None:
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "tool", tool)


Rate = Annotated[float, Form.POSITIVE, Unit("1/s")]
Speed = Annotated[float, Form.POSITIVE, Unit("rad/s")]
Length = Annotated[float, Form.POSITIVE, Unit("m")]
Distance = Annotated[float, Form.NOT_NEGATIVE, Unit("m")]
Feed = Annotated[float, Form.POSITIVE, Unit("m/s")]
Point = Annotated[ArrayLike, Form.NUMBERS, Unit("m")]
Points = Annotated[ArrayLike, Form.POINTS, Unit("m")]
Direction = Annotated[ArrayLike, Form.NUMBERS]
Posture = Annotated[ArrayLike, Form.NUMBERS, Unit("rad")]
Names = Annotated[str | Sequence[str], Form.TEXTS]
Torques = Annotated[ArrayLike, Form.NUMBERS, Unit("N m")]


class Parameter(NamedTuple):
    """A parameter of a class or function.

    Attributes:
        types: what it may be but ``None``.
        marks: the :class:`Form` and :class:`Unit` of its annotation.
        required: whether it has no default.
        default: the default, if it has one.
    """

    types: tuple[Any, ...]
    marks: tuple[Any, ...]
    required: bool
    default: Any

    @property
    def unit(self) -> Unit | None:
        """The unit of the argument, if it has one."""
        return next((mark for mark in self.marks if isinstance(mark, Unit)), None)

    @property
    def form(self) -> Form | None:
        """The form of the argument, if it states one."""
        return next((mark for mark in self.marks if isinstance(mark, Form)), None)


@lru_cache(maxsize=256)
def parameters_of(target: Callable[..., Any]) -> dict[str, Parameter]:
    """Return the parameters of a class or function by name, with those of the next base where it takes ``**options``.

    An annotation of an attribute of the same name, in the class or a base, says what the parameter's does not.
    """
    found: dict[str, Parameter] = {}
    attributes = _hints(target) if isinstance(target, type) else {}
    for function in _functions(target):
        hints, more = _hints(function), False
        for name, parameter in inspect.signature(function).parameters.items():
            more |= parameter.kind is parameter.VAR_KEYWORD
            if name != "self" and parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
                types, marks = _parts(hints.get(name, Any))
                marks = marks or _parts(attributes.get(name, Any))[1]
                required = parameter.default is parameter.empty
                found.setdefault(name, Parameter(types, marks, required, parameter.default))
        if not more:
            break
    return found


@lru_cache(maxsize=64)
def gains_of(law: Callable[..., Any]) -> dict[str, bool]:
    """Return the gains among the arguments of a law, and which of them may be 0."""
    forms = {name: one.form for name, one in parameters_of(law).items()}
    return {name: _MAY_BE_ZERO[form] for name, form in forms.items() if form in _MAY_BE_ZERO}


def _functions(target: Callable[..., Any]) -> Iterator[Callable[..., Any]]:
    """Yield the constructors of a class, its own first, or the function itself."""
    if not isinstance(target, type):
        yield target
    for cls in getattr(target, "__mro__", (object,))[:-1]:
        if "__init__" in vars(cls):
            yield vars(cls)["__init__"]


def _hints(target: Any) -> dict[str, Any]:
    """Return what annotations say, those that can be understood."""
    found: dict[str, Any] = {}
    for one in reversed(getattr(target, "__mro__", (inspect.unwrap(target),))):
        names = getattr(one, "__globals__", None) or vars(sys.modules.get(one.__module__, builtins))
        for name, annotation in inspect.get_annotations(one).items():
            alone = SimpleNamespace(__annotations__={name: annotation})
            with suppress(NameError, TypeError, AttributeError, SyntaxError):  # of a user, or for type checkers only
                found |= get_type_hints(alone, names, include_extras=True)
    return found


def _parts(annotation: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return the types of an annotation without ``None``, and what it is annotated with."""
    if get_origin(annotation) is Annotated:
        inner, *outer = get_args(annotation)
        types, marks = _parts(inner)
        return types, (*outer, *marks)
    if get_origin(annotation) in (Union, UnionType):
        parts = [_parts(one) for one in get_args(annotation) if one is not NoneType]
        return tuple(kind for types, _ in parts for kind in types), tuple(mark for _, marks in parts for mark in marks)
    return (annotation,), ()
