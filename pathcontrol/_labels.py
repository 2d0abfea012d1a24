"""Labelled values: pandas and xarray objects, and mappings from the names of joints.

Neither library is imported; what has an index, columns or coordinates of names is taken for one of theirs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pathcontrol.errors import InputError

_DIMENSION = "joint"  # what runs call the axis of the joints


class Labelled(NamedTuple):
    """Values whose last axis has names: the values, (*batch, n), and the n names."""

    values: Any
    names: tuple[str, ...]


def read_labels(name: str, value: Any) -> Labelled | None:
    """Return the values and names of a value with names along one axis, which becomes the last; else ``None``.

    Raises:
        InputError: two axes have names, or a name is there twice.
    """
    if isinstance(value, np.ndarray | float | int):
        return None
    if isinstance(value, list | tuple):
        return _of_rows(name, value)
    found = _of_mapping(value) or _of_xarray(name, value) or _of_pandas(value)
    if found is not None and len(set(found.names)) < len(found.names):
        raise InputError(
            f"{name} has a label twice ({_enumerate(found.names)}), expected each joint once",
            argument=name,
            value=list(found.names),
        )
    return found


def order_by_name(name: str, value: Labelled, joints: Sequence[str]) -> Any:
    """Return the values in the order of the joints.

    Raises:
        InputError: the names are not those of the joints.
    """
    if set(value.names) != set(joints):
        raise InputError(
            f"{name} is labelled {_enumerate(value.names)}, expected {_enumerate(joints)}; "
            "give a value for each joint by its name, or plain numbers in that order",
            argument=name,
            value=list(value.names),
            choices=tuple(joints),
        )
    order = [value.names.index(joint) for joint in joints]
    return np.asarray(value.values)[..., order]


def refuse_labels(name: str, value: Any) -> None:
    """Refuse a value with names where no order of names is known.

    Raises:
        InputError: it has names.
    """
    if (found := read_labels(name, value)) is not None:
        raise InputError(
            f"{name} is labelled {_enumerate(found.names)}, but by which labels to order it is not known here; "
            "put it in the order of robot.joint_names and give plain numbers (to_numpy)",
            argument=name,
            value=list(found.names),
        )


def _of_rows(name: str, rows: Sequence[Any]) -> Labelled | None:
    """Read rows that are labelled one by one, such as a list of postures; all take the order of the first."""
    found = {
        i: read_labels(name, row) for i, row in enumerate(rows) if hasattr(row, "to_numpy") or isinstance(row, Mapping)
    }
    named = {i: one for i, one in found.items() if one is not None}
    if not named:
        return None
    names = next(iter(named.values())).names
    if len(named) < len(rows):
        raise InputError(
            f"{name} has rows with labels ({_enumerate(names)}) and rows without, expected all alike",
            argument=name,
            value=list(names),
        )
    return Labelled(np.stack([order_by_name(f"{name}[{i}]", one, names) for i, one in named.items()]), names)


def _of_mapping(value: Any) -> Labelled | None:
    """Read a mapping from names to values."""
    if not isinstance(value, Mapping) or (names := _read_names(value)) is None:
        return None
    return Labelled(np.stack([np.asarray(one) for one in value.values()], axis=-1), names)


def _of_xarray(name: str, value: Any) -> Labelled | None:
    """Read an xarray object with one axis of names."""
    dims, coords = getattr(value, "dims", None), getattr(value, "coords", None)
    if not isinstance(dims, tuple) or coords is None or not hasattr(value, "values"):
        return None
    found = {axis: _read_names(np.asarray(coords[dim])) for axis, dim in enumerate(dims) if dim in coords}
    named = {axis: names for axis, names in found.items() if names is not None}
    if len(named) > 1 and _DIMENSION in dims:
        named = {axis: names for axis, names in named.items() if dims[axis] == _DIMENSION} or named
    if len(named) > 1:
        raise InputError(
            f"{name} has labels along {', '.join(str(dims[axis]) for axis in named)}, expected joints only",
            argument=name,
            value=[str(dims[axis]) for axis in named],
        )
    for axis, names in named.items():
        return Labelled(np.moveaxis(np.asarray(value.values), axis, -1), names)
    return None


def _of_pandas(value: Any) -> Labelled | None:
    """Read a pandas object whose columns or index are names."""
    for labels in (getattr(value, "columns", None), getattr(value, "index", None)):
        if labels is not None and not callable(labels) and hasattr(value, "to_numpy"):
            names = _read_names(labels)
            return None if names is None else Labelled(value.to_numpy(), names)
    return None


def _read_names(labels: Iterable[Any]) -> tuple[str, ...] | None:
    """Return the labels as texts if there are any and all of them are texts, else ``None``."""
    found = () if isinstance(labels, np.ndarray) and labels.ndim != 1 else tuple(labels)
    return tuple(map(str, found)) if found and all(isinstance(one, str) for one in found) else None


def _enumerate(names: Sequence[str], most: int = 8) -> str:
    """Return the names, separated by commas, at most so many of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
