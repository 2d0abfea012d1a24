"""Files inside a page, behind links."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._json import to_json
from pathcontrol.simulation.run import Run

_MOST_ROWS = 501
_LONGEST = 100  # letters of the name of a file
_SIGNALS = ("q", "qd", "e_p", "e_v", "tau", "s", "sdot")


class Download(NamedTuple):
    """A file in a link: its name and its address."""

    name: str
    href: str


def json_file(name: str, value: Any) -> Download:
    """Return a file with a value as JSON."""
    return text_file(name, json.dumps(to_json(value), indent=2, ensure_ascii=False) + "\n", "application/json")


def text_file(name: str, text: str, kind: str = "text/plain") -> Download:
    """Return a file with a text."""
    # half a character becomes \\ud800, as JSON writes it
    encoded = base64.b64encode(text.encode(errors="backslashreplace")).decode()
    return Download(file_name(name), f"data:{kind};charset=utf-8;base64,{encoded}")


def signals_file(name: str, run: Run) -> Download:
    """Return a table of the first rollout, at most 501 evenly spaced rows; SI units, named in its header."""
    kept = np.unique(np.linspace(0, len(run.time) - 1, min(len(run.time), _MOST_ROWS)).round().astype(int))
    columns = {"time [s]": run.time[kept]}
    for signal in (name for name in _SIGNALS if name in run.data):
        values, unit = run.array(signal)[0, kept], run[signal].attrs["units"]
        for i, joint in enumerate(run["joint"].to_numpy() if values.ndim > 1 else [""]):
            columns[f"{signal} {joint}".strip() + f" [{unit}]"] = values[:, i] if values.ndim > 1 else values
    table = io.StringIO()
    writer = csv.writer(table)
    writer.writerow(columns)
    writer.writerows([f"{value:.6g}" for value in row] for row in zip(*columns.values(), strict=True))
    return text_file(name, table.getvalue(), "text/csv")


def file_name(name: str) -> str:
    """Return ``name`` without characters that file systems refuse."""
    found = re.sub(r"[^\w.+-]+", "_", name).strip("._")
    return found[: _LONGEST // 2] + found[-_LONGEST // 2 :] if len(found) > _LONGEST else found or "file"
