"""Files that a page carries inside itself, behind links."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
from typing import Any, NamedTuple

import numpy as np

from pathcontrol.simulation.run import Run

_MOST_ROWS = 501
_SIGNALS = ("q", "qd", "e_p", "e_v", "tau", "s", "sdot")


class Download(NamedTuple):
    """A file in a link: its name and its address."""

    name: str
    href: str


def json_file(name: str, value: Any) -> Download:
    """A file with a value as JSON."""
    return text_file(name, json.dumps(value, indent=2, ensure_ascii=False) + "\n", "application/json")


def text_file(name: str, text: str, kind: str = "text/plain") -> Download:
    """A file with a text."""
    return Download(file_name(name), f"data:{kind};charset=utf-8;base64,{base64.b64encode(text.encode()).decode()}")


def signals_file(name: str, run: Run) -> Download:
    """A table of the first rollout, one row a sample, at most 501 of them evenly spaced; SI units, in its header."""
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
    """``name`` without what file systems do not take."""
    return re.sub(r"[^\w.+-]+", "_", name).strip("._") or "file"
