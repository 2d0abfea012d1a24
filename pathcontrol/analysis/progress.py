"""The progress of rollouts along their path, which tells those that did not finish from good ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.asked_speed import asked_factor
from pathcontrol.analysis.gamma import planned_rate
from pathcontrol.analysis.metric_helpers import apply_where_finite, split_by_task
from pathcontrol.analysis.window import samples_of
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

#: progress below which a rollout did not finish its path
ENOUGH = 0.999
_HALF_SPEED = 0.5  # being slow is no fault; half of the commanded speed is certainly moving


def progress(run: Run, task: PathTask) -> Array:
    """Return the share of the path that a rollout's plan has passed, (rollout,); 1 if it is finished.

    On an open path it is the share of its parameter; on a closed one that of the requested laps. Where no
    laps were requested, it is 1 if the arm went on in the second half of the time: once round, or for half of ∫ϑ dt
    where that is less. Where an operator holds the plan, slows it down or turns it back, what it went both ways counts,
    and ϑ is as much smaller. NaN where s is no number.
    """
    share = _share_of_end(run, task) if _ends(run, task) else _share_of_motion(run, task)
    return np.where(run.status == "finished", 1.0, np.clip(share, 0.0, 1.0))


def is_unfinished(run: Run) -> NDArray[np.bool_]:
    """Return which rollouts were still running at the end without having got there, (rollout,); none without a task."""
    if run.task is None or "s" not in run:
        return np.zeros(run.rollouts, dtype=bool)
    short = np.zeros(run.rollouts, dtype=bool)
    for part, own, rows in split_by_task(run, run.task):
        short[rows] = ~has_arrived(progress(part, own))
    return short & (run.status == "running")


def has_arrived(progress: Array) -> Array:
    """Return which rollouts have enough ``progress``; unknown progress counts as enough."""
    return ~(progress < ENOUGH)


def _ends(run: Run, task: PathTask) -> bool:
    """Return whether the path or the number of laps sets an end."""
    return bool(np.isfinite(task.s_end)) or _laps(run) > 0


def _laps(run: Run) -> int:
    """Return the requested number of laps, or 0."""
    laps = run.config.get("laps")
    return laps if isinstance(laps, int) else 0


def _share_of_end(run: Run, task: PathTask) -> Array:
    """Return the share of an open path, or of the requested laps."""
    s = run.array("s")
    if np.isfinite(task.s_end):
        return (_largest(s) - task.s0) / (task.s_end - task.s0)
    assert task.period is not None
    return (_largest(s) - s[:, 0]) / (_laps(run) * task.period)


def _share_of_motion(run: Run, task: PathTask) -> Array:
    """Return the progress on a path without an end, from the second half of the time."""
    late, time, s = samples_of(run), run.time, run.array("s")
    rows, last = np.arange(run.rollouts), late.stop - 1
    passed, once = s[rows, last] - s[rows, late.first], np.inf if task.period is None else task.period
    factor = asked_factor(run)
    if (passed >= once).all():
        return np.ones(run.rollouts)
    theta = apply_where_finite(lambda s: planned_rate(task, s), late.within(s))
    if factor is not None:
        theta = theta * np.minimum(factor, 1.0)
        passed = late.reduce(lambda s: np.abs(np.diff(s)).sum(), s)
    asked = late.reduce(np.mean, theta) * (time[last] - time[late.first])
    wanted = np.minimum(once, _HALF_SPEED * asked)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(wanted > 0, passed / wanted, 1.0)


def _largest(s: Array) -> Array:
    """Return the largest finite s of each rollout."""
    known = np.where(np.isfinite(s), s, -np.inf).max(-1)
    return np.where(np.isfinite(known), known, np.nan)
