"""Remarks on a run that must not be overlooked: limits passed, and arms that did not get there."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.limit_shares import RATIOS, find_worst_shares, is_passed
from pathcontrol.analysis.progress import ENOUGH, progress
from pathcontrol.analysis.run_metrics import end_error, metrics
from pathcontrol.analysis.speed_factor import speed_factor
from pathcontrol.analysis.window import samples_of
from pathcontrol.errors import InputError
from pathcontrol.simulation.checks.friction_knowledge import advise_on_dry_friction
from pathcontrol.simulation.config import laws
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

_STILL = 1e-6  # rad or m, the largest motion of an arm that stands still
_HELD = 1e-6  # of the speed of a profile, at which a plan stands still
_TIMES = 2.0  # limits, from which a share is not said in percent
_NEAR = float(np.deg2rad(2.0))  # rad, within which an arm is at a point of its path: the band of the metrics
_LARGE = 0.05  # of the size of a path, which is near on large ones: no fault of a law that follows roughly
_WHOLE = 0.95  # of the path, below which an arm plainly missed more than the way to it from its start
_SAMPLES = 200  # of a path, for its size and its time
_SLOW = 0.5  # of what was asked for, below which an arm that had the time is held by something
_MOST = 3  # limit of rollouts that are named


def remarks(run: Run) -> list[str]:
    """Return sentences on a run that a person must not overlook; none where all went well.

    They are on limits that were passed, on plans that did not get there in the time, and on arms that did not: those
    still far from the end when the path ended, or near to less than 95 % of it. Near is 2 deg, and on large paths 5 %
    of the largest range of a joint.

    Of several rollouts with the same fault the first ones are named.
    """
    expect("run", run, Run)
    found: dict[str, list[tuple[int, str]]] = {}
    for i in range(run.rollouts):
        for kind, sentence in _find_faults(run.rollout(i)).items():
            found.setdefault(kind, []).append((i, sentence))
    return [_gather(rows, run.rollouts) for rows in found.values()]


def stands_still(run: Run) -> bool:
    """Return whether the first rollout stood still in the second half of its time before it got there."""
    late = samples_of(run)
    q = run.array("q")[0, late.first[0] : late.stop[0]]
    still = bool(len(q) > 1) and bool((np.ptp(q, axis=0) <= _STILL).all())
    return still and run.status[0] == "running" and _progress(run) < ENOUGH


def remedy(run: Run) -> str:
    """Return advice for an arm that stands still."""
    if _is_held(run):
        return "an operator's input or a contact holds its plan, or sends it back"
    return advise_on_friction(run) or "give the controller larger gains, or torque limits that hold and move the arm"


def _is_held(run: Run) -> bool:
    """Return whether the plan of the first rollout was held at the end by what wraps its law, or went back."""
    wrapped = bool(laws(run.config)[-1].get("wrappers"))
    return wrapped and bool(speed_factor(run)[0, -1] <= _HELD)


def _find_faults(run: Run) -> dict[str, str]:
    """Return sentences on a run of one rollout, by their kind."""
    found = {}
    for name, worst in find_worst_shares(run, samples_of(run, "all")).items():
        if is_passed(worst.share):
            found[name] = (
                f"the {RATIOS[name]} of {worst.joint} reached {_say_share(worst.share)}, at {worst.time:.4g} s"
            )
    if run.status[0] == "running" and (done := _progress(run)) < ENOUGH:
        if stands_still(run):
            found["still"] = f"the arm stands still after {100 * done:.3g} % of what was asked for: {remedy(run)}"
        else:
            made = f"the arm did not get there: it made {100 * done:.3g} % of what was asked for in the time"
            found["short"] = ": ".join(filter(None, (made, _advise_slow(run, done))))
    elif run.status[0] != "diverged":
        found |= _find_missed(run)
    return found | _find_forgotten(run)


def _advise_slow(run: Run, done: float) -> str:
    """Return what helps an arm that moved but did not get there, in a run of one rollout; "" where it is not known."""
    needed = _planned_time(run)
    if needed > run.time[-1]:
        return f"by its profile the path takes {needed:.3g} s, which needs a longer duration than {run.time[-1]:.4g} s"
    return advise_on_friction(run) if done < _SLOW and not _is_held(run) else ""


def _planned_time(run: Run) -> float:
    """Return the time [s] that the path takes by ϑ from where it began, or the laps asked for; 0 if unknown."""
    task = run.task
    if task is None or isinstance(task, TaskBatch) or laws(run.config)[-1].get("wrappers"):
        return 0.0
    asked = run.config.get("laps")
    laps = 1 if task.period is None else asked if isinstance(asked, int) else 0
    begin = float(run.array("s")[0, 0]) if task.period is None else task.s0
    end = task.s_end if task.period is None else task.s0 + task.period
    if not laps or not np.isfinite(end):
        return 0.0
    s = begin + (end - begin) * 0.5 * (1 - np.cos(np.linspace(0, np.pi, _SAMPLES)))  # dense at the ends, often slow
    theta = task.theta(s) + np.zeros_like(s)
    return laps * float((2 * np.diff(s) / (theta[:-1] + theta[1:])).sum())  # exact where ϑ² is linear, as from rest


def _say_share(share: float) -> str:
    """Return a share of a limit in words."""
    return f"{100 * share:.4g} % of its limit" if share < _TIMES else f"{share:.3g} times its limit"


def _find_missed(run: Run) -> dict[str, str]:
    """Return sentences on a path whose plan was done but not by the arm, in a run of one rollout."""
    task = run.task
    if task is None or isinstance(task, TaskBatch) or "s" not in run or "q" not in run:
        return {}
    near = max(_NEAR, _LARGE * _size(task))
    if (away := _away_at_end(run, task)) > near:
        return {"end": f"the path ended, the arm was still {_say_distance(run, away)} from its end"}
    if (share := _coverage(run, task, near)) < _WHOLE:
        said = _say_distance(run, near)
        return {"coverage": f"the arm came within {said} of only {100 * share:.3g} % of its path"}
    return {}


def _size(task: PathTask) -> float:
    """Return the largest range of a joint [rad] along a path; 0 where it goes on for ever."""
    if task.period is None and not np.isfinite(task.s_end):
        return 0.0
    return float(np.ptp(task.q_d(np.linspace(*task.one_traverse, _SAMPLES)), axis=0).max())


def _away_at_end(run: Run, task: PathTask) -> float:
    """Return how far [rad] the arm was from the end of an open path when its plan was there; 0 where it was not."""
    if not np.isfinite(task.s_end):
        return 0.0
    if run.status[0] == "finished":
        return float(end_error(run, task)[0])
    return float(np.linalg.norm(np.asarray(task.q_d(np.array(task.s_end))) - run.array("q")[0, -1]))


def _coverage(run: Run, task: PathTask, near: float) -> float:
    """Return the share of its path that the arm came near to; 1 where it was not to pass all of it."""
    s = run.array("s")[0]
    once = task.s_end - task.s0 if task.period is None else task.period
    if not _passed(s) >= ENOUGH * once or not np.isfinite(once):
        return 1.0
    return float(metrics(run, task, band=near, only=("coverage",)).get("coverage", [1.0])[0])


def _passed(s: Array) -> float:
    """Return how far a path parameter (k,) went."""
    known = s[np.isfinite(s)]
    return float(np.ptp(known)) if known.size else 0.0


def _say_distance(run: Run, distance: float) -> str:
    """Return a distance in the space of the joints in words."""
    return f"{np.rad2deg(distance):.3g} deg" if run.unit("q") == "rad" else f"{distance:.3g} {run.unit('q')}"


def _find_forgotten(run: Run) -> dict[str, str]:
    """Return a sentence on a law that forgot what it had learned, in a run of one rollout."""
    count = int(run.array("forgotten")[0]) if "forgotten" in run else 0
    if not count:
        return {}
    when = f"at {run.array('forgotten_time')[0]:.4g} s" + ("" if count == 1 else f", the last of {count} times")
    return {"forgotten": f"what the law had learned no longer fitted, and was forgotten {when}: is the load another?"}


def _progress(run: Run) -> float:
    """Return the progress of the first rollout; 1 where it is not known."""
    task = run.task
    if task is None or isinstance(task, TaskBatch) or "s" not in run:
        return 1.0
    done = float(progress(run, task)[0])
    return 1.0 if np.isnan(done) else done


def advise_on_friction(run: Run) -> str:
    """Return why dry friction holds an arm that hardly moves, and what helps; "" where it is not known to."""
    try:
        arm, model = run.robot, run.model
    except InputError:
        return ""
    modes = [str(law.get("friction")) for law in laws(run.config)]
    return advise_on_dry_friction(modes, model.friction, arm.friction)


def _gather(rows: list[tuple[int, str]], rollouts: int) -> str:
    """Return one sentence for several rollouts with the same fault."""
    if rollouts == 1:
        return rows[0][1]
    named = ", ".join(str(i) for i, _ in rows[:_MOST]) + (", …" if len(rows) > _MOST else "")
    return f"{len(rows)} of {rollouts} rollouts ({named}): in the first of them {rows[0][1]}"
