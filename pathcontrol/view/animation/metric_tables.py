"""The tables of a film: metrics and settings, with a column for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pathcontrol.analysis.contours import contour_table
from pathcontrol.analysis.deviation import toolpath_metrics
from pathcontrol.analysis.lap_table import lap_table
from pathcontrol.analysis.limit_shares import RATIOS, is_passed
from pathcontrol.analysis.readable import readable_number, readable_parameters, unit_of
from pathcontrol.analysis.run_metrics import LABELS, metrics
from pathcontrol.analysis.run_remarks import remarks
from pathcontrol.analysis.window import describe_window
from pathcontrol.simulation.config import laws, sample_parameters, table
from pathcontrol.view.animation.rollout import Recording

_NEEDED = {"qd", "s", "e_p", "e_v", "sdot", "tau_demand"}
_NAMES = {
    "friction": "friction compensation",
    "start": "s starts at",
    "encoders": "encoders",
    "velocity": "measured velocity",
    "filter_hz": "velocity filter [Hz]",
    "torque_limits": "torque limits [N m]",
    "period": "control period [s]",
    "output_period": "time between samples [s]",
    "delay": "delay [s]",
}
_ELSEWHERE = {"controller", "robot", "task", "sequence"}


def tables(recordings: Sequence[Recording]) -> list[dict[str, Any]]:
    """Return metrics, contours and settings for the header of a film; rows beyond a limit are ``marked``."""
    names, numbers = [recording.name for recording in recordings], [_numbers(recording) for recording in recordings]
    rows = _rows([_format_metrics(recording, found) for recording, found in zip(recordings, numbers, strict=True)])
    beyond = {LABELS[name] for name in RATIOS for found in numbers if is_passed(found.get(name, [0.0])[0])}
    found = [
        {"title": "Metrics", "columns": [_describe_window(recordings), *names], "rows": rows},
        *_contours(recordings),
        *_laps(recordings),
        {
            "title": "Settings",
            "columns": ["", *names],
            "rows": _rows([settings(recording) for recording in recordings]),
        },
    ]
    found[0]["marked"] = [i for i, row in enumerate(rows) if row[0] in beyond]
    return [table for table in _list_remarks(recordings) + found if table["rows"]]


def _list_remarks(recordings: Sequence[Recording]) -> list[dict[str, Any]]:
    """Return what must not be overlooked, all of it marked."""
    rows = [
        [recording.name, sentence]
        for recording in recordings
        if not _idle(recording)
        for sentence in remarks(recording.run.with_robot(recording.robot))
    ]
    return [{"title": "To be noted", "columns": ["", ""], "rows": rows, "marked": list(range(len(rows)))}]


def _contours(recordings: Sequence[Recording]) -> list[dict[str, Any]]:
    """Return the table of contours of a single rollout; the tables of several are too large to be compared."""
    if len(recordings) > 1 or recordings[0].toolpath is None or _idle(recordings[0]) or not _measurable(recordings[0]):
        return []
    heads, *rows = contour_table(recordings[0].run, recordings[0].robot) or [[]]
    return [{"title": "Contours", "columns": heads, "rows": rows}]


def _laps(recordings: Sequence[Recording]) -> list[dict[str, Any]]:
    """Return the table of laps of a single rollout on a closed path."""
    if len(recordings) > 1 or recordings[0].task is None or recordings[0].task is not recordings[0].run.task:
        return []
    heads, *rows = lap_table(recordings[0].run) or [[]]
    return [{"title": "Laps", "columns": heads, "rows": rows}]


def _describe_window(recordings: Sequence[Recording]) -> str:
    """Return the time window of the errors, in words; the charts beside them show the whole time."""
    drawn = [recording.toolpath is not None for recording in recordings]
    cuts, late = "over the cuts", f"of {describe_window()}"
    return f"peaks and RMS {cuts if all(drawn) else f'{late}, of toolpaths {cuts}' if any(drawn) else late}"


def _rows(columns: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """Return the rows of some columns."""
    names = dict.fromkeys(name for column in columns for name in column)
    return [[name, *(column.get(name, "–") for column in columns)] for name in names]


def _format_metrics(recording: Recording, numbers: Mapping[str, Any]) -> dict[str, str]:
    """Return metrics in words."""
    return {
        LABELS[name]: readable_number(numbers[name][0], unit_of(name, recording.run))
        for name in LABELS
        if name in numbers
    }


def _idle(recording: Recording) -> bool:
    """Return whether nothing was cut, so that there is nothing to measure."""
    if recording.toolpath is None:
        return False
    followed = np.unique(recording.run.array("path_index"))
    return all(recording.toolpath.contours[i].rapid for i in followed)


def _measurable(recording: Recording) -> bool:
    """Return whether the run has the variables that metrics need."""
    return all(name in recording.run for name in _NEEDED)


def _numbers(recording: Recording) -> dict[str, Any]:
    """Return the metrics of a rollout."""
    if recording.task is None or not _measurable(recording) or _idle(recording):
        return {}
    if recording.toolpath is not None:
        return toolpath_metrics(recording.run, recording.robot, recording.toolpath)
    return metrics(recording.run.with_robot(recording.robot), recording.task)


def settings(recording: Recording) -> dict[str, str]:
    """Return robot, controller, gains, plant, loop, duration and versions of a run, by their names."""
    config = recording.run.config
    chosen = {name: value for name, value in laws(config)[0].items() if name not in _ELSEWHERE}
    versions = ", ".join(f"{name} {number}" for name, number in table(config, "versions").items())
    found: dict[str, Any] = {
        "parameters of the sample": readable_parameters(sample_parameters(config), 3) or None,
        "robot": recording.robot.name,
        "controller": table(config, "controller").get("controller"),
        "task": None if recording.task is None else table({"of": recording.task.describe()}, "of").get("task"),
        **{_NAMES.get(name, name): value for name, value in chosen.items()},
        "friction of the plant": _friction(table(config, "plant")),
        **{_NAMES.get(name, name): value for name, value in table(config, "loop").items()},
        "duration": f"{recording.duration:g} s, {len(recording.time)} samples",
        "rollout": f"{_rollout(recording)} of {recording.rollouts}" if recording.rollouts > 1 else None,
        "versions": versions or None,
    }
    return {name: _words(value) for name, value in found.items() if value is not None}


def _rollout(recording: Recording) -> int:
    """Return the number of the rollout."""
    return int(recording.run.array("rollout")[0])


def _friction(plant: Mapping[str, Any]) -> str | None:
    """Return the names of the laws that the friction of the plant consists of."""
    law = table(plant, "friction")
    terms = law["terms"] if isinstance(law.get("terms"), list) else [law]
    names = [str(term.get("law", "")) for term in terms if isinstance(term, Mapping)]
    return " + ".join(name for name in names if name) or None


def _words(value: Any) -> str:
    """Return a value in words."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    return str(value)
