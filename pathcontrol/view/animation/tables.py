"""The tables of a film: what was measured, and what it was made with; a column for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pathcontrol.analysis.contours import contour_table
from pathcontrol.analysis.deviation import toolpath_metrics
from pathcontrol.analysis.laps import lap_table
from pathcontrol.analysis.limit_shares import RATIOS, is_passed
from pathcontrol.analysis.readable import readable_number, unit_of
from pathcontrol.analysis.remarks import remarks
from pathcontrol.analysis.run_metrics import LABELS, metrics
from pathcontrol.analysis.window import describe_window
from pathcontrol.view.animation.rollout import Take
from pathcontrol.view.animation.settings import settings

_NEEDED = {"qd", "s", "e_p", "e_v", "sdot", "tau_demand"}


def tables(takes: Sequence[Take]) -> list[dict[str, Any]]:
    """Metrics, contours and settings as the header of a film has them; rows beyond a limit are ``marked``."""
    names, numbers = [take.name for take in takes], [_numbers(take) for take in takes]
    rows = _rows([_measured(take, found) for take, found in zip(takes, numbers, strict=True)])
    beyond = {LABELS[name] for name in RATIOS for found in numbers if is_passed(found.get(name, [0.0])[0])}
    found = [
        {"title": "Metrics", "columns": [_meant(takes), *names], "rows": rows},
        *_contours(takes),
        *_laps(takes),
        {"title": "Settings", "columns": ["", *names], "rows": _rows([settings(take) for take in takes])},
    ]
    found[0]["marked"] = [i for i, row in enumerate(rows) if row[0] in beyond]
    return [table for table in _mind(takes) + found if table["rows"]]


def _mind(takes: Sequence[Take]) -> list[dict[str, Any]]:
    """What must not be overlooked, all of it marked."""
    rows = [
        [take.name, sentence]
        for take in takes
        if not _idle(take)
        for sentence in remarks(take.run.with_robot(take.robot))
    ]
    return [{"title": "To be noted", "columns": ["", ""], "rows": rows, "marked": list(range(len(rows)))}]


def _contours(takes: Sequence[Take]) -> list[dict[str, Any]]:
    """What became of each contour, of a single take: several have tables too large to be compared."""
    if len(takes) > 1 or takes[0].toolpath is None or _idle(takes[0]) or not _measurable(takes[0]):
        return []
    heads, *rows = contour_table(takes[0].run, takes[0].robot) or [[]]
    return [{"title": "Contours", "columns": heads, "rows": rows}]


def _laps(takes: Sequence[Take]) -> list[dict[str, Any]]:
    """How long each lap of a closed path took, of a single take."""
    if len(takes) > 1 or takes[0].task is None or takes[0].task is not takes[0].run.task:
        return []
    heads, *rows = lap_table(takes[0].run) or [[]]
    return [{"title": "Laps", "columns": heads, "rows": rows}]


def _meant(takes: Sequence[Take]) -> str:
    """Of which time the errors are: the charts beside them show all of it."""
    drawn = [take.toolpath is not None for take in takes]
    cuts, late = "over the cuts", f"of {describe_window()}"
    return f"peaks and RMS {cuts if all(drawn) else f'{late}, of toolpaths {cuts}' if any(drawn) else late}"


def _rows(columns: Sequence[Mapping[str, str]]) -> list[list[str]]:
    names = dict.fromkeys(name for column in columns for name in column)
    return [[name, *(column.get(name, "–") for column in columns)] for name in names]


def _measured(take: Take, numbers: Mapping[str, Any]) -> dict[str, str]:
    return {
        LABELS[name]: readable_number(numbers[name][0], unit_of(name, take.run)) for name in LABELS if name in numbers
    }


def _idle(take: Take) -> bool:
    """Whether nothing was cut, so that there is nothing to be measured."""
    if take.toolpath is None:
        return False
    followed = np.unique(take.run.array("path_index"))
    return all(take.toolpath.contours[i].rapid for i in followed)


def _measurable(take: Take) -> bool:
    """Whether the run has what metrics are made of."""
    return all(name in take.run for name in _NEEDED)


def _numbers(take: Take) -> dict[str, Any]:
    if take.task is None or not _measurable(take) or _idle(take):
        return {}
    if take.toolpath is not None:
        return toolpath_metrics(take.run, take.robot, take.toolpath)
    return metrics(take.run.with_robot(take.robot), take.task)
