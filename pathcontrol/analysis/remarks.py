"""What must not be overlooked in a run: limits that were passed, and arms that did not get there."""

from __future__ import annotations

import numpy as np

from pathcontrol.analysis.limit_shares import RATIOS, is_passed, worst_shares
from pathcontrol.analysis.progress import ENOUGH, progress
from pathcontrol.analysis.window import samples_of
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.config import laws
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import TaskBatch

_STILL = 1e-6  # rad or m, by which an arm that stands still may have moved
_MOST = 3  # rollouts that are named


def remarks(run: Run) -> list[str]:
    """Sentences on a run that a person must not overlook; none where all went well.

    Of several rollouts with the same fault those first in number are named.
    """
    found: dict[str, list[tuple[int, str]]] = {}
    for i in range(run.rollouts):
        for kind, sentence in _of_one(run.rollout(i)).items():
            found.setdefault(kind, []).append((i, sentence))
    return [_gathered(rows, run.rollouts) for rows in found.values()]


def stands_still(run: Run) -> bool:
    """Whether the first rollout did not move in the second half of its time, although it was not where it should be."""
    late = samples_of(run)
    q = run.array("q")[0, late.first[0] : late.stop[0]]
    still = bool(len(q) > 1) and bool((np.ptp(q, axis=0) <= _STILL).all())
    return still and run.status[0] == "running" and _progress(run) < ENOUGH


def remedy(run: Run) -> str:
    """What lets go of an arm that stands still."""
    if _dry(run) and not any(law.get("friction") == "full" for law in laws(run.config)):
        return 'dry friction that the law does not compensate holds it; give the controller friction="full"'
    return "give the controller larger gains, or torque limits that hold and move the arm"


def _of_one(run: Run) -> dict[str, str]:
    """Sentences on a run of one rollout, by what they are about."""
    found = {}
    for name, worst in worst_shares(run, samples_of(run, "all")).items():
        if is_passed(worst.share):
            share = f"{100 * worst.share:.4g} % of its limit"
            found[name] = f"the {RATIOS[name]} of {worst.joint} reached {share}, at {worst.time:.4g} s"
    if run.status[0] == "running" and (done := _progress(run)) < ENOUGH:
        if stands_still(run):
            found["still"] = f"the arm stands still after {100 * done:.3g} % of what was asked for: {remedy(run)}"
        else:
            found["short"] = f"the arm did not get there: it made {100 * done:.3g} % of what was asked for in the time"
    return found


def _progress(run: Run) -> float:
    """That of the first rollout; 1 where it is not known."""
    task = run.task
    if task is None or isinstance(task, TaskBatch) or "s" not in run:
        return 1.0
    done = float(progress(run, task)[0])
    return 1.0 if np.isnan(done) else done


def _dry(run: Run) -> bool:
    """Whether the arm has dry friction, as far as it is known."""
    try:
        robot: RobotModel = run.robot
    except InputError:
        return False
    return any(bool(np.any(level > 0)) for level in robot.friction.levels(np.zeros(robot.n)))


def _gathered(rows: list[tuple[int, str]], rollouts: int) -> str:
    if rollouts == 1:
        return rows[0][1]
    named = ", ".join(str(i) for i, _ in rows[:_MOST]) + (", …" if len(rows) > _MOST else "")
    return f"{len(rows)} of {rollouts} rollouts ({named}): in the first of them {rows[0][1]}"
