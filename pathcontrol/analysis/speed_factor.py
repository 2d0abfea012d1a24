"""The factor of the speed along a path at which a plan went in a run."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.metric_helpers import apply_by_task, apply_where_finite
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask


def speed_factor(run: Run, task: PathTask | None = None) -> Array:
    """Return the factor w of the speed along the path that the law went at, (rollout, time).

    The law's desired velocity is wr, with r = q_d'ϑ, and its velocity error e_v = wr − q̇ is in the record; so
    w = rᵀ(e_v + q̇)/‖r‖² for any law. It is 1 for a law that nothing wraps, but where its plan is braked at an end.

    Args:
        run: the run.
        task: path and profile; by default the run's own.

    Raises:
        InputError: no task is known.
    """
    return apply_by_task(_factor, run, task)


def _factor(run: Run, task: PathTask) -> Array:
    """Return the factor for runs of a single task, (rollout, time)."""
    return apply_where_finite(
        lambda s, velocity: _project_on(task.at(s).velocity, velocity),
        run.array("s"),
        run.array("e_v") + run.array("qd_measured"),
    )


def _project_on(r: Array, velocity: Array) -> Array:
    """Return the component of a velocity along r in units of r, (k,)."""
    with np.errstate(invalid="ignore", divide="ignore"):  # ϑ may be 0 at the end of a path
        return np.asarray(np.vecdot(r, velocity) / np.vecdot(r, r))
