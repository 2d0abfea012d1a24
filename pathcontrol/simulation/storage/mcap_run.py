"""The MCAP file of a run: a message for each sample, and as attachments what the run knows beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._files import whole_file
from pathcontrol.errors import InputError, warn
from pathcontrol.simulation.context import StoredContext
from pathcontrol.simulation.samples import Labelled, Samples
from pathcontrol.simulation.storage.file_form import check_form
from pathcontrol.simulation.storage.mcap_messages import MessageFormat, Variable, read_loose, write_loose
from pathcontrol.simulation.storage.mcap_records import Content, load_mcap, read_content

if TYPE_CHECKING:
    import xarray as xr

_VERSION = 1
_HEAD, _ORIGIN, _NUMBERS, _END = "pathcontrol.json", "origin.json", "origin.f64", "outcome.json"
_AXES = ("rollout", "time", "joint")
_BLOCK = 1000  # samples that are put into words at once
_CHUNK = 1 << 20  # bytes


class McapRunWriter:
    """A stream of the samples of a run into an MCAP file.

    Args:
        stream: the file, opened for writing bytes.
        variables: the variables.
        axes: ``rollout`` and ``joint`` with their values, and attributes of ``time``.
        config: the configuration of the run.
        stored: its robot and task.
        begin: time of the first sample for viewers [ns].
        chunk: bytes that are compressed together.
    """

    def __init__(
        self,
        stream: IO[bytes],
        variables: Sequence[Variable],
        axes: Mapping[str, Any],
        config: Mapping[str, Any],
        stored: StoredContext,
        begin: int = 0,
        chunk: int = _CHUNK,
    ) -> None:
        self.format = MessageFormat(variables, axes["joint"])
        self._first: float | None = None
        self._begin, self._count = begin, 0
        self._file = load_mcap().Writer(stream, chunk_size=chunk, enable_data_crcs=True)
        self._file.start(library="pathcontrol")
        self._head = {"version": _VERSION, "variables": [one._asdict() for one in variables]} | dict(axes)
        self.attach_context(config, stored)
        schema = self._file.register_schema("pathcontrol.Sample", "jsonschema", self.format.schema())
        rollouts = axes["rollout"]
        topics = ["/arm"] if rollouts == [0] else [f"/arm/{number}" for number in rollouts]
        self._channels = [
            self._file.register_channel(topic, "json", schema, {"rollout": str(number)})
            for topic, number in zip(topics, rollouts, strict=True)
        ]

    def write(self, time: Array, arrays: Mapping[str, Array]) -> None:
        """Write samples at times [s], (k,), of variables (rollout, k, …)."""
        for at in range(0, len(time), _BLOCK):
            span = slice(at, at + _BLOCK)
            parts = [
                self.format.encode(time[span], {name: array[i, span] for name, array in arrays.items()})
                for i in range(len(self._channels))
            ]
            for t, messages in zip(time[span].tolist(), zip(*parts, strict=True), strict=True):
                self.add(t, messages)

    def add(self, time: float, messages: Sequence[bytes]) -> None:
        """Add a sample: a message for each rollout."""
        self._first = time if self._first is None else self._first
        stamp = self._begin + round((time - self._first) * 1e9)
        for channel, message in zip(self._channels, messages, strict=True):
            self._file.add_message(channel, stamp, message, stamp, self._count)
        self._count = (self._count + 1) & 0xFFFFFFFF

    def flush(self) -> None:
        """Hand everything to the operating system."""
        self._file.flush()

    def finish(self, loose: Mapping[str, Labelled], coordinates: Sequence[str] = ()) -> None:
        """Write what is not over time, with the names of what is a coordinate, and the end of the file."""
        said = {
            name: write_loose(np.asarray(array))
            | {"dims": list(dims), "attributes": dict(about), "coordinate": name in coordinates}
            for name, (dims, array, about) in loose.items()
        }
        self._attach(_END, "application/json", json.dumps(said).encode())
        self._file.finish()

    def attach_context(self, config: Mapping[str, Any], stored: StoredContext) -> None:
        """Write configuration, robot and task; those that were written before do not count any more."""
        head = self._head | {"config": config}
        self._attach(_HEAD, "application/json", json.dumps(head).encode())
        self._attach(_ORIGIN, "application/json", stored.text.encode())
        self._attach(_NUMBERS, "application/octet-stream", stored.numbers.astype("<f8").tobytes())

    def _attach(self, name: str, kind: str, data: bytes) -> None:
        """Add an attachment."""
        self._file.add_attachment(0, self._begin, name, kind, data)


def write_mcap(path: Path, data: xr.Dataset | Samples, config: Mapping[str, Any], stored: StoredContext) -> None:
    """Write a run, whole or not at all.

    Raises:
        MissingExtraError: the package ``mcap`` is not installed.
        StorageError: it cannot be written.
    """
    load_mcap()
    variables, coordinates = data.label_all() if isinstance(data, Samples) else _label(data)
    over_time = {name: one for name, one in variables.items() if one[0] in (_AXES[:2], _AXES)}
    loose = {name: one for name, one in variables.items() if name not in over_time}
    outcomes = {name: one for name, one in coordinates.items() if name not in _AXES}
    fields = [Variable(name, dims == _AXES, array.dtype.str, about) for name, (dims, array, about) in over_time.items()]
    time, arrays = coordinates["time"][1], {name: array for name, (_, array, _) in over_time.items()}
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        writer = McapRunWriter(stream, fields, _describe_axes(coordinates), config, stored)
        writer.write(time, arrays)
        writer.finish(loose | outcomes, list(outcomes))


def _describe_axes(coordinates: Mapping[str, Labelled]) -> dict[str, Any]:
    """Return the axes of a run as plain values."""
    return {
        "rollout": np.asarray(coordinates["rollout"][1]).tolist(),
        "joint": [str(name) for name in coordinates["joint"][1]],
        "axes": {name: dict(coordinates[name][2]) for name in _AXES},
    }


def _label(data: xr.Dataset) -> tuple[dict[str, Labelled], dict[str, Labelled]]:
    """Return variables and coordinates of a dataset, with their dimensions and attributes."""

    def of(name: Any) -> Labelled:
        return tuple(map(str, data[name].dims)), data[name].to_numpy(), dict(data[name].attrs)

    coordinates = {str(name): of(name) for name in data.coords}
    coordinates |= {name: of(name) for name in _AXES if name not in coordinates}
    return {str(name): of(name) for name in data.data_vars}, coordinates


def read_mcap(path: Path) -> tuple[xr.Dataset, dict[str, Any], StoredContext]:
    """Read data, configuration, and robot and path.

    A file without its end, as a killed process leaves it, is read as far as it goes, and a warning says so.

    Raises:
        InputError: it is damaged, or no run.
        MissingExtraError: the package ``mcap`` is not installed.
    """
    try:
        content = read_content(path.read_bytes())
        head = _read_head(content)
        data = _make_dataset(content, head)
        check_form(data, head["config"])
        numbers = np.frombuffer(content.attachments[_NUMBERS], dtype="<f8").astype(np.float64)
        stored = StoredContext(content.attachments[_ORIGIN].decode(), numbers)
    except ImportError:
        raise
    except Exception as error:  # a broken file may fail anywhere in the readers
        raise InputError(f"{str(path)!r} is not a run saved by Run.save: {error}", file=str(path)) from error
    if not content.whole:
        warn(
            f"{str(path)!r} has no end, as its writer was killed or still writes: it is read up to "
            f"{data['time'].to_numpy()[-1]:g} s, {data.sizes['time']} samples"
        )
    return data, head["config"], stored


def _read_head(content: Content) -> dict[str, Any]:
    """Return what the file says of its samples."""
    if _HEAD not in content.attachments:
        raise InputError("it is an MCAP file of something else; Run.from_log makes a run of arrays of times, q and τ")
    head = json.loads(content.attachments[_HEAD])
    if head["version"] != _VERSION:
        raise InputError(
            f"it has the version {head['version']!r}, this package reads {_VERSION}; update the package",
            value=head["version"],
            limit=_VERSION,
        )
    return dict(head)


def _make_dataset(content: Content, head: Mapping[str, Any]) -> xr.Dataset:
    """Return the data of a run."""
    import xarray as xr  # it takes a third of a second to load

    fields = [Variable(**one) for one in head["variables"]]
    time, arrays = _read_samples(content, MessageFormat(fields, head["joint"]), head["rollout"])
    about = head["axes"]
    coordinates: dict[str, Labelled] = {
        "rollout": (("rollout",), np.array(head["rollout"], dtype=np.intp), about["rollout"]),
        "time": (("time",), time, about["time"]),
        "joint": (("joint",), np.array(head["joint"], dtype=np.str_), about["joint"]),
    }
    dims = {one.name: _AXES if one.per_joint else _AXES[:2] for one in fields}
    variables = {one.name: (dims[one.name], arrays[one.name], dict(one.attributes)) for one in fields}
    for name, value in _read_end(content, len(head["rollout"])).items():
        labelled = tuple(value["dims"]), read_loose(value), value["attributes"]
        (coordinates if value["coordinate"] else variables)[name] = labelled
    return xr.Dataset(variables, coordinates)


def _read_end(content: Content, rollouts: int) -> dict[str, Any]:
    """Return what the file says at its end, of a file without it that all rollouts are running."""
    if _END in content.attachments:
        return dict(json.loads(content.attachments[_END]))
    running = write_loose(np.full(rollouts, "running")) | {"dims": ["rollout"], "attributes": {}, "coordinate": True}
    never = write_loose(np.full(rollouts, np.nan)) | {"dims": ["rollout"], "attributes": {}, "coordinate": True}
    return {"status": running, "finish_time": never}


def _read_samples(content: Content, form: MessageFormat, rollouts: Sequence[int]) -> tuple[Array, dict[str, Array]]:
    """Return times (k,), and variables (rollout, k, …); of a file without its end those that all rollouts have."""
    numbers = {about.get("rollout"): channel for channel, about in content.channels.items()}
    found = [form.decode(content.messages.get(numbers.get(str(number), -1), [])) for number in rollouts]
    count = min((len(time) for time, _ in found), default=0)
    if not count:
        raise InputError("it holds no sample")
    whole = all(len(time) == count and (time == found[0][0]).all() for time, _ in found)
    if content.whole and not whole:
        raise InputError("its rollouts have other times each")
    names = [one.name for one in form.variables]
    return found[0][0][:count], {name: np.stack([arrays[name][:count] for _, arrays in found]) for name in names}
