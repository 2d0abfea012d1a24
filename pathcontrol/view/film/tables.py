"""The tables of a film: what was measured, and what it was made with; a column for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pathcontrol.analysis.deviation import toolpath_metrics
from pathcontrol.analysis.metrics import LABELS, UNITS, metrics
from pathcontrol.view.film.settings import settings
from pathcontrol.view.film.take import Take

_NEEDED = {"e_p", "e_v", "sdot", "tau_demand"}


def tables(takes: Sequence[Take]) -> list[dict[str, Any]]:
    """Metrics and settings as the header of a film has them."""
    columns = ["", *(take.name for take in takes)]
    found = [("Metrics", [_measured(take) for take in takes]), ("Settings", [settings(take) for take in takes])]
    return [{"title": title, "columns": columns, "rows": rows} for title, each in found if (rows := _rows(each))]


def readable_number(value: float, unit: str) -> str:
    """A number with its unit, as a person reads it: degrees for radians, millimetres or micrometres for metres."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "never" if unit == "s" else "∞"
    if unit in ("rad", "rad/s"):
        value, unit = float(np.rad2deg(value)), unit.replace("rad", "deg")
    elif unit == "m":
        value, unit = (1e6 * value, "µm") if abs(value) < 1e-3 else (1e3 * value, "mm")
    return f"{value:.4g} {unit}".strip()


def _rows(columns: Sequence[Mapping[str, str]]) -> list[list[str]]:
    names = dict.fromkeys(name for column in columns for name in column)
    return [[name, *(column.get(name, "–") for column in columns)] for name in names]


def _measured(take: Take) -> dict[str, str]:
    if take.task is None or not set(take.run.data.data_vars) >= _NEEDED or _idle(take):
        return {}
    numbers = _numbers(take)
    return {LABELS[name]: readable_number(numbers[name][0], _unit(take, name)) for name in LABELS if name in numbers}


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


def _unit(take: Take, metric: str) -> str:
    """The unit of a metric; that of the run where joints slide."""
    own = {"rad": "q", "rad/s": "qd", "N m": "tau_demand"}
    unit = UNITS[metric]
    return str(take.run[own[unit]].attrs["units"]) if own.get(unit) in take.run.data else unit
