"""The netCDF file of a run: data and configuration, and in a group of its own the robot and the path."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5netcdf  # type: ignore[import-untyped]
import h5py  # type: ignore[import-untyped]
import numpy as np

from pathcontrol._files import whole_file
from pathcontrol.errors import InputError, warn
from pathcontrol.simulation.context import StoredContext
from pathcontrol.simulation.samples import Samples
from pathcontrol.simulation.storage.cf_encoding import decode_samples, encode_run
from pathcontrol.simulation.storage.file_form import check_form, find_sized_arrays
from pathcontrol.simulation.storage.hdf5_arrays import put_arrays, read_attributes, read_dimensions
from pathcontrol.simulation.storage.seal import check_seal, digest_of, seal
from pathcontrol.simulation.variables import OUTCOMES, VARIABLES

if TYPE_CHECKING:
    import xarray as xr

_LEVEL = 1  # of compression: noisy errors do not shrink further at higher levels
_CONFIG = "pathcontrol_config"
_DIGEST = "pathcontrol_sha256"
_GROUP = "origin"
_WRITER = np.bytes_(f"version=2,h5py={h5py.__version__},hdf5={h5py.version.hdf5_version}")  # netCDF-C wants to know
_KNOWN = (*VARIABLES, *OUTCOMES, "time", "joint", "rollout")
_RECIPE = {"long_name": "robot and task of the run, JSON in UTF-8"}
_NUMBERS = {"long_name": "arrays of the recipe, one after another"}


def write_run(path: Path, data: xr.Dataset | Samples, config: Mapping[str, Any], stored: StoredContext) -> None:
    """Write a run, whole or not at all, with its checksum.

    The file is made in memory: HDF5 ends the process by a segmentation fault where it cannot write to a full disk.

    Raises:
        StorageError: it cannot be written.
    """
    memory, text = io.BytesIO(), json.dumps(config)
    recipe = np.frombuffer(stored.text.encode(), dtype=np.uint8)
    origin = {"recipe": (("byte",), recipe, _RECIPE), "numbers": (("number",), stored.numbers, _NUMBERS)}
    with h5py.File(memory, "w", track_order=True) as file:
        variables, about = encode_run(data)
        put_arrays(file, variables, data.arrays if isinstance(data, Samples) else data.data_vars, _LEVEL)
        file.attrs.update({**about, _CONFIG: text, _DIGEST: _digest_of_run(data, text), "_NCProperties": _WRITER})
        group = file.create_group(_GROUP, track_order=True)
        put_arrays(group, origin, origin, 4)
        group.attrs[_DIGEST] = _digest_of_origin(stored)
    content = memory.getbuffer()
    with whole_file(path) as temporary, temporary.open("wb") as written:
        written.write(content)
        written.write(seal(content))


def _usual_names(folder: Path) -> list[str]:
    """Return the names of files in a folder that may be runs, ``run.nc`` first."""
    found = sorted(file.name for suffix in ("nc", "mcap") for file in folder.glob(f"*.{suffix}"))
    return sorted(found, key=lambda name: name != "run.nc")


_TOOLPATHS = (".csv", ".tsv", ".txt", ".xyz", ".ngc", ".gcode", ".gc", ".tap", ".cnc", ".svg", ".dxf")


def read_run(path: Path) -> tuple[xr.Dataset | Samples, dict[str, Any], StoredContext | None]:
    """Read data, configuration, and robot and path if the file has them.

    Raises:
        InputError: there is no such file, it is damaged, or it is not a saved run.
    """
    if path.is_dir():
        inside = next((f"; in it is {name!r}" for name in _usual_names(path)), "")
        raise InputError(f"{str(path)!r} is a folder, expected the file of a run{inside}", file=str(path))
    if not path.is_file():
        raise InputError(f"there is no file {str(path)!r}", file=str(path))
    try:
        check_seal(path)
        with h5py.File(path, "r") as file:
            items = find_sized_arrays(file, path.stat().st_size)
            about, stored = read_attributes(file), _read_origin(file, items)
            samples = _read_samples({name: item for name, item in items.items() if "/" not in name}, about)
        data, about = _read_data(path) if samples is None else (samples, about)
        digest, text = about.pop(_DIGEST, None), about.pop(_CONFIG)
        config = json.loads(text)
        check_form(data, config)
        _check_digest(digest, lambda: _digest_of_run(data, text))
        if not isinstance(data, Samples) and "rollout" not in data.coords:
            data = data.assign_coords(rollout=data["rollout"])  # so that parts of the run keep their numbers
    except Exception as error:  # a broken file may fail anywhere in the readers
        reason = str(error) if "file signature not found" not in str(error) else f"it is no HDF5 file{_remedy(path)}"
        raise InputError(f"{str(path)!r} is not a run saved by Run.save: {reason}", file=str(path)) from error
    if digest is None:
        warn(
            f"{str(path)!r} has no checksum, as it was written by an earlier version: damage would not be noticed; "
            "load it and save it again to give it one"
        )
    return data, config, stored


def _read_samples(items: Mapping[str, h5py.Dataset], about: Mapping[str, Any]) -> Samples | None:
    """Read a file that is as :func:`write_run` writes it, without xarray; ``None`` from another one."""
    dims = {name: read_dimensions(name, item) for name, item in items.items()}
    if not isinstance(about.get(_CONFIG), str) or any(len(dims[name]) != item.ndim for name, item in items.items()):
        return None
    found = {name: (dims[name], _read_array(item), read_attributes(item)) for name, item in items.items()}
    return decode_samples(found, {name: value for name, value in about.items() if name not in (_CONFIG, _DIGEST)})


def _read_data(path: Path) -> tuple[xr.Dataset, dict[str, Any]]:
    """Read all variables, and decode them by the conventions of CF.

    The backend of xarray would ask for the encoding of each variable too, which takes longer than to read it.
    """
    import xarray as xr  # takes half a second to load

    with h5netcdf.File(path, "r", phony_dims="access") as form, h5py.File(path, "r") as file:
        found = {
            name: (item.dimensions, _read_array(file[name]), dict(item.attrs)) for name, item in form.variables.items()
        }
        data = xr.decode_cf(xr.Dataset(found, attrs=dict(form.attrs)), decode_times=False)
    about = {name: data.attrs.pop(name) for name in (_DIGEST, _CONFIG) if name in data.attrs}
    return data, about


def _read_array(variable: h5py.Dataset) -> Any:
    """Read an array, and words as NumPy's text: as objects not every version of xarray can write them again."""
    return variable.asstr()[...].astype(str) if h5py.check_string_dtype(variable.dtype) else variable[...]


def _remedy(path: Path) -> str:
    """Return advice for files that other functions read."""
    suffix = path.suffix.lower()
    if suffix in (".urdf", ".xacro"):
        return "; a URDF is loaded by load_robot"
    return "; a toolpath is read by read_toolpath" if suffix in _TOOLPATHS else ""


def _read_origin(file: h5py.File, items: Mapping[str, h5py.Dataset]) -> StoredContext | None:
    """Read robot and path, or ``None`` from a file without them."""
    if _GROUP not in file:  # the file is older than runs that know their robot
        return None
    recipe, numbers = (items[f"{_GROUP}/{name}"][...] for name in ("recipe", "numbers"))
    if recipe.dtype != np.uint8 or numbers.dtype != np.float64 or recipe.ndim != 1 or numbers.ndim != 1:
        raise InputError("what it says of its robot and path is no text with numbers")
    stored = StoredContext(recipe.tobytes().decode(), numbers)
    _check_digest(file[_GROUP].attrs.get(_DIGEST), lambda: _digest_of_origin(stored))
    return stored


def _check_digest(stored: Any, digest: Callable[[], str]) -> None:
    """Check that the stored checksum, if there is one, is that of the content."""
    if stored is not None and stored != digest():
        raise InputError("it is damaged, or was changed: its checksum is another one; take another copy of it")


def _digest_of_run(data: xr.Dataset | Samples, text: str) -> str:
    """Return the checksum of the data and the configuration of a run."""
    if isinstance(data, Samples):
        found = {name: data.plain(name) for name in _KNOWN}
        return digest_of({name: values for name, values in found.items() if values is not None}, text)
    return digest_of({name: data[name].to_numpy() for name in _KNOWN if name in data.variables}, text)


def _digest_of_origin(stored: StoredContext) -> str:
    """Return the checksum of robot and path."""
    return digest_of({"numbers": stored.numbers}, stored.text)
