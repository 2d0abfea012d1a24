"""The arrays and attributes that stand for a run in a netCDF file, by the conventions of CF and of xarray."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.samples import Labelled, Samples
from pathcontrol.simulation.storage.file_form import COUNTS, WORDS
from pathcontrol.simulation.variables import OUTCOMES, VARIABLES

if TYPE_CHECKING:
    import xarray as xr

_AXES = ("rollout", "time", "joint")


def encode_run(data: xr.Dataset | Samples) -> tuple[dict[str, Labelled], dict[str, Any]]:
    """Return numbers, words and attributes that stand for a run by the conventions of CF and of xarray.

    A variable names its coordinates, truth values are bytes that are called ``bool``, and a missing number is NaN.
    """
    if not isinstance(data, Samples):
        from xarray.conventions import cf_encoder, encode_dataset_coordinates  # loaded already

        variables, about = cf_encoder(*encode_dataset_coordinates(data))
        return {name: (v.dims, v.to_numpy(), v.attrs) for name, v in variables.items()}, dict(about)
    variables, coordinates = data.label_all()
    for dims, _, attributes in variables.values():
        if named := _list_coordinates(dims, coordinates):
            attributes["coordinates"] = named
    loose = _list_unused_coordinates(variables.values(), coordinates)
    everything = {name: _encode_array(*labelled) for name, labelled in (coordinates | variables).items()}
    return everything, {"coordinates": loose} if loose else {}


def _encode_array(dims: tuple[str, ...], array: Array, attributes: dict[str, Any]) -> Labelled:
    """Return a labelled array in the form of a file."""
    kind = array.dtype.kind
    more = {"dtype": "bool"} if kind == "b" else {"_FillValue": array.dtype.type(np.nan)} if kind == "f" else {}
    return dims, array.astype("i1") if kind == "b" else array, attributes | more


def decode_samples(found: Mapping[str, Labelled], about: Mapping[str, Any]) -> Samples | None:
    """Return the samples that are written just as what was ``found``; ``None`` where only xarray can read it.

    Nothing is decoded but truth values: all other numbers and words are written as they are.
    """
    if not {"q", "time", "joint", "rollout", "status"} <= found.keys() or not _are_known(found):
        return None
    plain = {name: v.astype(bool) if _is_truth(name, v, more) else v for name, (_, v, more) in found.items()}
    joints = dict.fromkeys(plain["joint"].tolist(), found["q"][2]["units"])
    arrays, outcome = ({name: plain[name] for name in plain if name in known} for known in (VARIABLES, OUTCOMES))
    samples = Samples(plain["time"], joints, arrays, outcome, plain["rollout"])
    again, said = encode_run(samples)
    same = again.keys() == found.keys() and all(_is_same(one, found[name]) for name, one in again.items())
    return samples if same and _tell(said) == _tell(about) else None


def _are_known(found: Mapping[str, Labelled]) -> bool:
    """Return whether the arrays have the dimensions, sizes and kinds of values that those of a run have."""
    known = {name: dims for name, (dims, *_) in (VARIABLES | OUTCOMES).items()} | {axis: (axis,) for axis in _AXES}
    if not all(dims == known.get(name) and array.ndim == len(dims) for name, (dims, array, _) in found.items()):
        return False
    sizes = {axis: len(found[axis][1]) for axis in _AXES}
    sizes["path"] = len(found["path_status"][1]) if "path_status" in found else 0
    kinds = dict.fromkeys((*WORDS, "joint"), "U") | dict.fromkeys((*COUNTS, "rollout"), "iu")
    return (
        all(sizes[axis] for axis in _AXES)
        and isinstance(found["q"][2].get("units"), str)
        and all(array.dtype.kind in kinds.get(name, "bfiu") for name, (_, array, _) in found.items())
        and all(array.shape == tuple(sizes[dim] for dim in dims) for dims, array, _ in found.values())
    )


def _is_truth(name: str, array: Array, attributes: Mapping[str, Any]) -> bool:
    """Return whether the numbers of a variable stand for truth values."""
    return name in VARIABLES and array.dtype == np.int8 and str(attributes.get("dtype")) == "bool"


def _is_same(one: Labelled, other: Labelled) -> bool:
    """Return whether arrays are labelled and stored equally, whatever their values."""
    stored = [(dims, array.dtype, array.shape, _tell(attributes)) for dims, array, attributes in (one, other)]
    return stored[0] == stored[1] and other[1].dtype.isnative


def _tell(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Return attributes as texts, in which a NaN is like another one."""
    return {name: repr(np.ravel(value).tolist()) for name, value in attributes.items()}


def _list_coordinates(dims: Iterable[str], coordinates: Mapping[str, Labelled]) -> str:
    """Return the names of the coordinates of a variable over ``dims``, without the axes themselves."""
    return " ".join(sorted(name for name, (over, *_) in coordinates.items() if over != (name,) and {*over} <= {*dims}))


def _list_unused_coordinates(variables: Iterable[Labelled], coordinates: Mapping[str, Labelled]) -> str:
    """Return the names of the coordinates that belong to no variable."""
    seen = {name for dims, *_ in variables for name in _list_coordinates(dims, coordinates).split()}
    return " ".join(sorted(name for name, (over, *_) in coordinates.items() if over != (name,) and name not in seen))
