"""The folder of a sweep: a manifest, one Parquet file for each chunk, and the kept runs.

Every file appears whole or not at all, in this order: the histories of a chunk, its table, and their place in the
manifest, with which they count. What a killed process leaves behind is a chunk that is there or is not, and files that
the next process which writes to the folder removes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._files import as_path, write_whole, writing
from pathcontrol.errors import InputError, warn
from pathcontrol.sweeps.chunk import Chunk
from pathcontrol.sweeps.histories import Keep
from pathcontrol.sweeps.manifest import LOG, MANIFEST, Manifest
from pathcontrol.sweeps.parquet import decode_table, encode_table, join_tables, load_parquet

_HEX = "[0-9a-f]" * 8
_UNFINISHED = (f".manifest-{_HEX}.json", f"chunks/.*-{_HEX}.parquet", f"runs/.*-{_HEX}.nc")  # as whole_file has them
_RESUME = "resume the sweep to make it again"
_LISTED = 5  # damaged files that a message names


class Store:
    """The files of a sweep on disk.

    Args:
        folder: the folder of the sweep, with its manifest.
        mending: whether it is opened to be made whole, so that damaged files are no error.

    Attributes:
        folder: as given.
        manifest: the manifest of the sweep.
        samples: number of its samples.

    Raises:
        InputError: there is no sweep, its manifest is damaged, or unless it is mended, a chunk is.
    """

    def __init__(self, folder: str | Path, mending: bool = False) -> None:
        self.folder = as_path("folder", folder)
        self.manifest = Manifest(self.folder, mending)
        self.samples = self.manifest.samples
        load_parquet()  # or tell now that it is missing
        self._known: dict[tuple[str, tuple[str, ...]], dict[str, Array]] = {}
        if not mending:
            self._check()

    @classmethod
    def begin(cls, folder: str | Path, samples: int, definition: Mapping[str, Any]) -> Store:
        """Make the folder of a new sweep.

        Raises:
            InputError: something is there that would get mixed up with it.
        """
        folder = as_path("folder", folder)
        if (folder / MANIFEST).exists():
            raise InputError(
                f"{str(folder)!r} holds a sweep already; resume it (resume=True), or name another folder",
                file=str(folder),
            )
        if any(folder.glob("chunks/*.parquet")):
            raise InputError(
                f"{str(folder)!r} holds the chunks of a sweep without its {MANIFEST}; name another folder",
                file=str(folder),
            )
        try:
            with writing(folder):
                for name in ("chunks", "runs"):
                    (folder / name).mkdir(parents=True, exist_ok=True)
            Manifest.begin(folder, samples, definition)
        except BaseException:  # as on a full disk
            _remove_empty(folder)
            raise
        return cls(folder)

    @classmethod
    def resume(cls, folder: str | Path, samples: int, definition: Mapping[str, Any]) -> Store:
        """Open the sweep on disk to continue it; warn of damaged or missing files, and forget them.

        Raises:
            InputError: it has another definition; the message names what differs.
        """
        store = cls(folder, mending=True)
        store.manifest.resume(samples, definition)
        store._forget_damaged()
        store.manifest.settle()
        return store

    def settle(self) -> None:
        """Have the manifest note all files; remove a folder without any numbers, so that another sweep may begin."""
        if self._chunks():
            self.manifest.settle()
            return
        self.manifest.remove()
        _remove_empty(self.folder)

    def _check(self) -> None:
        """Warn if there are no checksums, and refuse damaged chunks."""
        if not self.manifest.listed:
            warn(
                f"the sweep in {str(self.folder)!r} has no checksums, as it was begun by an earlier version: damage "
                "would not be noticed; resume it to give it some"
            )
        if bad := self._find_damaged("chunks"):
            raise InputError(
                f"the sweep in {str(self.folder)!r} is damaged: {_describe_files(bad)}; {_RESUME}",
                file=str(self.folder),
            )

    def _find_damaged(self, kind: str) -> dict[str, str]:
        """Return what is wrong with the noted files of a kind that are damaged, by their place."""
        found = {}
        for place in self._places(kind):
            try:
                self._content(place)
            except InputError as error:
                found[place] = str(error)
        return found

    def _content(self, place: str) -> bytes:
        """Return the bytes of a noted file.

        Raises:
            InputError: it is missing, or damaged.
        """
        try:
            content = (self.folder / place).read_bytes()
        except FileNotFoundError as error:
            raise InputError("missing") from error
        except OSError as error:
            raise InputError(f"cannot be read: {error}") from error
        known = self.manifest.files[place]
        if known is not None and hashlib.sha256(content).hexdigest() != known:
            raise InputError("damaged")
        return content

    def _forget_damaged(self) -> None:
        """Forget damaged and missing files, and the chunks of such histories, so that they are computed again."""
        self._adopt()
        bad = self._find_damaged("chunks") | self._find_damaged("runs")
        gone = set(bad)
        if self.manifest.broken:
            bad = {LOG: self.manifest.broken} | bad
        for place in self._places("chunks"):
            if place in bad or any(_sample(run) in _samples(place) for run in bad if run.startswith("runs")):
                gone.add(place)
        for place in gone:
            self.manifest.files.pop(place, None)
        if bad:
            warn(f"the sweep in {str(self.folder)!r} is damaged, and is made again there: {_describe_files(bad)}")

    def _adopt(self) -> None:
        """Give checksums to the readable files of a sweep of an earlier version, which has none."""
        if self.manifest.listed:
            return
        warn(
            f"the sweep in {str(self.folder)!r} has no checksums, as it was begun by an earlier version: its "
            f"{len(self.manifest.files)} files are taken as they are"
        )
        for place in list(self.manifest.files):
            with suppress(InputError):
                if place.startswith("chunks"):
                    self._read(place, ["sample"])
                self.manifest.files[place] = hashlib.sha256(self._content(place)).hexdigest()
                continue
            del self.manifest.files[place]
        self.manifest.listed = True

    def missing(self, chunk: int) -> list[NDArray[np.int64]]:
        """Return the samples without numbers, at most ``chunk`` consecutive ones together."""
        done = np.zeros(self.samples, dtype=bool)
        for place in self._chunks():
            done[self._read(place, ["sample"])["sample"]] = True
        lost = np.flatnonzero(~done)
        stretches = np.split(lost, np.flatnonzero(np.diff(lost) != 1) + 1)
        return [s[i : i + chunk].astype(np.int64) for s in stretches for i in range(0, len(s), chunk)]

    def write(self, chunk: Chunk, keep: Keep, at_random: NDArray[np.intp]) -> None:
        """Add a chunk: the histories to be kept so far, its table, and their checksums, with which it counts.

        Raises:
            StorageError: the disk is full, or does not take them; nothing of the chunk is left then.
        """
        chosen = self._choose_histories(keep, at_random, chunk.columns) if chunk.runs else set()
        notes: dict[str, str | None] = {}
        try:
            for number, run in chunk.runs.items():
                if number in chosen:
                    notes[_run_place(number)] = _file_digest(run.save(self.run_file(number)))
            notes |= self._write_table(chunk.columns)
            if chosen:
                notes |= {_run_place(other): None for other in self.kept() if other not in chosen}
            self.manifest.note(notes)
        except BaseException:
            self._remove(place for place in notes if place not in self.manifest.files)  # they have not been noted
            raise
        self._remove(place for place, digest in notes.items() if digest is None)

    def _write_table(self, columns: Mapping[str, Array]) -> dict[str, str]:
        """Write the table of a chunk, and return its checksum by its place."""
        sample, content = columns["sample"], encode_table(columns)
        place = f"chunks/{sample[0]:09d}-{sample[-1]:09d}.parquet"
        write_whole(self.folder / place, content)
        return {place: hashlib.sha256(content).hexdigest()}

    def columns(self, names: list[str] | None = None) -> dict[str, Array]:
        """Return the columns of the finished samples in order, (k,) or (k, d) each; NaN or "" without a value."""
        return join_tables([self._read(place, names) for place in self._chunks()])

    def tidy(self, keep: Keep, at_random: NDArray[np.intp]) -> None:
        """Remove histories that need not be kept, and the remains of a killed process.

        Chunks of a complete sweep that lack a history to be kept are warned of, and forgotten to be made again.
        """
        for unfinished in _UNFINISHED:
            for left in self.folder.glob(unfinished):
                left.unlink()
        chosen = self._choose_histories(keep, at_random)
        if not self.missing(self.samples):  # else another sample may be chosen instead
            self._forget_without(chosen)
        if needless := [_run_place(other) for other in self.kept() if other not in chosen]:
            self.manifest.note(dict.fromkeys(needless))
        there = [*self.folder.glob("chunks/*.parquet"), *self.folder.glob("runs/*.nc")]
        places = (file.relative_to(self.folder).as_posix() for file in there)
        self._remove(place for place in places if place not in self.manifest.files)

    def _forget_without(self, chosen: set[int]) -> None:
        """Forget chunks whose table is there without the histories that were ``chosen`` from it."""
        lost = chosen.difference(self.kept())
        gone = [place for place in self._chunks() if not lost.isdisjoint(_samples(place))]
        for place in gone:
            del self.manifest.files[place]
        if gone:
            warn(
                f"the sweep in {str(self.folder)!r} lacks histories, which are made again: {', '.join(gone[:_LISTED])}"
            )

    def _remove(self, places: Iterable[str]) -> None:
        """Remove files."""
        for place in places:
            (self.folder / place).unlink(missing_ok=True)

    def _choose_histories(
        self, keep: Keep, at_random: NDArray[np.intp], more: Mapping[str, Array] | None = None
    ) -> set[int]:
        """Return the samples whose history is to be kept, among those on disk and ``more``."""
        if not (keep.worst or keep.diverged):
            return set(at_random.tolist())
        names = ["sample", "status"] + ([keep.by] if keep.worst else [])
        chunks = [self._read_once(place, names) for place in self._chunks()]
        found = join_tables(chunks + ([] if more is None else [{name: more[name] for name in names}]))
        count = len(found["sample"])
        diverged = found["status"] == "diverged" if count else np.zeros(0, dtype=bool)
        by = found.get(keep.by, np.full(count, np.nan))
        if by.ndim != 1 or by.dtype.kind not in "biuf":
            raise InputError(
                f"{keep.by}, by which histories are kept, is {by.dtype}, expected numbers",
                argument="keep.by",
                value=keep.by,
            )
        return set(at_random.tolist()) | keep.chosen(found["sample"], by, diverged)

    def _read_once(self, place: str, names: list[str]) -> dict[str, Array]:
        """Return columns of a chunk, read only once."""
        key = (place, tuple(names))
        if key not in self._known:
            self._known[key] = self._read(place, names)
        return self._known[key]

    def kept(self) -> list[int]:
        """Return the samples whose history is kept."""
        return sorted(_sample(place) for place in self._places("runs"))

    def run_file(self, sample: int) -> Path:
        """Return the file of the history of a sample, which need not exist."""
        return self.folder / _run_place(sample)

    def check_run(self, sample: int) -> None:
        """Check that the history of a sample is what was written.

        Raises:
            InputError: it is missing or damaged.
        """
        try:
            self._content(_run_place(sample))
        except InputError as error:
            raise InputError(
                f"{str(self.run_file(sample))!r}: {error}; {_RESUME}", file=str(self.run_file(sample))
            ) from error

    def _chunks(self) -> list[str]:
        """Return the noted chunks, in order."""
        return self._places("chunks")

    def _places(self, kind: str) -> list[str]:
        """Return the noted files of a kind, in order."""
        return sorted(place for place in self.manifest.files if place.startswith(kind))

    def _read(self, place: str, names: list[str] | None) -> dict[str, Array]:
        """Read columns of a chunk and check them."""
        try:
            columns = decode_table(self._content(place), names, len(_samples(place)))
            _check_samples(columns.get("sample"), self.samples)
        except InputError as error:
            raise InputError(
                f"{str(self.folder / place)!r} cannot be read: {error}; {_RESUME}", file=str(self.folder / place)
            ) from error
        return columns


def _remove_empty(folder: Path) -> None:
    """Remove the folder of a sweep without files, unless something else is there."""
    with suppress(OSError):
        for one in (folder / "chunks", folder / "runs", folder):
            one.rmdir()


def _check_samples(sample: Array | None, samples: int) -> None:
    """Check that a chunk has samples of its sweep."""
    if sample is None or sample.ndim != 1 or sample.dtype.kind not in "iu" or not sample.size:
        raise InputError("it has no numbers of samples")
    if sample.min() < 0 or sample.max() >= samples:
        raise InputError(
            f"it has samples {sample.min()} to {sample.max()}, of a sweep of {samples}",
            value=(int(sample.min()), int(sample.max())),
            limit=(0, samples - 1),
        )


def _file_digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _run_place(sample: int) -> str:
    """Return the place of the history of a sample."""
    return f"runs/{sample:09d}.nc"


def _sample(place: str) -> int:
    """Return the sample of a history."""
    return int(Path(place).stem)


def _samples(place: str) -> range:
    """Return the samples of a chunk."""
    first, last = map(int, Path(place).stem.split("-"))
    return range(first, last + 1)


def _describe_files(bad: Mapping[str, str]) -> str:
    """Return the damaged files in words."""
    listed = [f"{place} ({what})" for place, what in list(bad.items())[:_LISTED]]
    more = len(bad) - len(listed)
    return ", ".join(listed) + (f" and {more} more" if more else "")
