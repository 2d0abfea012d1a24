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

_CONFIG = "pathcontrol_config"
_GROUP = "origin"
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
        data = xr.load_dataset(path, engine="h5netcdf")
        return data, json.loads(data.attrs.pop(_CONFIG)), _read_origin(path)
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{str(path)!r} is not a run saved by Run.save: {error}") from error


def _read_origin(path: Path) -> Stored | None:
    try:
        origin = xr.load_dataset(path, engine="h5netcdf", group=_GROUP)
    except OSError:  # there is no such group: the file is older than runs that know their robot
        return None
    return Stored(origin["recipe"].to_numpy().tobytes().decode(), origin["numbers"].to_numpy())


def _write(data: xr.Dataset, path: Path, level: int, **where: Any) -> None:
    packed = {name: {"zlib": True, "complevel": level, "shuffle": True} for name in data.data_vars}
    data.to_netcdf(path, engine="h5netcdf", encoding=packed, **where)
