"""The manifest of a sweep: its definition, and its files with the SHA-256 of each.

The manifest is one JSON file, which is written whole. While a sweep goes on, the files of each chunk are noted by one
more line of ``files.log`` beside it, so that a chunk costs the same however many there are; the lines go into the
manifest at the end, or when the sweep is next opened for writing. A file that is not noted does not count.
"""

from __future__ import annotations

import hashlib
import json
import platform
import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pathcontrol._files import append_line, write_whole
from pathcontrol._interrupts import delay_interrupt
from pathcontrol.errors import InputError
from pathcontrol.sweeps.space import MOST_SAMPLES

FORMAT, FORMAT_VERSION = "pathcontrol sweep", 1
MANIFEST, LOG = "manifest.json", "files.log"
PACKAGES = ("pathcontrol", "pin", "numpy", "scipy")
_PLACE = re.compile(r"chunks/[0-9]+-[0-9]+\.parquet|runs/[0-9]+\.nc")
_SHA256 = re.compile(r"[0-9a-f]{64}")
_MOST_BYTES = 1 << 28
_TOLD = 3  # damaged lines of the log that a message names
_DAMAGED = "it is damaged; take another copy of it, or begin the sweep anew in another folder"


class Manifest:
    """The manifest of the sweep in a folder.

    Args:
        folder: the folder of the sweep.
        mending: whether lines of the log that are damaged are left out, as what they note can be made again.

    Attributes:
        samples: number of samples of the sweep.
        definition: everything that its numbers depend on.
        versions: versions of the packages that took part, one table after another.
        files: the SHA-256 of each file by its place in the folder; ``None`` where it is not known, as the sweep was
            begun by an earlier version.
        listed: whether the sweep has noted its files from the beginning.
        broken: which lines of the log are not what was written, and why; empty if none.

    Raises:
        InputError: there is none, or it is damaged.
    """

    def __init__(self, folder: Path, mending: bool = False) -> None:
        self.folder = folder
        log, self.broken = _read_log(folder / LOG)  # first: while it is read, it may get into the manifest
        if self.broken and not mending:
            raise InputError(
                f"{str(folder / LOG)!r} is damaged: {self.broken}; resume the sweep to mend it", file=str(folder / LOG)
            )
        content = _read(folder)
        self.samples: int = content["samples"]
        self.definition: dict[str, Any] = content["definition"]
        self.versions: list[dict[str, str]] = content["versions"]
        self.listed = "files" in content
        self.files: dict[str, str | None] = dict(content["files"]) if self.listed else _find_files(folder)
        for line in log:
            self._take(line)

    @classmethod
    def begin(cls, folder: Path, samples: int, definition: Mapping[str, Any]) -> Manifest:
        """Write the manifest of a new sweep."""
        _write(folder, samples, definition, [versions()], {})
        return cls(folder)

    def note(self, files: Mapping[str, str | None]) -> None:
        """Note files by their SHA-256, or by ``None`` for those to be removed, all of them or none."""
        content = {"files": dict(files)}
        line = json.dumps(content | {"sha256": _digest(content)}, sort_keys=True)
        with delay_interrupt():
            append_line(self.folder / LOG, line)
            self._take(files)

    def settle(self) -> None:
        """Write the manifest with all files noted since."""
        _write(self.folder, self.samples, self.definition, self.versions, self.files)
        (self.folder / LOG).unlink(missing_ok=True)

    def resume(self, samples: int, definition: Mapping[str, Any]) -> None:
        """Check number of samples and definition of the sweep, and note the versions with which it goes on.

        Raises:
            InputError: it has another definition; the message names what differs.
        """
        then, now = {"samples": self.samples} | self.definition, {"samples": samples, **definition}
        if differing := list(_differences(then, now)):
            raise InputError(
                f"the sweep in {str(self.folder)!r} has another definition: {'; '.join(differing[:5])}; "
                "give what it was begun with, or name another folder",
                file=str(self.folder),
            )
        if self.versions[-1] != versions():
            self.versions.append(versions())

    def remove(self) -> None:
        """Remove the manifest and its log."""
        for name in (MANIFEST, LOG):
            (self.folder / name).unlink(missing_ok=True)

    def _take(self, files: Mapping[str, str | None]) -> None:
        """Take noted files into the table."""
        for place, digest in files.items():
            self.files.pop(place, None)
            if digest is not None:
                self.files[place] = digest


def versions() -> dict[str, str]:
    """Return the versions of the packages that compute the numbers."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """Return the versions of the packages that compute the numbers; reading them takes milliseconds."""
    return {"python": platform.python_version()} | {name: version(name) for name in PACKAGES}


def _find_files(folder: Path) -> dict[str, str | None]:
    """Return the files of a sweep that was begun by an earlier version."""
    found = sorted([*folder.glob("chunks/*.parquet"), *folder.glob("runs/*.nc")])
    places = (file.relative_to(folder).as_posix() for file in found)
    return {place: None for place in places if _PLACE.fullmatch(place)}


def _write(folder: Path, samples: int, definition: Any, which: list[Any], files: Mapping[str, str | None]) -> None:
    """Write the manifest with its checksum."""
    known = {place: digest for place, digest in sorted(files.items()) if digest is not None}
    content = {"format": FORMAT, "format_version": FORMAT_VERSION, "samples": samples, "definition": definition}
    content |= {"versions": which, "files": known}
    content["sha256"] = _digest(content)
    write_whole(folder / MANIFEST, (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode())


def _digest(content: Mapping[str, Any]) -> str:
    """Return the checksum of a manifest, in a canonical form, without versions, which no number depends on."""
    counted = {name: value for name, value in content.items() if name not in ("versions", "sha256")}
    return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()


def _read(folder: Path) -> dict[str, Any]:
    """Read the manifest and check its form."""
    path = folder / MANIFEST
    if not path.is_file():
        raise InputError(f"there is no sweep in {str(folder)!r}: it has no {MANIFEST}", file=str(folder))
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ValueError(f"it has {path.stat().st_size} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{str(path)!r} cannot be read: {error}; {_DAMAGED}", file=str(path)) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{str(path)!r} is not that of a sweep", file=str(path))
    if content.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"the sweep in {str(folder)!r} has the format version {content.get('format_version')}, expected "
            f"{FORMAT_VERSION}; read it with the version of pathcontrol that wrote it",
            value=content.get("format_version"),
            limit=FORMAT_VERSION,
            file=str(folder),
        )
    if wrong := next(_find_faults(content), None):
        raise InputError(f"{str(path)!r} cannot be used: {wrong}; {_DAMAGED}", file=str(path))
    return content


def _find_faults(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with the content of a manifest."""
    samples, definition, which = (content.get(name) for name in ("samples", "definition", "versions"))
    if isinstance(samples, bool) or not isinstance(samples, int) or not 1 <= samples <= MOST_SAMPLES:
        yield f"samples = {samples!r:.80}, expected a whole number from 1 to {MOST_SAMPLES}"
    if not isinstance(definition, dict) or not isinstance(definition.get("space"), dict):
        yield "it has no definition with a space"
    elif not isinstance(definition["space"].get("parameters"), dict) or not isinstance(
        definition.get("keep", {}), dict
    ):
        yield "its definition has no parameters, or what it keeps is no table"
    if not isinstance(which, list) or not which or not all(isinstance(one, dict) for one in which):
        yield "it has no versions"
    if "files" in content or "sha256" in content:  # an earlier version wrote neither
        yield from _find_file_faults(content.get("files"))
        if content.get("sha256") != _digest(content):
            yield "its checksum is another one"


def _find_file_faults(files: Any, may_go: bool = False) -> Iterator[str]:
    """Yield what is wrong with a table of files."""
    if not isinstance(files, dict):
        yield f"files = {files!r:.80}, expected a table"
        return
    for place, digest in files.items():
        if not _PLACE.fullmatch(place):
            yield f"files has {place!r:.80}, expected chunks and runs"
        goes = may_go and digest is None and place.startswith("runs")  # a chunk stays
        if not goes and not (isinstance(digest, str) and _SHA256.fullmatch(digest)):
            yield f"{place} has {digest!r:.80}, expected a SHA-256"


def _read_log(path: Path) -> tuple[list[dict[str, str | None]], str]:
    """Return the lines of the log; a last one without an end was being written when the process was killed.

    The last one without an end was being written when the process was killed.
    """
    try:
        text = path.read_bytes() if path.is_file() else b""
    except OSError as error:
        raise InputError(f"{str(path)!r} cannot be read: {error}", file=str(path)) from error
    noted, broken = [], []
    for number, line in enumerate(text.split(b"\n")[:-1], 1):
        try:
            content = json.loads(line)
            if wrong := next(_find_line_faults(content), None):
                raise ValueError(wrong)
            noted.append(content["files"])
        except (ValueError, RecursionError) as error:
            broken.append(f"line {number}: {error}")
    more = f" and {len(broken) - _TOLD} lines more" if len(broken) > _TOLD else ""
    return noted, "; ".join(broken[:_TOLD]) + more


def _find_line_faults(content: Any) -> Iterator[str]:
    """Yield what is wrong with a line of the log."""
    if not isinstance(content, dict) or content.keys() != {"files", "sha256"}:
        yield "expected files and their checksum"
        return
    yield from _find_file_faults(content["files"], may_go=True)
    if content["sha256"] != _digest(content):
        yield "its checksum is another one"


def _differences(then: Any, now: Any, key: str = "") -> Iterator[str]:
    """Yield where two definitions differ, each as ``key: then …, now …``."""
    if isinstance(then, dict) and isinstance(now, Mapping):
        for name in dict.fromkeys((*then, *now)):
            yield from _differences(then.get(name), now.get(name), f"{key}.{name}" if key else name)
    elif then != now:
        yield f"{key} was {_shorten(then)}, is now {_shorten(now)}"


def _shorten(value: Any) -> str:
    """Return a value as JSON, shortened."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}…"
