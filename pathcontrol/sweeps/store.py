"""The folder of a sweep: a manifest, one Parquet file a chunk, and the runs that are kept.

Every file appears whole or not at all, in this order: the manifest, the histories of a chunk, its table. What a killed
process leaves behind is a chunk that is there or is not, and histories that the next look at the folder removes.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._files import whole_file
from pathcontrol.errors import InputError, MissingExtraError
from pathcontrol.sweeps.compute import Chunk
from pathcontrol.sweeps.keep import Keep

FORMAT, FORMAT_VERSION = "pathcontrol sweep", 1
MANIFEST = "manifest.json"
_HEX = "[0-9a-f]" * 8
_UNFINISHED = (f".manifest-{_HEX}.json", f"chunks/.*-{_HEX}.parquet", f"runs/.*-{_HEX}.nc")  # as whole_file has them
PACKAGES = ("pathcontrol", "pin", "numpy", "scipy")


def parquet() -> ModuleType:
    """The module that reads and writes Parquet.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError("pyarrow", "sweep", "the table of a sweep") from error
    return pyarrow.parquet


class Store:
    """What is on disk of a sweep.

    Args:
        folder: where it is; its manifest is there.

    Raises:
        InputError: there is no sweep.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.manifest = _read_manifest(self.folder)
        self.samples = int(self.manifest["samples"])
        self._parquet = parquet()
        self._known: dict[tuple[Path, tuple[str, ...]], dict[str, Array]] = {}

    @classmethod
    def begin(cls, folder: str | Path, samples: int, definition: Mapping[str, Any]) -> Store:
        """Make the folder of a new sweep.

        Raises:
            InputError: something is there that would get mixed up with it.
        """
        folder = Path(folder)
        parquet()
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{str(folder)!r} is a file, expected a folder for the sweep; name another")
        if (folder / MANIFEST).exists():
            raise InputError(f"{str(folder)!r} holds a sweep already; resume it, or name another folder")
        if any(folder.glob("chunks/*.parquet")):
            raise InputError(f"{str(folder)!r} holds the chunks of a sweep without its {MANIFEST}; name another folder")
        for name in ("chunks", "runs"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        head = {"format": FORMAT, "format_version": FORMAT_VERSION, "samples": samples}
        _write_json(folder / MANIFEST, head | {"definition": definition, "versions": [versions()]})
        return cls(folder)

    def resume(self, definition: Mapping[str, Any]) -> None:
        """See that the sweep on disk is this one, and note with which versions it goes on.

        Raises:
            InputError: it has another definition; the message names what differs.
        """
        differing = list(_differences(self.manifest["definition"], definition))
        if differing:
            raise InputError(
                f"the sweep in {str(self.folder)!r} has another definition: {'; '.join(differing[:5])}; "
                "give what it was begun with, or name another folder"
            )
        if self.manifest["versions"][-1] != versions():
            self.manifest["versions"].append(versions())
            _write_json(self.folder / MANIFEST, self.manifest)

    def free_if_empty(self) -> None:
        """Leave no folder behind that holds no number: another sweep may be begun there."""
        if self._files():
            return
        (self.folder / MANIFEST).unlink(missing_ok=True)
        with suppress(OSError):  # something else is there
            for folder in (self.folder / "chunks", self.folder / "runs", self.folder):
                folder.rmdir()

    def missing(self, chunk: int) -> list[NDArray[np.int64]]:
        """The samples that have no numbers yet, at most ``chunk`` neighbours together."""
        done = np.zeros(self.samples, dtype=bool)
        for file in self._files():
            done[self._read(file, ["sample"])["sample"]] = True
        lost = np.flatnonzero(~done)
        stretches = np.split(lost, np.flatnonzero(np.diff(lost) != 1) + 1)
        return [s[i : i + chunk].astype(np.int64) for s in stretches for i in range(0, len(s), chunk)]

    def write(self, chunk: Chunk, keep: Keep, at_random: NDArray[np.intp]) -> None:
        """Add a chunk: first the histories that are to be kept so far, then its table, with which it is there."""
        import pyarrow as pa

        chosen = self._chosen(keep, at_random, chunk.columns) if chunk.runs else set()
        for number, run in chunk.runs.items():
            if number in chosen:
                run.save(self.run_file(number))
        sample = chunk.columns["sample"]
        table = pa.table({name: _column(values) for name, values in chunk.columns.items()})
        with whole_file(self.folder / "chunks" / f"{sample[0]:09d}-{sample[-1]:09d}.parquet") as temporary:
            self._parquet.write_table(table, temporary)
        if chosen:
            self._remove_others(chosen)

    def columns(self, names: list[str] | None = None) -> dict[str, Array]:
        """The finished samples in order, their numbers and texts, (k,) or (k, d) each; NaN or "" where one has none."""
        return _joined([self._read(file, names) for file in self._files()])

    def tidy(self, keep: Keep, at_random: NDArray[np.intp]) -> None:
        """Remove the histories that need not be kept, and what a killed process left behind."""
        for place in _UNFINISHED:
            for left in self.folder.glob(place):
                left.unlink()
        self._remove_others(self._chosen(keep, at_random))

    def _chosen(self, keep: Keep, at_random: NDArray[np.intp], more: Mapping[str, Array] | None = None) -> set[int]:
        """The samples whose history is to be kept, of those that are there and ``more``."""
        if not (keep.worst or keep.diverged):
            return set(at_random.tolist())
        names = ["sample", "status"] + ([keep.by] if keep.worst else [])
        chunks = [self._remembered(file, names) for file in self._files()]
        found = _joined(chunks + ([] if more is None else [{name: more[name] for name in names}]))
        count = len(found["sample"])
        diverged = found["status"] == "diverged" if count else np.zeros(0, dtype=bool)
        by = found.get(keep.by, np.full(count, np.nan))
        return set(at_random.tolist()) | keep.chosen(found["sample"], by, diverged)

    def _remembered(self, file: Path, names: list[str]) -> dict[str, Array]:
        key = (file, tuple(names))
        if key not in self._known:
            self._known[key] = self._read(file, names)
        return self._known[key]

    def _remove_others(self, chosen: set[int]) -> None:
        for sample in self.kept():
            if sample not in chosen:
                self.run_file(sample).unlink()

    def kept(self) -> list[int]:
        """The samples whose history is there."""
        return sorted(int(file.stem) for file in self.folder.glob("runs/*.nc") if file.stem.isdecimal())

    def run_file(self, sample: int) -> Path:
        """Where the history of a sample is, or would be."""
        return self.folder / "runs" / f"{sample:09d}.nc"

    def _files(self) -> list[Path]:
        return sorted(file for file in self.folder.glob("chunks/*.parquet") if not file.name.startswith("."))

    def _read(self, file: Path, names: list[str] | None) -> dict[str, Array]:
        import pyarrow as pa

        try:
            with self._parquet.ParquetFile(file) as opened:
                there = opened.schema_arrow.names
                table = opened.read(columns=None if names is None else [name for name in names if name in there])
        except (OSError, pa.ArrowInvalid) as error:
            raise InputError(f"{str(file)!r} cannot be read: {error}; remove it and resume the sweep") from error
        return {name: _values(table.column(name)) for name in table.column_names}


def _joined(chunks: list[dict[str, Array]]) -> dict[str, Array]:
    """The rows of all chunks in the order of their samples."""
    if not chunks:
        return {"sample": np.empty(0, dtype=np.int64)}
    every = dict.fromkeys(name for chunk in chunks for name in chunk)
    found = {name: np.concatenate([_filled(chunk, name, chunks) for chunk in chunks]) for name in every}
    _, order = np.unique(found["sample"], return_index=True)
    return {name: values[order] for name, values in found.items()}


def versions() -> dict[str, str]:
    """What computes the numbers."""
    return {"python": platform.python_version()} | {name: version(name) for name in PACKAGES}


def _column(values: Array) -> Any:
    import pyarrow as pa

    if values.ndim == 1:
        return pa.array(values.tolist() if values.dtype.kind in "UO" else values)
    flat = values.reshape(-1)
    return pa.FixedSizeListArray.from_arrays(
        pa.array(flat.tolist() if flat.dtype.kind in "UO" else flat), values.shape[1]
    )


def _values(column: Any) -> Array:
    import pyarrow as pa

    combined = column.combine_chunks()
    if isinstance(combined, pa.ChunkedArray):
        combined = pa.concat_arrays(combined.chunks)
    if pa.types.is_fixed_size_list(combined.type):
        return _values(pa.chunked_array([combined.flatten()])).reshape(-1, combined.type.list_size)
    values = combined.to_numpy(zero_copy_only=False)
    return values.astype(str) if values.dtype == object else values


def _filled(chunk: Mapping[str, Array], name: str, chunks: list[dict[str, Array]]) -> Array:
    """A column of a chunk; where another chunk alone has it, as many without a value."""
    if name in chunk:
        return chunk[name]
    like = next(other[name] for other in chunks if name in other)
    return np.full((len(chunk["sample"]), *like.shape[1:]), "" if like.dtype.kind == "U" else np.nan)


def _read_manifest(folder: Path) -> dict[str, Any]:
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"there is no sweep in {str(folder)!r}: it has no {MANIFEST}") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{str(folder / MANIFEST)!r} cannot be read: {error}") from error
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{str(folder / MANIFEST)!r} is not that of a sweep")
    if manifest.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"the sweep in {str(folder)!r} has the format version {manifest.get('format_version')}, expected "
            f"{FORMAT_VERSION}; read it with the version of pathcontrol that wrote it"
        )
    return manifest


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _differences(then: Any, now: Any, key: str = "") -> Iterator[str]:
    """Where two definitions differ, each as ``key: then …, now …``."""
    if isinstance(then, dict) and isinstance(now, Mapping):
        for name in dict.fromkeys((*then, *now)):
            yield from _differences(then.get(name), now.get(name), f"{key}.{name}" if key else name)
    elif then != now:
        yield f"{key} was {_short(then)}, is now {_short(now)}"


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}…"
