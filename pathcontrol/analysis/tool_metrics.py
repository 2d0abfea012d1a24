"""Metrics of the tool of a run: its speed beside the feed, its deviation and its orientation."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.deviation import contour_deviation, geometry_of
from pathcontrol.analysis.metric_helpers import root_mean_square
from pathcontrol.analysis.tool_following import tool_signals
from pathcontrol.analysis.window import Samples
from pathcontrol.errors import TaskError
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

_DEVIATION = ("tool_deviation_peak", "tool_deviation_rms")
#: the metrics of :func:`tool_metrics`
NAMES = (*_DEVIATION, "tool_speed_mean", "tool_speed_peak", "feed", "orientation_error_peak")


def tool_metrics(run: Run, task: PathTask, counted: Samples, only: Collection[str] = NAMES) -> dict[str, Array]:
    """Return the metrics of the tool over the samples that count, (rollout,) each; none without a tool.

    Mean and largest speed of the tool, and the mean of the ``feed`` that the path commands at s, all [m/s]; the
    largest and the RMS distance [m] from the curve on which the path leads the tool, or from the drawing of a toolpath,
    see :func:`~pathcontrol.analysis.deviation.geometry_of`; and the largest angle [rad] from the orientation at s, as
    far as the path prescribes it.
    """
    if set(only).isdisjoint(NAMES):
        return {}
    signals = tool_signals(run, task, *(counted.within(run.array(name)) for name in ("s", "q", "qd")))
    if signals is None:
        return {}
    from pathcontrol.cartesian.cartesian_path import CartesianPath  # loaded already if there is a tool

    values = {
        "tool_speed_mean": counted.reduce(np.mean, signals.speed),
        "tool_speed_peak": counted.reduce(np.max, signals.speed),
        "feed": counted.reduce(np.mean, signals.feed),
    }
    if isinstance(task, CartesianPath):  # its joints lead the tool at this speed within 0.1 %
        values["feed"] = np.where(np.isnan(values["feed"]), np.nan, task.speed)
    if task.rotations:
        values["orientation_error_peak"] = counted.reduce(np.max, signals.orientation)
    if not set(only).isdisjoint(_DEVIATION):
        with suppress(TaskError):  # an endless path leads the tool on an endless curve
            away = contour_deviation(run, geometry_of(task, run.model), signals.position)
            values |= {"tool_deviation_peak": counted.reduce(np.max, away)}
            values |= {"tool_deviation_rms": counted.reduce(root_mean_square, away)}
    return values
