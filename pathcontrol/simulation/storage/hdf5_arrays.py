"""Arrays over dimensions in groups of HDF5 files, as netCDF-4 lays them out, by the lower level of h5py.

Its upper level takes twice as long to write the many small arrays of a run, and to find them again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import h5py  # type: ignore[import-untyped]
import numpy as np
from h5py import h5a, h5d, h5ds, h5g, h5i, h5l, h5o, h5p, h5s, h5t

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.simulation.samples import Labelled

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
_TEXT = h5py.string_dtype()
_IN_ORDER = h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED
_PIECE = 1 << 18  # bytes that are compressed together: with more it takes no less
_OF_FORMAT = frozenset((b"CLASS", b"NAME", b"DIMENSION_LIST", b"REFERENCE_LIST", b"_NCProperties"))


def put_arrays(group: h5py.Group, labelled: Mapping[str, Labelled], packed: Collection[Any], level: int) -> None:
    """Write arrays over dimensions as netCDF-4 does, the ``packed`` ones compressed at a ``level``.

    A dimension is a scale of HDF5, the array of its name or else an empty one.
    """
    made: dict[str, h5d.DatasetID] = {}
    sizes: dict[str, int] = {}
    for name, (dims, array, attributes) in labelled.items():
        made[name] = _put_array(group.id, name, array, attributes.get("_FillValue"), level if name in packed else 0)
        sizes |= zip(dims, array.shape, strict=True)
        for key, value in attributes.items():
            _put_attribute(made[name], key, value)
    for dim, size in sizes.items():
        own = dim in labelled
        scale = made[dim] if own else _make_dataset(group.id, dim, h5t.IEEE_F32BE, (size,), _creation())
        h5ds.set_scale(scale, (dim if own else f"{NO_VARIABLE}{size:10}").encode())
        for name, (dims, *_) in labelled.items():
            if dim in dims and name != dim:
                h5ds.attach_scale(made[name], scale, dims.index(dim))


def _creation() -> h5p.PropDCID:
    """Return the properties of a new dataset that netCDF-4 asks for."""
    creation = h5p.create(h5p.DATASET_CREATE)
    creation.set_obj_track_times(False)
    creation.set_attr_creation_order(_IN_ORDER)
    return creation


def _put_array(group: h5g.GroupID, name: str, array: Array, missing: Any, level: int) -> h5d.DatasetID:
    """Write an array, words as text of any length, and return its place in the file."""
    if array.dtype.kind in "UO":
        array = array.astype(_TEXT)
    array, creation = np.ascontiguousarray(array).reshape(array.shape), _creation()
    if level and array.size > 1:
        creation.set_chunk(_piece(array))
        creation.set_shuffle()
        creation.set_deflate(level)
    if missing is not None:
        creation.set_fill_value(np.array(missing, dtype=array.dtype))
    place = _make_dataset(group, name, h5t.py_create(array.dtype, logical=True), array.shape, creation)
    place.write(h5s.ALL, h5s.ALL, array)
    return place


def _make_dataset(
    group: h5g.GroupID, name: str, kind: h5t.TypeID, shape: tuple[int, ...], creation: h5p.PropDCID
) -> h5d.DatasetID:
    """Make a dataset without values."""
    return h5d.create(group, name.encode(), kind, h5s.create_simple(shape), creation)


def _piece(array: Array) -> tuple[int, ...]:
    """Return the shape of the parts of an array that are compressed, each for itself: whole rows as far as may be."""
    shape = list(array.shape)
    for axis in range(array.ndim):
        row = array.itemsize * math.prod(shape[axis + 1 :])
        shape[axis] = max(1, min(shape[axis], _PIECE // max(row, 1)))
    return tuple(shape)


def _put_attribute(item: h5d.DatasetID, name: str, value: Any) -> None:
    """Write an attribute: a text, or numbers along one axis."""
    text = isinstance(value, str)
    array = np.array(value, dtype=_TEXT) if text else np.atleast_1d(value)
    if not text and array.dtype.kind not in "biuf":  # as texts along an axis, which another program gave it
        h5py.Dataset(item).attrs.create(name, array)
        return
    kind = h5t.py_create(array.dtype, logical=True)
    h5a.create(item, name.encode(), kind, h5s.create_simple(array.shape)).write(array)


def find_arrays(group: h5py.Group, inside: str = "") -> Iterator[tuple[str, h5py.Dataset]]:
    """Yield all arrays in a file by their place, but those that only hold the length of a dimension.

    Raises:
        InputError: one is a link to somewhere else.
    """
    for name in group:
        key = name.encode("utf-8", "surrogateescape")
        if group.id.links.get_info(key).type != h5l.TYPE_HARD:
            raise InputError(f"{inside}{name} is a link to somewhere else", value=inside + name)
        item = h5o.open(group.id, key)
        if isinstance(item, h5g.GroupID):
            yield from find_arrays(h5py.Group(item), f"{inside}{name}/")
        elif isinstance(item, h5d.DatasetID) and not _is_length(item):
            yield inside + name, h5py.Dataset(item)


def _is_length(item: h5d.DatasetID) -> bool:
    """Return whether a dataset only holds the length of a dimension."""
    return h5ds.is_scale(item) and h5ds.get_scale_name(item).startswith(NO_VARIABLE.encode())


def read_attributes(item: h5py.HLObject) -> dict[str, Any]:
    """Read the attributes of a variable or a group, but those of the format."""
    names: list[bytes] = []
    h5a.iterate(item.id, lambda name, *_: names.append(name))
    return {name.decode(): item.attrs[name] for name in names if name not in _OF_FORMAT}


def read_dimensions(name: str, item: h5py.Dataset) -> tuple[str, ...]:
    """Return the names of the scales of an array, or its own if it is one."""
    if h5ds.is_scale(item.id):
        return (name,)
    scales: list[h5d.DatasetID] = []
    for axis in range(item.id.rank):
        if h5ds.get_num_scales(item.id, axis):
            h5ds.iterate(item.id, axis, scales.append, 0)
    return tuple(h5i.get_name(scale).decode().removeprefix("/") for scale in scales)
