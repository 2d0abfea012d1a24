"""The tables of a film: what was measured, and what it was made with; a column for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pathcontrol.analysis.deviation import toolpath_metrics
from pathcontrol.analysis.metrics import LABELS, metrics
from pathcontrol.analysis.readable import readable_number, unit_of
from pathcontrol.view.film.settings import settings
from pathcontrol.view.film.take import Take

_NEEDED = {"qd", "s", "e_p", "e_v", "sdot", "tau_demand"}


def tables(takes: Sequence[Take]) -> list[dict[str, Any]]:
    """Metrics and settings as the header of a film has them."""
    names = [take.name for take in takes]
    found = [
        ("Metrics", _meant(takes), [_measured(take) for take in takes]),
        ("Settings", "", [settings(take) for take in takes]),
    ]
    return [
        {"title": title, "columns": [meant, *names], "rows": rows}
        for title, meant, each in found
        if (rows := _rows(each))
    ]


def _meant(takes: Sequence[Take]) -> str:
    """Of which time the peaks are: the charts beside them show all of it."""
    drawn = [take.toolpath is not None for take in takes]
    cuts, late = "over the cuts", "of the second half of the time"
    return f"peaks and RMS {cuts if all(drawn) else f'{late}, of toolpaths {cuts}' if any(drawn) else late}"


def _rows(columns: Sequence[Mapping[str, str]]) -> list[list[str]]:
    names = dict.fromkeys(name for column in columns for name in column)
    return [[name, *(column.get(name, "–") for column in columns)] for name in names]


def _measured(take: Take) -> dict[str, str]:
    if take.task is None or not set(take.run.data.data_vars) >= _NEEDED or _idle(take):
        return {}
    numbers, run = _numbers(take), take.run
    return {LABELS[name]: readable_number(numbers[name][0], unit_of(name, run)) for name in LABELS if name in numbers}


def _idle(take: Take) -> bool:
    """Whether nothing was cut, so that there is nothing to be measured."""
    if take.toolpath is None:
        return False
    followed = np.unique(take.run["path_index"].to_numpy())
    return all(take.toolpath.contours[i].rapid for i in followed)


def _numbers(take: Take) -> dict[str, Any]:
    if take.toolpath is not None:
        return toolpath_metrics(take.run, take.robot, take.toolpath)
    return metrics(take.run, take.task)
