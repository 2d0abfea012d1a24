"""The messages of a run in an MCAP file: each is a sample as a JSON object, whose numbers are read back exactly."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError

_WORDS = {"nan": "null", "inf": '"Infinity"', "-inf": '"-Infinity"'}
_KINDS = "biuf"


class Variable(NamedTuple):
    """A variable over time as a field of messages.

    Attributes:
        name: what it is called.
        per_joint: whether it has a value for each joint.
        dtype: NumPy's name of the type of its numbers, as ``"<f8"``.
        attributes: unit and meaning.
    """

    name: str
    per_joint: bool
    dtype: str
    attributes: Mapping[str, Any]


class MessageFormat:
    """The form of messages: ``{"time": 0.1, "q": {"joint_1": 0.2, …}, …, "s": 1.5, "regular": true}``.

    PlotJuggler and Foxglove show each number by its name, such as ``q/joint_1``. What is no number is ``null``, as JSON
    has no NaN, and infinity a word. Floats are written with as many digits as tell them from all others.

    Args:
        variables: the fields beside ``time``.
        joints: names of the joints.

    Raises:
        InputError: a variable is no number.
    """

    def __init__(self, variables: Sequence[Variable], joints: Sequence[str]) -> None:
        self.variables, self.joints = tuple(variables), tuple(joints)
        for one in variables:
            if np.dtype(one.dtype).kind not in _KINDS or np.dtype(one.dtype).itemsize > 8:
                raise InputError(f"{one.name} is {np.dtype(one.dtype)}, expected numbers", value=one.name)
        self._template = self._make_template()

    def schema(self) -> bytes:
        """Return the JSON schema of the messages."""
        fields: dict[str, Any] = {"time": {"type": "number", "description": "time [s]"}}
        for one in self.variables:
            unit, meaning = one.attributes.get("units", "1"), one.attributes.get("long_name", one.name)
            kind = "boolean" if np.dtype(one.dtype).kind == "b" else "number"
            said = {"description": f"{meaning} [{unit}]"}
            each = {joint: {"type": kind} for joint in self.joints}
            fields[one.name] = said | ({"type": "object", "properties": each} if one.per_joint else {"type": kind})
        about = {"title": "Sample", "description": "a moment of an arm and its control law"}
        return json.dumps(about | {"type": "object", "properties": fields}).encode()

    def encode(self, time: Array, arrays: Mapping[str, Array]) -> list[bytes]:
        """Return the messages at times [s], (k,), of variables (k,) or (k, n)."""
        columns = [_write_numbers(time)]
        for one in self.variables:
            values = np.asarray(arrays[one.name])
            columns += [_write_numbers(column) for column in (values.T if one.per_joint else [values])]
        return [(self._template % row).encode() for row in zip(*columns, strict=True)]

    def decode(self, messages: Iterable[bytes]) -> tuple[Array, dict[str, Array]]:
        """Return times (k,), and the variables by their names, (k,) or (k, n) each.

        Raises:
            ValueError, LookupError, TypeError: a message has another form.
        """
        rows = [self._flatten(json.loads(message)) for message in messages]
        table = np.array(rows, dtype=np.float64).reshape(len(rows), self._width)
        arrays, at = {}, 1
        for one in self.variables:
            size = len(self.joints) if one.per_joint else 1
            block = table[:, at : at + size] if one.per_joint else table[:, at]
            arrays[one.name], at = block.astype(np.dtype(one.dtype)), at + size
        return table[:, 0], arrays

    @property
    def _width(self) -> int:
        """The count of the numbers in a message."""
        return 1 + sum(len(self.joints) if one.per_joint else 1 for one in self.variables)

    def _make_template(self) -> str:
        """Return the text of a message with a ``%s`` for each number."""
        joints = ",".join(f"{_escape(joint)}:%s" for joint in self.joints)
        fields = [f"{_escape(one.name)}:" + (f"{{{joints}}}" if one.per_joint else "%s") for one in self.variables]
        return "{" + ",".join(['"time":%s', *fields]) + "}"

    def _flatten(self, message: Any) -> list[Any]:
        """Return all values of a message in one list."""
        row = [message["time"]]
        for one in self.variables:
            value = message[one.name]
            if one.per_joint:
                row += [value[joint] for joint in self.joints]
            else:
                row.append(value)
        return row


def _escape(name: str) -> str:
    """Return a name as JSON in a template."""
    return json.dumps(name).replace("%", "%%")


def _write_numbers(column: Array) -> list[str]:
    """Return numbers (k,) as JSON texts."""
    values = column.tolist()
    if column.dtype.kind == "b":
        return ["true" if value else "false" for value in values]
    texts = [repr(value) for value in values]
    if column.dtype.kind == "f" and not np.isfinite(column).all():
        return [_WORDS.get(text, text) for text in texts]
    return texts


def write_loose(array: Array) -> dict[str, Any]:
    """Return an array of numbers or words of any shape as a JSON value."""
    if array.dtype.kind in "UO":
        return {"dtype": "str", "shape": list(array.shape), "values": [str(word) for word in array.reshape(-1)]}
    texts = _write_numbers(array.reshape(-1))
    return {"dtype": array.dtype.str, "shape": list(array.shape), "values": json.loads(f"[{','.join(texts)}]")}


def read_loose(value: Mapping[str, Any]) -> Array:
    """Return the array of :func:`write_loose`.

    Raises:
        InputError: it is none of numbers or words.
        ValueError, LookupError, TypeError: it has another form.
    """
    if value["dtype"] == "str":
        words = np.array([str(word) for word in value["values"]], dtype=np.str_)
        return words.reshape(value["shape"])
    dtype = np.dtype(value["dtype"])
    if dtype.kind not in _KINDS:
        raise InputError(f"an array of {dtype}, expected numbers or words", value=str(dtype))
    numbers = np.array(value["values"], dtype=np.float64 if dtype.kind == "f" else dtype)
    return numbers.astype(dtype).reshape(value["shape"])
