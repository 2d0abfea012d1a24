"""What a tuning found, in words and numbers for a person to read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pathcontrol.analysis.metrics import LABELS, UNITS
from pathcontrol.analysis.readable import readable_number, readable_parameters

if TYPE_CHECKING:
    from pathcontrol.tuning.result import Candidate, Tuning


def summary(tuning: Tuning) -> str:
    """Several lines: how many candidates, the best ones, and how active each limit is; or which limits are missed."""
    table, (whole, asked) = tuning.table(), tuning.generations
    lost, short = (int((table["status"] == status).sum()) for status in ("diverged", "unfinished"))
    lines = [
        f"{table.sizes['sample']} candidates in {whole} generations"
        + (f" of {asked}, then stopped" if whole < asked else "")
        + (f", each in {tuning.scenarios} scenarios" if tuning.scenarios > 1 else "")
        + f": {tuning.feasible().sizes['sample']} within the limits"
        + (f", {lost} diverged" if lost else "")
        + (f", {short} did not get to the end in the time" if short else "")
    ]
    return "\n".join(lines + (_found(tuning) if tuning.feasible().sizes["sample"] else _missed(tuning)))


def _found(tuning: Tuning) -> list[str]:
    lines = []
    for objective, goal in tuning.objectives.items():
        best = tuning.best(objective)
        if best is None:
            lines += ["", f"{_label(objective)} is not finite for any candidate within the limits"]
            continue
        lines += ["", f"{'least' if goal == 'min' else 'largest'} {_label(objective)}", *_candidate(tuning, best)]
        lines += _limits(tuning, objective, best)
    knee = tuning.knee()
    if knee is not None:
        lines += ["", "knee of the front", *_candidate(tuning, knee)]
    if len(tuning.objectives) > 1:
        lines += ["", f"front of {tuning.front().sizes['sample']} candidates"]
    return lines


def _candidate(tuning: Tuning, one: Candidate) -> list[str]:
    numbers = ", ".join(f"{_label(name)} {_number(name, one.metrics[name])}" for name in tuning.objectives)
    return [f"  {numbers}", f"  candidate {one.number}: {readable_parameters(one.parameters)}"]


def _limits(tuning: Tuning, objective: str, best: Candidate) -> list[str]:
    active, lines = tuning.activity(objective), []
    for name, found in active.items():
        change = found.bought / best.metrics[objective] - 1 if best.metrics[objective] else 0.0
        gain = f"changes it by {100 * change:+.1f} % at least" if change else "was not found to change it"
        value = f"{_label(name)} {_number(name, found.value)}, limit {_ends(tuning, name)}"
        lines.append(f"  {value}: {100 * max(found.share, 0.0):.0f} % used; 10 % looser {gain}")
    return lines


def _missed(tuning: Tuning) -> list[str]:
    """How often each limit is kept and how near it was come, the farthest first, and the nearest candidate."""
    nearest, lines = tuning.nearest(), ["no candidate keeps all limits"]
    beyond = {name: tuning.beyond(name) for name in tuning.limits}
    for name in sorted(beyond, key=lambda name: -float(beyond[name].min())):
        over = beyond[name]
        kept = int((over <= 0).sum())
        value = tuning.candidate(int(over.argmin())).metrics[name]
        said = f"kept by {kept}" if kept else f"kept by none, {100 * over.min():.0f} % beyond at best"
        lines.append(f"  {_label(name)} {_ends(tuning, name)}: {said}, {_number(name, value)}")
    if nearest is not None:
        lines += ["", "nearest to all of them", *_candidate(tuning, nearest)]
        for name, over in beyond.items():
            share = over[nearest.number]
            said = "kept" if share <= 0 else f"{100 * share:.0f} % beyond"
            lines.append(f"  {_label(name)} {_number(name, nearest.metrics[name])}: {said}")
    return lines


def _label(name: str) -> str:
    return LABELS.get(name, name)


def _number(name: str, value: float) -> str:
    return readable_number(value, UNITS.get(name, ""))


def _ends(tuning: Tuning, name: str) -> str:
    low, high = tuning.limits[name]
    said = [(f"≥ {_number(name, low)}", low), (f"≤ {_number(name, high)}", high)]
    return " and ".join(text for text, end in said if np.isfinite(end))
