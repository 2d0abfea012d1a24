"""The values of an experiment file: strict, finite, and refused with what was expected instead."""

from __future__ import annotations

import difflib
import math
import reprlib
from collections.abc import Callable, Iterable
from typing import Annotated, Any

from pydantic import PlainValidator
from pydantic_core import PydanticCustomError

_REPR = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = _REPR.maxlong = 80


def expected(what: str) -> PydanticCustomError:
    """The error of a value that is not ``what``."""
    return PydanticCustomError("expected", "{what}", {"what": what})


def shown(value: Any) -> str:
    """``value`` as an error message shows it: as TOML spells it, and not at length."""
    return str(value).lower() if isinstance(value, bool) else _REPR.repr(value)


def did_you_mean(word: Any, choices: Iterable[str]) -> str:
    """``; did you mean …?`` with the choice closest to ``word``, or nothing."""
    by_lower = {choice.lower(): choice for choice in choices}
    found = difflib.get_close_matches(str(word)[:80].lower(), by_lower, n=1, cutoff=0.6)
    return f"; did you mean {by_lower[found[0]]!r}?" if found else ""


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # TOML integers may be of any length
        return False


def _is_positive(value: Any) -> bool:
    return _is_number(value) and value > 0


def _is_limit(value: Any) -> bool:
    return _is_positive(value) or value == math.inf


def _is_whole(value: Any) -> bool:
    return _is_number(value) and isinstance(value, int) and abs(value) < 2**53


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool)


def _is_columns(value: Any) -> bool:
    if isinstance(value, dict):
        return all(_is_text(at) or (_is_whole(at) and at >= 0) for at in value.values())
    return _is_text(value) or (isinstance(value, list) and all(map(_is_text, value)))


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value.strip() != "" and "\0" not in value


def _list_of(test: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list | tuple) and len(value) > 0 and all(map(test, value))


def _either(*tests: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: any(test(value) for test in tests)


def _only(test: Callable[[Any], bool], what: str) -> PlainValidator:
    """Values that pass ``test``, integers as they are; others are told that ``what`` was expected."""

    def check(value: Any) -> Any:
        if not test(value):
            raise expected(what)
        return list(value) if isinstance(value, tuple) else value

    return PlainValidator(check)


Text = Annotated[str, _only(_is_text, "a text in quotes")]
Flag = Annotated[bool, _only(_is_flag, "true or false")]
Whole = Annotated[int, _only(_is_whole, "a whole number")]
Columns = Annotated[
    str | list[str] | dict[str, int | str],
    _only(_is_columns, "names of columns in their order, or a table with the number or the name of each"),
]
Number = Annotated[float, _only(_is_number, "a finite number")]
Positive = Annotated[float, _only(_is_positive, "a number greater than 0")]
NotNegative = Annotated[float, _only(lambda value: _is_number(value) and value >= 0, "a number not below 0")]
Numbers = Annotated[list[float], _only(_list_of(_is_number), "a list of finite numbers")]
Positives = Annotated[list[float], _only(_list_of(_is_positive), "a list of numbers greater than 0")]
Wholes = Annotated[list[int], _only(_list_of(_is_whole), "a list of whole numbers")]
Gain = Annotated[
    float | list[float] | list[list[float]],
    _only(
        _either(_is_number, _list_of(_is_number), _list_of(_list_of(_is_number))),
        "a finite number, or a list with one for each joint",
    ),
]
FlagOrLimits = Annotated[
    bool | list[float],
    _only(_either(_is_flag, _list_of(_is_limit)), "true, false or a list with one number above 0 for each joint"),
]
