"""Checks of the domain of a path, and of the choice between a speed and a profile."""

from __future__ import annotations

from typing import Any

import numpy as np

from pathcontrol._arrays import as_array, as_scalar
from pathcontrol.errors import InputError
from pathcontrol.tasks.task import PathTask


def take_domain(task: PathTask, s0: Any, s_end: Any, period: Any) -> None:
    """Set s0, s_end and period of ``task`` from any kind of number, such as 2π of sympy.

    Raises:
        InputError: the domain is empty, begins at infinity, or both ends and repeats.
    """
    task.s0 = as_scalar("s0", s0)
    if period is not None:
        task.period = as_scalar("period", period, positive=True)
    end = as_array("s_end", s_end)
    if end.ndim != 0 or not end > task.s0:
        raise InputError(
            f"s0 = {task.s0:g} and s_end = {s_end}, expected a number s_end > s0",
            argument="s_end",
            value=s_end,
            limit=task.s0,
        )
    if end == np.inf:
        return
    task.s_end = float(end)
    if task.period is not None:
        raise InputError(
            f"period = {task.period:g} and s_end = {task.s_end:g} are both given, expected one: a closed path has a "
            "period and goes on for ever, an open one has an s_end",
            argument="s_end",
            value=s_end,
        )


def refuse_two_rates(speed: Any, theta: Any) -> None:
    """Check that exactly one of ``speed`` and ``theta`` is given.

    Raises:
        InputError: both or none are given.
    """
    if (speed is None) == (theta is None):
        both = "neither speed nor theta is" if speed is None else "speed and theta are both"
        raise InputError(
            f"{both} given, expected one: speed [rad/s] for a constant path speed, theta for a profile ϑ(s)",
            argument="speed",
            value=speed,
        )
