"""How far rollouts came along their path: those that did not get there are not to be taken for good ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.gamma import planned_rate
from pathcontrol.analysis.known import by_task, where_known
from pathcontrol.analysis.window import samples_of
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

#: a rollout with less progress did not get there
ENOUGH = 0.999
_HALF_SPEED = 0.5  # being slow is no fault; half of the speed asked for is certainly moving


def progress(run: Run, task: PathTask) -> Array:
    """The share of what was to be passed that a rollout's plan has passed, (rollout,); 1 of one that is finished.

    Of an open path it is the share of its parameter; of a closed one that of the laps that were asked for. Where no
    laps were, it is 1 if the arm went on in the second half of the time: once round, or for half of ∫ϑ dt where that
    is less. NaN where s is no number.
    """
    share = _of_end(run, task) if _ends(run, task) else _of_going_on(run, task)
    return np.where(run.status == "finished", 1.0, np.clip(share, 0.0, 1.0))


def unfinished(run: Run) -> NDArray[np.bool_]:
    """Which rollouts were still running when the time was up and did not get there, (rollout,); none without a task."""
    if run.task is None or "s" not in run:
        return np.zeros(run.rollouts, dtype=bool)
    short = np.zeros(run.rollouts, dtype=bool)
    for part, own, rows in by_task(run, run.task):
        short[rows] = ~got_there(progress(part, own))
    return short & (run.status == "running")


def got_there(progress: Array) -> Array:
    """Which rollouts came as far as they were to, by their progress; those of which it is not known count as such."""
    return ~(progress < ENOUGH)


def _ends(run: Run, task: PathTask) -> bool:
    return bool(np.isfinite(task.s_end)) or _laps(run) > 0


def _laps(run: Run) -> int:
    laps = run.config.get("laps")
    return laps if isinstance(laps, int) else 0


def _of_end(run: Run, task: PathTask) -> Array:
    s = run.array("s")
    if np.isfinite(task.s_end):
        return (_largest(s) - task.s0) / (task.s_end - task.s0)
    assert task.period is not None
    return (_largest(s) - s[:, 0]) / (_laps(run) * task.period)


def _of_going_on(run: Run, task: PathTask) -> Array:
    late, time, s = samples_of(run), run.time, run.array("s")
    rows, last = np.arange(run.rollouts), late.stop - 1
    passed, once = s[rows, last] - s[rows, late.first], np.inf if task.period is None else task.period
    if (passed >= once).all():
        return np.ones(run.rollouts)
    theta = where_known(lambda s: planned_rate(task, s), late.within(s))
    asked = late.reduced(np.mean, theta) * (time[last] - time[late.first])
    wanted = np.minimum(once, _HALF_SPEED * asked)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(wanted > 0, passed / wanted, 1.0)


def _largest(s: Array) -> Array:
    known = np.where(np.isfinite(s), s, -np.inf).max(-1)
    return np.where(np.isfinite(known), known, np.nan)
