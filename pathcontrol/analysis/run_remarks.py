"""Remarks on a run that must not be overlooked: limits passed, and arms that did not get there."""

from __future__ import annotations

import numpy as np

from pathcontrol._expect import expect
from pathcontrol.analysis.limit_shares import RATIOS, find_worst_shares, is_passed
from pathcontrol.analysis.progress import ENOUGH, progress
from pathcontrol.analysis.window import samples_of
from pathcontrol.errors import InputError
from pathcontrol.simulation.checks.friction_knowledge import advise_on_dry_friction
from pathcontrol.simulation.config import laws
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import TaskBatch

_STILL = 1e-6  # rad or m, the largest motion of an arm that stands still
_MOST = 3  # limit of rollouts that are named


def remarks(run: Run) -> list[str]:
    """Return sentences on a run that a person must not overlook; none where all went well.

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
    return _advise_on_friction(run) or "give the controller larger gains, or torque limits that hold and move the arm"


def _find_faults(run: Run) -> dict[str, str]:
    """Return sentences on a run of one rollout, by their kind."""
    found = {}
    for name, worst in find_worst_shares(run, samples_of(run, "all")).items():
        if is_passed(worst.share):
            share = f"{100 * worst.share:.4g} % of its limit"
            found[name] = f"the {RATIOS[name]} of {worst.joint} reached {share}, at {worst.time:.4g} s"
    if run.status[0] == "running" and (done := _progress(run)) < ENOUGH:
        if stands_still(run):
            found["still"] = f"the arm stands still after {100 * done:.3g} % of what was asked for: {remedy(run)}"
        else:
            found["short"] = f"the arm did not get there: it made {100 * done:.3g} % of what was asked for in the time"
    return found | _find_forgotten(run)


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


def _advise_on_friction(run: Run) -> str:
    """Return why dry friction holds the arm, "" where it is not known to."""
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
