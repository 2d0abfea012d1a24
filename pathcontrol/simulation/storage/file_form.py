"""Checks of the form of a file before a run is made of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import h5py  # type: ignore[import-untyped]
import numpy as np
from h5py import h5d

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.simulation.samples import Samples
from pathcontrol.simulation.storage.hdf5_arrays import find_arrays
from pathcontrol.simulation.variables import OUTCOMES, VARIABLES

if TYPE_CHECKING:
    import xarray as xr

_DEEPEST = 50
_DENSEST = 1100  # bytes that deflate may expand one byte to, 1032, with a margin
_UNWRITTEN = 1 << 20  # bytes that a small variable may have without being in the file
WORDS, COUNTS = ("status", "reason", "path_status"), ("laps", "path_index", "forgotten")


def find_sized_arrays(file: h5py.File, size: int) -> dict[str, h5py.Dataset]:
    """Return the arrays in a file by their place, none larger than ``size`` bytes can hold: they take memory next.

    Raises:
        InputError: one is, or its numbers are not in this file.
    """
    stored, found = 0, {}
    for name, variable in find_arrays(file):
        place, creation = variable.id, variable.id.get_create_plist()
        if creation.get_external_count() or creation.get_layout() == h5d.VIRTUAL:
            raise InputError(f"the numbers of {name} are said to be in another file", value=name)
        stored += place.get_storage_size()
        most = _UNWRITTEN + _DENSEST * min(stored, size)
        chunk = creation.get_chunk() if creation.get_layout() == h5d.CHUNKED else ()
        count = max(math.prod(chunk), math.prod(place.shape))
        if count * place.get_type().get_size() > most:
            raise InputError(
                f"it says that {name} has the shape {variable.shape}, which cannot be in a file of {size} bytes",
                value=variable.shape,
            )
        found[name] = variable
    return found


def check_form(data: xr.Dataset | Samples, config: Any) -> None:
    """Check that data and configuration have the form of a run, regardless of their numbers.

    Raises:
        InputError: they have not.
    """
    if not isinstance(config, dict):
        raise InputError(
            f"its configuration is a {type(config).__name__}, expected names and values", value=type(config).__name__
        )
    if is_deeper(config, _DEEPEST):
        raise InputError(f"its configuration is nested more than {_DEEPEST} deep", limit=_DEEPEST)
    if isinstance(data, Samples):
        _check_labels(data.time, data.plain("joint"), data.rollout)
        return
    if missing := [name for name in ("q", "time", "status") if name not in data.variables]:
        raise InputError(f"it has no {' and no '.join(missing)}", value=missing)
    for name, (dims, *_) in (VARIABLES | OUTCOMES | {"time": (("time",),)}).items():
        if name not in data.variables:
            continue
        variable = data[name]
        if variable.dims != dims or (variable.dtype.kind in "bfiu") == (name in WORDS):
            raise InputError(
                f"{name} is {variable.dtype} over {variable.dims}, expected other values over {dims}", value=name
            )
        if name in COUNTS and variable.dtype.kind not in "iu":
            raise InputError(f"{name} is {variable.dtype}, expected whole numbers", value=name)
        if name in VARIABLES and not isinstance(variable.attrs.get("units"), str):
            raise InputError(f"{name} has no unit", value=name)
    for name in ("rollout", "joint"):
        if name in data.coords and data[name].dims != (name,):
            raise InputError(f"{name} is over {data[name].dims}, expected ({name!r},)", value=name)
    joints = data["joint"].to_numpy() if "joint" in data.coords else None
    _check_labels(data["time"].to_numpy(), joints, data["rollout"].to_numpy())  # 0, 1, … where the file has none
    for name in WORDS:
        if name in data.variables and not all(isinstance(word, str) for word in data[name].to_numpy().tolist()):
            raise InputError(f"{name} holds something else than words", value=name)


def _check_labels(time: Array, joints: Array | None, rollouts: Array) -> None:
    """Check the values along which the arrays are laid out: times, names of joints, numbers of rollouts."""
    if not np.isfinite(time).all():
        raise InputError("its times are not finite")
    if not (np.diff(time) > 0).all():
        raise InputError("its times do not increase")
    if joints is None or not all(isinstance(name, str) for name in joints.tolist()):
        raise InputError(f"its joints are {joints}, expected their names", value=joints)
    if len(set(joints.tolist())) < len(joints):
        raise InputError(f"its joints are {joints.tolist()}, expected names that differ", value=joints)
    if rollouts.dtype.kind not in "iu" or len(np.unique(rollouts)) < len(rollouts):
        raise InputError(f"its rollouts are {rollouts}, expected whole numbers that differ", value=rollouts)


def is_deeper(value: Any, levels: int) -> bool:
    """Return whether tables and lists are nested deeper than ``levels``: no reader is to run out of stack."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return levels == 0 or any(is_deeper(item, levels - 1) for item in inner)
