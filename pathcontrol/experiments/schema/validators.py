"""The values of an experiment file: strict, finite, and refused with what was expected instead."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import PlainValidator
from pydantic_core import PydanticCustomError

from pathcontrol.arguments import Form

_REPR = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = _REPR.maxlong = 80


def expected(what: str) -> PydanticCustomError:
    """Return the error of a value that is not ``what``."""
    return PydanticCustomError("expected", "{what}", {"what": what})


def show_value(value: Any) -> str:
    """Return ``value`` as an error message shows it: as TOML spells it, and not at length."""
    return str(value).lower() if isinstance(value, bool) else _REPR.repr(value)


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # TOML integers may be of any length
        return False


def _is_positive(value: Any) -> bool:
    return _is_number(value) and value > 0


def _is_not_negative(value: Any) -> bool:
    return _is_number(value) and value >= 0


def _is_limit(value: Any) -> bool:
    return _is_positive(value) or value == math.inf


def _is_whole(value: Any) -> bool:
    return _is_number(value) and isinstance(value, int) and abs(value) < 2**53


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value.strip() != "" and "\0" not in value


def _list_of(test: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list | tuple) and len(value) > 0 and all(map(test, value))


def _either(*tests: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: any(test(value) for test in tests)


def _is_formula(value: Any) -> bool:
    return _is_number(value) or _is_text(value)


def _is_array(value: Any) -> bool:
    return _is_number(value) or _list_of(_is_array)(value)


def _is_name_or_number(value: Any) -> bool:
    return _is_text(value) or (_is_whole(value) and value >= 0)


def _is_columns(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(_is_name_or_number, value.values()))
    return _is_text(value) or (isinstance(value, list) and all(map(_is_text, value)))


_TESTS: dict[Form, Callable[[Any], bool]] = {
    Form.TEXT: _is_text,
    Form.JOINT: _is_name_or_number,
    Form.FLAG: _is_flag,
    Form.WHOLE: _is_whole,
    Form.WHOLES: _list_of(_is_whole),
    Form.NUMBER: _is_number,
    Form.NUMBERS: _list_of(_is_number),
    Form.POSITIVE: _is_positive,
    Form.POSITIVE_OR_INF: _is_limit,
    Form.POSITIVES: _list_of(_is_positive),
    Form.NOT_NEGATIVE: _is_not_negative,
    Form.DEVIATIONS: _either(_is_not_negative, _list_of(_is_not_negative)),
    Form.POINTS: _list_of(_list_of(_is_number)),
    Form.ARRAY: _is_array,
    Form.GAIN: _either(_is_number, _list_of(_is_number), _list_of(_list_of(_is_number))),
    Form.GAIN_OR_ZERO: _is_number,
    Form.LIMITS: _either(_is_flag, _list_of(_is_limit)),
    Form.FORMULA: _is_formula,
    Form.FORMULAS: _list_of(_is_formula),
    Form.COLUMNS: _is_columns,
}


def check_forms(*forms: Form) -> Callable[[Any], Any]:
    """Return a function that gives values of one of the ``forms`` back, and tells what else was expected."""

    def check(value: Any) -> Any:
        if not any(_TESTS[form](value) for form in forms):
            raise expected(", or ".join(form.value for form in forms))
        return list(value) if isinstance(value, tuple) else value

    return check


def _of(form: Form) -> PlainValidator:
    return PlainValidator(check_forms(form))


Text = Annotated[str, _of(Form.TEXT)]
Whole = Annotated[int, _of(Form.WHOLE)]
Number = Annotated[float, _of(Form.NUMBER)]
Positive = Annotated[float, _of(Form.POSITIVE)]
Numbers = Annotated[list[float], _of(Form.NUMBERS)]
