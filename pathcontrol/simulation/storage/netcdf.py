"""The netCDF file of a run: data and configuration, and in a group of its own the robot and the path."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5netcdf  # type: ignore[import-untyped]
import h5py  # type: ignore[import-untyped]
import numpy as np

from pathcontrol._files import whole_file
from pathcontrol.errors import InputError, warn
from pathcontrol.simulation.context import StoredContext
from pathcontrol.simulation.samples import Labelled, Samples
from pathcontrol.simulation.storage.file_form import check_form, check_sizes
from pathcontrol.simulation.storage.seal import check_seal, digest_of, seal
from pathcontrol.simulation.variables import OUTCOMES, VARIABLES

if TYPE_CHECKING:
    import xarray as xr

_LEVEL = 1  # of compression: noisy errors do not shrink further at higher levels
_CONFIG = "pathcontrol_config"
_DIGEST = "pathcontrol_sha256"
_GROUP = "origin"
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
    with h5netcdf.File(memory, "w") as file:
        _put(file, data)
        file.attrs.update({_CONFIG: text, _DIGEST: _digest_of_run(data, text)})
        group = file.create_group(_GROUP)
        _put_labelled(group, origin, {}, 4)
        group.attrs[_DIGEST] = _digest_of_origin(stored)
    content = memory.getbuffer()
    with whole_file(path) as temporary, temporary.open("wb") as written:
        written.write(content)
        written.write(seal(content))


_TOOLPATHS = (".csv", ".tsv", ".txt", ".xyz", ".ngc", ".gcode", ".gc", ".tap", ".cnc", ".svg", ".dxf")


def read_run(path: Path) -> tuple[xr.Dataset, dict[str, Any], StoredContext | None]:
    """Read data, configuration, and robot and path if the file has them.

    Raises:
        InputError: there is no such file, it is damaged, or it is not a saved run.
    """
    if not path.is_file():
        raise InputError(f"there is no file {str(path)!r}")
    try:
        check_seal(path)
        with h5py.File(path, "r") as file:
            check_sizes(file, path.stat().st_size)
        data = _read_data(path)
        digest, text = data.attrs.pop(_DIGEST, None), data.attrs.pop(_CONFIG)
        config = json.loads(text)
        check_form(data, config)
        _check_digest(digest, lambda: _digest_of_run(data, text))
        if "rollout" not in data.coords:  # number the rollouts, so that parts of the run keep their numbers
            data = data.assign_coords(rollout=data["rollout"])
        stored = _read_origin(path)
    except Exception as error:  # a broken file may fail anywhere in the readers
        reason = str(error) if "file signature not found" not in str(error) else f"it is no HDF5 file{_remedy(path)}"
        raise InputError(f"{str(path)!r} is not a run saved by Run.save: {reason}") from error
    if digest is None:
        warn(
            f"{str(path)!r} has no checksum, as it was written by an earlier version: damage would not be noticed; "
            "load it and save it again to give it one"
        )
    return data, config, stored


def _read_data(path: Path) -> xr.Dataset:
    """Read all variables, and decode them by the conventions of CF.

    The backend of xarray would ask for the encoding of each variable too, which takes longer than to read it.
    """
    import xarray as xr  # takes half a second to load

    with h5netcdf.File(path, "r", decode_vlen_strings=True, phony_dims="access") as file:
        found = {name: (item.dimensions, _read_array(item), dict(item.attrs)) for name, item in file.variables.items()}
        return xr.decode_cf(xr.Dataset(found, attrs=dict(file.attrs)), decode_times=False)


def _read_array(variable: h5netcdf.Variable) -> Any:
    """Read an array, and words as NumPy's text: as objects not every version of xarray can write them again."""
    array = variable[...]
    return array.astype(str) if h5py.check_string_dtype(variable.dtype) else array


def _remedy(path: Path) -> str:
    """Return advice for files that other functions read."""
    suffix = path.suffix.lower()
    if suffix in (".urdf", ".xacro"):
        return "; a URDF is loaded by load_robot"
    return "; a toolpath is read by read_toolpath" if suffix in _TOOLPATHS else ""


def _read_origin(path: Path) -> StoredContext | None:
    """Read robot and path, or ``None`` from a file without them."""
    with h5py.File(path, "r") as file:
        if _GROUP not in file:  # the file is older than runs that know their robot
            return None
        origin = file[_GROUP]
        recipe, numbers, digest = origin["recipe"][...], origin["numbers"][...], origin.attrs.get(_DIGEST)
    if recipe.dtype != np.uint8 or numbers.dtype != np.float64 or recipe.ndim != 1 or numbers.ndim != 1:
        raise InputError("what it says of its robot and path is no text with numbers")
    stored = StoredContext(recipe.tobytes().decode(), numbers)
    _check_digest(digest, lambda: _digest_of_origin(stored))
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


def _put(file: h5netcdf.File, data: xr.Dataset | Samples) -> None:
    """Write the data of a run."""
    if isinstance(data, Samples):
        _put_labelled(file, *data.label_all(), _LEVEL)
        return
    from xarray.backends import H5NetCDFStore  # loaded already, and it handles any other content of the data

    packed = {name: {"zlib": True, "complevel": _LEVEL, "shuffle": True} for name in data.data_vars}
    data.dump_to_store(H5NetCDFStore(file), encoding=packed)


def _put_labelled(
    group: h5netcdf.Group, variables: Mapping[str, Labelled], coordinates: Mapping[str, Labelled], level: int
) -> None:
    """Write variables, compressed at a ``level``, and the coordinates along which they are laid out.

    By the conventions of CF and of xarray a variable names its coordinates, words are text of any length, truth values
    are bytes that are called ``bool``, and a missing number is NaN.
    """
    everything = {**coordinates, **variables}
    for dims, array, _ in everything.values():
        group.dimensions.update({d: n for d, n in zip(dims, np.shape(array), strict=True) if d not in group.dimensions})
    for name, (dims, array, attributes) in everything.items():
        about = dict(attributes)
        if name in variables and (named := _list_coordinates(dims, coordinates)):
            about["coordinates"] = named
        _put_variable(group, name, (dims, array, about), level if name in variables else None)
    loose = _list_unused_coordinates(variables.values(), coordinates)
    if loose:
        group.attrs["coordinates"] = loose


def _put_variable(group: h5netcdf.Group, name: str, labelled: Labelled, level: int | None) -> None:
    """Write one labelled array."""
    dims, array, attributes = labelled
    kind = array.dtype.kind
    packed = {} if level is None else {"compression": "gzip", "compression_opts": level, "shuffle": True}
    numbers = array.astype("i1") if kind == "b" else array.astype(object) if kind == "U" else array
    dtype = h5py.string_dtype() if kind == "U" else numbers.dtype
    variable = group.create_variable(
        name, dims, dtype=dtype, data=numbers, fillvalue=np.nan if kind == "f" else None, **packed
    )
    variable.attrs.update({**attributes, **({"dtype": "bool"} if kind == "b" else {})})


def _list_coordinates(dims: Iterable[str], coordinates: Mapping[str, Labelled]) -> str:
    """Return the names of the coordinates of a variable over ``dims``, without the axes themselves."""
    return " ".join(sorted(name for name, (over, *_) in coordinates.items() if over != (name,) and {*over} <= {*dims}))


def _list_unused_coordinates(variables: Iterable[Labelled], coordinates: Mapping[str, Labelled]) -> str:
    """Return the names of the coordinates that belong to no variable."""
    seen = {name for dims, *_ in variables for name in _list_coordinates(dims, coordinates).split()}
    return " ".join(sorted(name for name, (over, *_) in coordinates.items() if over != (name,) and name not in seen))
