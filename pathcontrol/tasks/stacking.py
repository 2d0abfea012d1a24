"""Tasks that differ only in numbers, as one task whose numbers have a row for each of them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import is_dataclass
from functools import cached_property
from inspect import getattr_static
from numbers import Real
from typing import Any

import numpy as np

from pathcontrol.tasks.base import PathTask
from pathcontrol.tasks.profile import VelocityProfile
from pathcontrol.tasks.stacked_numerics import StackedClosestPoint, StackedDerivative


def skeleton(value: Any) -> Hashable:
    """What a task, or a part of one, is beside its numbers: those of tasks that can be stacked are equal.

    A number is one wherever it is an attribute by itself or in an array; in tuples and lists numbers say which joints,
    or how many, and have to agree. Anything unknown has to be the same object.
    """
    if isinstance(value, Real) and not isinstance(value, bool):
        return "number"
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        return "array", value.shape
    if type(value) in (tuple, list):
        return type(value), *((item if _is_plain(item) else skeleton(item)) for item in value)
    if _is_plain(value):
        return type(value), value
    if _has_parts(value):
        return type(value), *((name, skeleton(part)) for name, part in _parts(value).items())
    return id(value)


def stacked(values: Sequence[Any]) -> Any:
    """One of ``values``, of equal skeletons, in which every number that differs has a leading axis for them, (N, …).

    What a task computes by itself, derivatives and nearest points, is computed by each with what it knows of itself.
    """
    first = values[0]
    if all(value is first for value in values) or (_is_plain(first) and not isinstance(first, Real)):
        return first
    if isinstance(first, Real | np.ndarray):
        rows = np.array(values)
        return first if (rows == rows[0]).all() else rows
    if type(first) in (tuple, list):
        return type(first)(stacked(items) for items in zip(*values, strict=True))
    twin = object.__new__(type(first))
    every = [_parts(value) for value in values]
    twin.__dict__.update((name, stacked([parts[name] for parts in every])) for name in every[0])
    if isinstance(twin, PathTask):
        twin.__dict__["_path_derivative"] = StackedDerivative(values, "_path_derivative", twin.q_d)
        twin.__dict__["_profile_derivative"] = StackedDerivative(values, "_profile_derivative", twin._broadcast_theta)
        twin.__dict__["_closest_point"] = StackedClosestPoint(values, twin)
    return twin


def _is_plain(value: Any) -> bool:
    return value is None or isinstance(value, bool | Real | str | bytes | type)


def _has_parts(value: Any) -> bool:
    known = isinstance(value, PathTask | VelocityProfile) or is_dataclass(value)
    return known and hasattr(value, "__dict__")


def _parts(value: Any) -> dict[str, Any]:
    """The attributes of an object without those that it keeps of what it computed once."""
    kind = type(value)
    return {n: v for n, v in vars(value).items() if not isinstance(getattr_static(kind, n, None), cached_property)}
