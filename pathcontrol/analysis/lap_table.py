"""The numbers of a run round a closed path lap by lap: times and speeds."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.metric_helpers import apply_by_task
from pathcontrol.analysis.tool_following import find_tool, tool_speed
from pathcontrol.analysis.window import own_samples
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

_ROUNDING = 1e-9  # share of a lap
_MOST = 1000  # limit of laps in a table


def lap_times(run: Run, task: PathTask | None = None, rollout: int = 0) -> Array:
    """Return the time [s] of each whole lap of a rollout, (laps,), counted from where its plan began.

    A lap ends when s, linear between samples, has grown by a period.

    Raises:
        InputError: the path is not closed, or not known.
    """
    expect("run", run, Run)
    part = run.rollout(rollout)
    path = part.task if task is None else task
    if path is not None:
        expect("task", path, PathTask)
    if path is None or not path.closed:
        raise InputError(
            "laps are of closed paths; the path of this run has no period, or is not known", argument="task", value=task
        )
    return np.diff(_find_lap_ends(part, path)[0])


def lap_errors(run: Run, task: PathTask | None = None, rollout: int = 0) -> Array:
    """Return the largest ‖e_p‖ [rad] in each whole lap of a rollout, (laps,), counted as in :func:`lap_times`.

    Raises:
        InputError: the path is not closed, or not known.
    """
    ends = np.concatenate([[0.0], np.cumsum(lap_times(run, task, rollout))])
    part = run.rollout(rollout)
    error, lap = part.norm("e_p")[0], np.searchsorted(ends, part.time, side="right") - 1
    return np.array([error[lap == i].max() for i in range(len(ends) - 1)])


def lap_time(run: Run, task: PathTask) -> Array:
    """Return the mean time [s] of the whole laps of each rollout, (rollout,); NaN without one."""
    found = map(np.diff, _find_lap_ends(run, task))
    return np.array([times.mean() if len(times) else np.nan for times in found])


def _find_lap_ends(run: Run, task: PathTask) -> list[Array]:
    """Return the times [s] at which laps of each rollout begin and end, (laps + 1,) each."""
    s, time = run.array("s"), run.time
    return [_find_ends(s[i, :stop], time[:stop], task) for i, stop in enumerate(own_samples(run))]


def _find_ends(s: Array, time: Array, task: PathTask) -> Array:
    """Return the times [s] at which laps of one rollout, s at times (k,) each, begin and end, (laps + 1,)."""
    known = np.isfinite(s)
    if not known.any() or task.period is None:
        return time[:1]
    s, time = np.maximum.accumulate(s[known]), time[known]
    laps = (s - s[0]) / task.period
    # with more laps than samples their times are not known
    whole = np.arange(int(min(laps[-1] + _ROUNDING, len(s))) + 1)
    after = np.minimum(np.searchsorted(laps, whole - _ROUNDING), len(laps) - 1)
    before = np.maximum(after - 1, 0)
    step = laps[after] - laps[before]
    share = np.divide(whole - laps[before], step, out=np.ones(len(whole)), where=step > 0)
    return time[before] + np.minimum(share, 1.0) * (time[after] - time[before])


def lap_table(run: Run) -> list[list[str]]:
    """Return the numbers of each whole lap of a run of one rollout round a closed path, as texts for a reader.

    Column heads come first, and at most 1000 laps are listed; the table is empty for a run of another kind, and
    without a whole lap.
    """
    task = run.task
    if task is None or not task.closed or run.rollouts != 1 or "q" not in run or "s" not in run:
        return []
    ends = _find_lap_ends(run, task)[0][: _MOST + 1]
    if len(ends) < 2:
        return []
    columns = [("lap", [str(i + 1) for i in range(len(ends) - 1)]), ("time [s]", [f"{t:.4g}" for t in np.diff(ends)])]
    columns += [(head, [f"{v:.4g}" for v in _average_laps(run, ends, values)]) for head, values in _signals(run, task)]
    return [[head for head, _ in columns], *map(list, zip(*(texts for _, texts in columns), strict=True))]


def _signals(run: Run, task: PathTask) -> list[tuple[str, Array]]:
    """Return the signals that are averaged over each lap, (time,) each, with their heads."""
    found = []
    try:
        arm = run.robot
    except InputError:
        arm = None
    if arm is not None and "qd" in run and find_tool(arm, task) is not None:
        found.append(("mean speed [mm/s]", 1e3 * apply_by_task(lambda r, t: tool_speed(r, arm, t), run, task)[0]))
    if "sdot" in run:
        theta = np.broadcast_to(task.theta(run.array("s")[0]), len(run.time))
        found.append(("mean σ̇ over mean ϑ", run.array("sdot")[0] / np.where(theta > 0, theta, np.nan)))
    return found


def _average_laps(run: Run, ends: Array, values: Array) -> list[float]:
    """Return the means of values (time,) over each lap, (laps,)."""
    lap = np.searchsorted(ends, run.time, side="right") - 1
    means = []
    for i in range(len(ends) - 1):
        mine = values[(lap == i) & np.isfinite(values)]
        means.append(float(mine.mean()) if mine.size else np.nan)
    return means
