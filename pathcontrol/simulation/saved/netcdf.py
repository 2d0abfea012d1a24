"""The netCDF file of a run: data and configuration, and in a group of its own the robot and the path."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pathcontrol._files import whole_file
from pathcontrol.errors import InputError
from pathcontrol.simulation.origin import Stored
from pathcontrol.simulation.variables import OUTCOMES, VARIABLES

_CONFIG = "pathcontrol_config"
_GROUP = "origin"
_DEEPEST = 50
_RECIPE = {"long_name": "robot and task of the run, JSON in UTF-8"}
_NUMBERS = {"long_name": "arrays of the recipe, one after another"}


def write_run(path: Path, data: xr.Dataset, config: Mapping[str, Any], stored: Stored) -> None:
    """Write a run, whole or not at all."""
    text = np.frombuffer(stored.text.encode(), dtype=np.uint8)
    origin = xr.Dataset({"recipe": ("byte", text, _RECIPE), "numbers": ("number", stored.numbers, _NUMBERS)})
    with whole_file(path) as temporary:
        _write(data.assign_attrs({_CONFIG: json.dumps(config)}), temporary, 1)
        _write(origin, temporary, 4, mode="a", group=_GROUP)


def read_run(path: Path) -> tuple[xr.Dataset, dict[str, Any], Stored | None]:
    """Data, configuration, and robot and path if the file has them.

    Raises:
        InputError: there is no such file, or it is not a saved run.
    """
    if not path.is_file():
        raise InputError(f"there is no file {str(path)!r}")
    try:
        data = xr.load_dataset(path, engine="h5netcdf", decode_times=False)
        config = json.loads(data.attrs.pop(_CONFIG))
        _check(data, config)
        return data, config, _read_origin(path)
    except Exception as error:  # a broken file makes those who read it stumble anywhere
        raise InputError(f"{str(path)!r} is not a run saved by Run.save: {error}") from error


def _check(data: xr.Dataset, config: Any) -> None:
    """The file has the form of a run, whatever its numbers are."""
    if not isinstance(config, dict):
        raise InputError(f"its configuration is a {type(config).__name__}, expected names and values")
    if _deeper(config, _DEEPEST):
        raise InputError(f"its configuration is nested more than {_DEEPEST} deep")
    if missing := [name for name in ("q", "time", "status") if name not in data.variables]:
        raise InputError(f"it has no {' and no '.join(missing)}")
    for name, (dims, *_) in (VARIABLES | OUTCOMES | {"time": (("time",),)}).items():
        if name not in data.variables:
            continue
        variable, words = data[name], name in ("status", "reason", "path_status")
        if variable.dims != dims or (variable.dtype.kind in "bfiu") == words:
            raise InputError(f"{name} is {variable.dtype} over {variable.dims}, expected other values over {dims}")
        if name in VARIABLES and not isinstance(variable.attrs.get("units"), str):
            raise InputError(f"{name} has no unit")


def _deeper(value: Any, levels: int) -> bool:
    """Whether tables and lists are nested deeper than so many levels: no reader is to run out of stack."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return levels == 0 or any(_deeper(item, levels - 1) for item in inner)


def _read_origin(path: Path) -> Stored | None:
    try:
        origin = xr.load_dataset(path, engine="h5netcdf", group=_GROUP)
    except OSError:  # there is no such group: the file is older than runs that know their robot
        return None
    return Stored(origin["recipe"].to_numpy().tobytes().decode(), origin["numbers"].to_numpy())


def _write(data: xr.Dataset, path: Path, level: int, **where: Any) -> None:
    packed = {name: {"zlib": True, "complevel": level, "shuffle": True} for name in data.data_vars}
    data.to_netcdf(path, engine="h5netcdf", encoding=packed, **where)
