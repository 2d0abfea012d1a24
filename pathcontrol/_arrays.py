"""Checks and conversions of array arguments, shared by every floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._labels import order_by_name, read_labels, refuse_labels
from pathcontrol._units import is_quantity
from pathcontrol.errors import InputError

#: an array of floats; shapes are said in docstrings
Array = NDArray[Any]

#: in SI units: sums and products of what is larger are beyond the range of floats, and Pinocchio adds up no bodies that
#: are lighter than 2e-16 kg
LARGEST, SMALLEST = 1e30, 1e-12


def as_array(name: str, value: ArrayLike) -> Array:
    """Convert ``value`` to a float array; errors name it, and labels, which would be lost, are refused."""
    refuse_labels(name, value)
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:  # OverflowError: an integer of hundreds of digits
        plain = " in SI units, without a unit" if isinstance(value, str) and is_quantity(value) else ""
        raise InputError(f"{name} = {value!r}, expected numbers{plain}", argument=name, value=value) from error


def as_joint_array(name: str, value: Any, n: int, joints: Sequence[str] | None = None) -> Array:
    """Convert ``value`` to an array (*batch, n), put in the order of ``joints`` if it is labelled by their names."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        array: Array = value
    else:
        array = as_array(name, value if joints is None else strip_labels(name, value, joints))
    if array.ndim == 0 or array.shape[-1] != n:
        raise InputError(
            f"{name} has shape {array.shape}, expected (*batch, {n}): one value for each of the {n} joints last",
            argument=name,
            value=value,
        )
    return array


def strip_labels(name: str, value: Any, joints: Sequence[str]) -> Any:
    """Return ``value`` without its labels, if it has any, put in the order of the ``joints``.

    Raises:
        InputError: the labels are not the names of the joints.
    """
    found = read_labels(name, value)
    return value if found is None else order_by_name(name, found, joints)


def check_finite(name: str, array: Array) -> Array:
    """Check that all of ``array`` is finite, and return it."""
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(
            f"{name}{list(where) if where else ''} is {array[where]}, expected finite numbers",
            argument=name,
            value=float(array[where]),
        )
    return array


def check_physical(name: str, array: Array) -> Array:
    """Check that ``array`` is finite and below 1e30 in size, so that dynamics can compute with it; return it."""
    check_finite(name, array)
    if (np.abs(array) >= LARGEST).any():
        where = tuple(int(i) for i in np.argwhere(np.abs(array) >= LARGEST)[0])
        raise InputError(
            f"{name}{list(where) if where else ''} = {array[where]:g}, expected SI units, below {LARGEST:g}",
            argument=name,
            value=float(array[where]),
            limit=LARGEST,
        )
    return array


def as_joint_vector(name: str, value: Any, n: int) -> Array:
    """Convert ``value`` to finite numbers of one arm's joints, (n,)."""
    array = check_finite(name, as_joint_array(name, value, n))
    if array.size != n:
        raise InputError(f"{name} has the shape {array.shape}, expected ({n},): one arm", argument=name, value=value)
    return array.reshape(n)


def as_scalar(name: str, value: Any, *, positive: bool = False, least: float | None = None) -> float:
    """Convert ``value`` to a finite float, optionally positive or not below ``least``."""
    array = as_array(name, value)
    if array.ndim != 0 or not np.isfinite(array):
        raise InputError(f"{name} = {value!r}, expected one finite number", argument=name, value=value)
    number = float(array)
    if positive and number <= 0:
        raise InputError(
            f"{name} = {number:g}, expected a number greater than 0", argument=name, value=number, limit=0.0
        )
    if least is not None and number < least:
        raise InputError(
            f"{name} = {number:g}, expected a number not below {least:g}", argument=name, value=number, limit=least
        )
    return number


def as_whole(name: str, value: Any, least: int, most: int) -> int:
    """Convert ``value`` to a whole number from ``least`` to ``most``, such as one that sets how much is allocated."""
    array = as_array(name, value)
    if array.ndim != 0 or not least <= array <= most or array != np.floor(array):
        raise InputError(
            f"{name} = {value!r:.80}, expected a whole number from {least} to {most}",
            argument=name,
            value=value,
            limit=(least, most),
        )
    return int(array)


def check_whole(name: str, value: Any, least: int = 1) -> int:
    """Check that a count or a seed is an integer not below ``least``; return it."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(
            f"{name} = {value!r}, expected a whole number from {least}", argument=name, value=value, limit=least
        )
    return int(value)


def as_quantity(name: str, value: Any) -> float:
    """Convert ``value`` to a float from 1e-12 to 1e30, such as a mass, so that dynamics can compute with it."""
    number = as_scalar(name, value, positive=True)
    if not SMALLEST <= number < LARGEST:
        raise InputError(
            f"{name} = {number:g}, expected SI units, from {SMALLEST:g} to {LARGEST:g}",
            argument=name,
            value=number,
            limit=(SMALLEST, LARGEST),
        )
    return number


def freeze(array: Array) -> Array:
    """Return a copy that cannot be written to, so that values stay values."""
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def merge_rows(values: Sequence[Array]) -> Array:
    """Return the value that all rows share, (*shape,), or else all of them stacked, (N, *shape)."""
    if all(value is values[0] for value in values):
        return values[0]
    rows = np.stack(values)
    return freeze(rows[0] if (rows == rows[0]).all() else rows)


def join_columns(parts: Sequence[Array]) -> Array:
    """Return arrays (*batch, m) side by side, (*batch, Σm), with their batch axes broadcast against each other."""
    if any(part.shape[:-1] != parts[0].shape[:-1] for part in parts):
        batch = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
        parts = [np.broadcast_to(part, (*batch, part.shape[-1])) for part in parts]
    return np.concatenate(parts, axis=-1)


def check_rigid(name: str, pose: ArrayLike, tolerance: float = 1e-9) -> Array:
    """Check that ``pose`` is a homogeneous transform (4, 4) of a rigid motion up to ``tolerance``; errors name it."""
    transform = check_finite(name, as_array(name, pose))
    if transform.shape != (4, 4):
        raise InputError(
            f"{name} has shape {transform.shape}, expected (4, 4), a homogeneous transform", argument=name, value=pose
        )
    turn = transform[:3, :3]
    proper = np.allclose(turn @ turn.T, np.eye(3), atol=tolerance) and np.linalg.det(turn) > 0
    if not proper or not np.allclose(transform[3], [0, 0, 0, 1]):
        raise InputError(
            f"{name} is no rigid motion: its rotation is not orthonormal, or its last row not 0 0 0 1",
            argument=name,
            value=pose,
        )
    return freeze(transform)


def copy_vectors(array: Array) -> Array:
    """Return a contiguous copy of an array (*batch, n), n numbers at a time where they lie together, as in a record.

    NumPy itself copies short last axes number by number, which takes twice as long.
    """
    if array.ndim < 2 or not array.size or array.strides[-1] != array.itemsize:
        return np.array(array, order="C")
    copy, vector = np.empty(array.shape, array.dtype), np.dtype((np.void, array.shape[-1] * array.itemsize))
    copy.view(vector)[...] = array.view(vector)
    return copy


def average_neighbours(values: Array) -> Array:
    """Return the means of neighbours along the first axis, (k − 1, …) from (k, …)."""
    return 0.5 * (values[1:] + values[:-1])


def norms(vectors: Array) -> Array:
    """Return Euclidean norms over the last axis; inf beyond 1e154."""
    with np.errstate(over="ignore"):
        return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def check_index(name: str, value: Any) -> None:
    """Check that a number of a rollout or a path is an integer."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InputError(f"{name} = {value!r:.80}, expected a whole number, counted from 0", argument=name, value=value)
