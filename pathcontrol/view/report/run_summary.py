"""The summary of runs in words and in numbers, side by side, in degrees and millimetres."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.deviation import toolpath_metrics
from pathcontrol.analysis.limit_shares import RATIOS, is_passed, limit_ratios
from pathcontrol.analysis.progress import has_arrived
from pathcontrol.analysis.readable import count_words, readable_parameters, reading, unit_of, without_rounding
from pathcontrol.analysis.run_metrics import LABELS, metrics
from pathcontrol.analysis.torque import torque_metrics
from pathcontrol.analysis.window import samples_of
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.simulation.config import sample_parameters, table
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.joined.path_sequence import PathSequence

#: distance of a value from a good one, if not the value itself; None if no value is better than another
_BADNESS: dict[str, Callable[[float], float] | None] = {
    "speed_ratio": lambda value: abs(value - 1),
    "progress": lambda value: -value,
    "coverage": lambda value: -value,
    "smoothing_deviation": None,
    "feed": None,
    "tool_speed_mean": None,
    "tool_speed_peak": None,
}
_ENDLESS = {
    "settling_time": "never",
    "path_time": "not finished",
    "cut_time": "not finished",
    "lap_time": "never",
    "end_error": "not finished",
}


_NEEDED = {"q", "qd", "s", "sdot", "e_p", "e_v", "tau_demand"}


class Cell(NamedTuple):
    """An entry of a table for one run, whether it is the best of its row, and whether it is beyond a limit."""

    text: str
    best: bool = False
    beyond: bool = False


class Row(NamedTuple):
    """One quantity of all runs."""

    label: str
    unit: str
    cells: tuple[Cell, ...]


def measure(run: Run) -> dict[str, list[float]]:
    """Return the metrics of a run by name, in SI units, each with one entry for each rollout."""
    task = run.task
    if task is None or not set(run.data.data_vars) >= _NEEDED:
        return _without_path(run)
    return toolpath_metrics(run, run.robot, task) if isinstance(task, ToolpathTask) else metrics(run, task)


def _without_path(run: Run) -> dict[str, list[float]]:
    """Return the metrics of a run that does not know its path, or has not recorded everything."""
    own, late = samples_of(run, "all"), samples_of(run)
    errors = [name for name in ("e_p", "e_v") if name in run.data]
    kinds: dict[str, Callable[[Array], Any]] = {"peak": np.max, "rms": lambda v: np.sqrt(np.mean(v**2))}
    values = {f"{name}_{kind}": late.reduce(of, run.norm(name)) for name in errors for kind, of in kinds.items()}
    if "tau_demand" in run.data:
        values |= torque_metrics(run, own, late)
    values |= limit_ratios(run, own)
    return {name: value.tolist() for name, value in values.items()}


def facts(runs: Mapping[str, Run]) -> list[Row]:
    """Return the facts about each run, in words."""
    said: dict[str, Callable[[Run], str]] = {
        "robot": lambda run: run.robot.name,
        "controller": lambda run: str(_law(run).get("controller", "not known")),
        "path": _path,
        "time simulated": lambda run: f"{run.time[-1] - run.time[0]:.4g} s",
        "outcome": _outcome,
    }
    if any("sweep" in run.config for run in runs.values()):
        said["parameters of the sample"] = lambda run: readable_parameters(sample_parameters(run.config), 3) or "–"
    return [Row(label, "", tuple(Cell(say(run)) for run in runs.values())) for label, say in said.items()]


def _path(run: Run) -> str:
    """Return the path in words."""
    task = run.task
    if isinstance(task, ToolpathTask):
        return f"{Path(task.drawing.source).name}, {count_words(len(task), 'path')}"
    if isinstance(task, PathSequence):
        return count_words(len(task), "path")
    if isinstance(task, TaskBatch):
        return f"{count_words(len(task), 'task')}, {', '.join(task.describe()['kinds'])}"
    # what was sampled for a file has its own name still in the configuration
    described = _law(run).get("task")
    name = described.get("task") if isinstance(described, Mapping) else None
    return str(name or ("not known" if task is None else type(task).__name__))


def _law(run: Run) -> Mapping[str, Any]:
    """Return the section of the law in the configuration, which may be malformed."""
    return table(run.config, "controller")


def _outcome(run: Run) -> str:
    """Return the outcome in words."""
    finished = run.status == "finished"
    diverged = run.status == "diverged"
    if run.rollouts > 1:
        endless = "laps" in run.data.coords and not finished.any()
        said = f"{run.rollouts} rollouts" if endless else f"{finished.sum()} of {run.rollouts} rollouts finished"
        return f"{said}, {diverged.sum()} diverged" if diverged.any() else said
    if diverged[0]:
        return f"diverged at {run.diverged_time[0]:.4g} s"
    if finished[0]:
        return f"finished after {run.finish_time[0]:.4g} s"
    return (
        count_words(int(run.laps[0]), "whole lap") if "laps" in run.data.coords else "not finished when the time was up"
    )


def rows(runs: Mapping[str, Run], numbers: Mapping[str, Mapping[str, list[float]]]) -> list[Row]:
    """Return a row for each metric that one of the runs has, with the best of each marked where there are several.

    What is 0 but for rounding is shown as 0; where that would be the best, none is marked.
    """
    wanted = [(key, unit) for key in LABELS for unit in _units(key, runs, numbers)]
    return [_row(key, unit, runs, numbers) for key, unit in wanted]


def _units(key: str, runs: Mapping[str, Run], numbers: Mapping[str, Mapping[str, list[float]]]) -> Iterable[str]:
    """Return the units in which runs have a metric: several if angles are compared with lengths."""
    return dict.fromkeys(unit_of(key, run) for name, run in runs.items() if key in numbers[name])


def _row(key: str, unit: str, runs: Mapping[str, Run], numbers: Mapping[str, Mapping[str, list[float]]]) -> Row:
    """Return the row of a metric."""
    given = {n: np.asarray(numbers[n][key]) for n, r in runs.items() if key in numbers[n] and unit_of(key, r) == unit}
    values = {name: without_rounding(value) for name, value in given.items()}
    rounded = {name for name in given if given[name].any() and not values[name].any()}
    scale, shown = reading(unit, np.concatenate(list(values.values())))
    texts = {name: _text(scale * value, _ENDLESS.get(key, "–")) for name, value in values.items()}
    arrived = {name: float(np.median(value)) for name, value in values.items() if _has_arrived(numbers[name])}
    beyond = {name for name, value in values.items() if key in RATIOS and is_passed(value).any()}
    best = _best(_BADNESS.get(key, abs), arrived, texts)
    best = set() if best & rounded else best - beyond
    return Row(LABELS[key], shown, tuple(Cell(texts.get(name, "–"), name in best, name in beyond) for name in runs))


def _has_arrived(numbers: Mapping[str, list[float]]) -> bool:
    """Return whether all rollouts of a run got there: one that stands still has the smallest errors."""
    return bool(has_arrived(np.array(numbers.get("progress", [np.nan]))).all())


def _text(values: Array, endless: str) -> str:
    """Return one number, or for many rollouts the median, the least and the largest."""
    one = [_number(float(v), endless) for v in (np.median(values), values.min(), values.max())]
    return one[0] if len(values) == 1 else f"{one[0]} ({one[1]} … {one[2]})"


def _number(value: float, endless: str) -> str:
    """Return a number as a text."""
    if value == 0:
        return "0"
    return f"{value:#.4g}".rstrip(".") if math.isfinite(value) else endless


def _best(badness: Callable[[float], float] | None, values: Mapping[str, float], texts: Mapping[str, str]) -> set[str]:
    """Return the runs with the best value, those with the same text among them; none if all have it."""
    finite = {name: value for name, value in values.items() if math.isfinite(value)}
    if badness is None or not finite or len(set(texts.values())) < 2:
        return set()
    least = min(finite, key=lambda name: badness(finite[name]))
    return {name for name in finite if texts[name] == texts[least]}
