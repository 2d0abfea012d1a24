"""Checks of file names: a suffix of another format is refused, with the call that writes that format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pathcontrol._files import as_path
from pathcontrol.errors import InputError

PAGE = "record(run).save(path) writes an animation, report(run, path) a report"
FIGURE = "save_figure(error_figure(run), path) writes a figure"
TABLE = "run.data.to_dataframe() is a table, whose to_csv, to_excel and so on write it"
VIDEO = "save_video(record(run), 'name.mp4') writes a video"

#: what writes the formats that people ask for
_WRITERS = {
    ".nc": "run.save(path) writes netCDF",
    ".mcap": "run.save(path) writes MCAP",
    **dict.fromkeys((".html", ".htm"), PAGE),
    **dict.fromkeys((".svg", ".png", ".pdf"), FIGURE),
    **dict.fromkeys((".jpg", ".jpeg", ".gif", ".webp", ".tif", ".tiff", ".bmp", ".eps", ".ps"), FIGURE),
    **dict.fromkeys((".mp4", ".webm", ".mov", ".avi", ".mkv", ".m4v", ".mpg", ".mpeg"), VIDEO),
    **dict.fromkeys((".csv", ".tsv", ".txt", ".xlsx", ".xls", ".ods", ".parquet", ".feather", ".json"), TABLE),
    **dict.fromkeys((".npz", ".npy", ".mat", ".pkl", ".pickle", ".h5", ".hdf5", ".zarr"), TABLE),
}


def check_suffix(path: str | Path, what: str, *suffixes: str, name: str = "path") -> Path:
    """Return ``path``, the argument ``name``, if it ends with one of ``suffixes``.

    Raises:
        InputError: it ends otherwise; the message names the call that writes such a file, where there is one.
    """
    path = as_path(name, path)
    if path.suffix.lower() in suffixes:
        return path
    raise InputError(
        f"{str(path)!r}: {what} is written, expected a name that ends with {' or '.join(suffixes)}"
        f"{_instead(path, suffixes)}",
        argument=name,
        value=str(path),
        file=str(path),
    )


def refuse_suffix(path: str | Path, what: str, *allowed: str, name: str = "path") -> Path:
    """Return ``path``, the argument ``name``, unless its suffix is of a known format not among those ``allowed``.

    Raises:
        InputError: it does; the message names the call that writes such a file.
    """
    path = as_path(name, path)
    if path.suffix.lower() not in _WRITERS or path.suffix.lower() in allowed:
        return path
    other = f", or with {', '.join(allowed[:-1])} or {allowed[-1]}" if allowed else ""
    raise InputError(
        f"{str(path)!r}: {what} is written, expected a name without {path.suffix}{other}{_instead(path, allowed)}",
        argument=name,
        value=str(path),
        file=str(path),
    )


def _instead(path: Path, suffixes: Sequence[str]) -> str:
    """Return the advice to call what writes the format of ``path``, unless it is what writes ``suffixes``."""
    writer = _WRITERS.get(path.suffix.lower())
    return "" if writer is None or writer in map(_WRITERS.get, suffixes) else f"; {writer}"
