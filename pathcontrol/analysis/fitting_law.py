"""Checks that a law which is given for a run is one of its path and of its rollouts."""

from __future__ import annotations

import numpy as np

from pathcontrol.analysis.metric_helpers import is_along
from pathcontrol.control.base import Controller
from pathcontrol.control.law_gains import count_gain_rows
from pathcontrol.control.wrappers.wrapper import unwrap
from pathcontrol.errors import InputError
from pathcontrol.registry import LAWS
from pathcontrol.simulation.run import Run


def refuse_other_rows(run: Run, controller: Controller) -> None:
    """Check that the gains of a law of the library are those of one rollout, or of as many as the run has."""
    known = LAWS.has(type(unwrap(controller)).__name__)
    for name, rows in count_gain_rows(controller).items() if known else ():
        if rows != run.rollouts:
            raise InputError(
                f"{name} of the law has {rows} rows, the run {run.rollouts} rollouts; expected as many, or one value "
                "for all",
                argument=name,
                value=rows,
                limit=run.rollouts,
            )


def refuse_other_path(run: Run, controller: Controller) -> None:
    """Check that a law goes along the path of a run, where both are known."""
    s = run.array("s")
    if not is_along(run.task, controller.task, s[np.isfinite(s)]):
        raise InputError(
            f"{controller!r} goes along another path than the run, {run.task!r}; give a law of that path",
            argument="controller",
            value=controller,
        )
