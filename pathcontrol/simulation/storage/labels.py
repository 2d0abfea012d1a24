"""Labelled arrays in a netCDF file, in the form of xarray, without loading xarray."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import h5netcdf  # type: ignore[import-untyped]
import h5py  # type: ignore[import-untyped]
import numpy as np

from pathcontrol.simulation.samples import Labelled


def put_labelled(
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
        _put(group, name, (dims, array, about), level if name in variables else None)
    loose = _list_unused_coordinates(variables.values(), coordinates)
    if loose:
        group.attrs["coordinates"] = loose


def _put(group: h5netcdf.Group, name: str, labelled: Labelled, level: int | None) -> None:
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
