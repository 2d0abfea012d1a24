"""The figure of the speed along the path, beside the planned one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol.analysis.metric_helpers import apply_where_finite
from pathcontrol.analysis.tool_following import feed_along, find_tool, tool_speed
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.figures.inset import add_inset
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.limits import extent, over_time, span
from pathcontrol.view.figures.lines import drawable, series
from pathcontrol.view.figures.shown import Runs, Shown, own_robot, shown
from pathcontrol.view.figures.style import COLUMN, PROFILE_LOOK, apply_style, new_figure, style

RATE, PROFILE = r"$\dot{\sigma}$", r"$\vartheta(\sigma)$"
SPEED_LABEL = f"{RATE}, {PROFILE} [1/s]"

FEED_LABEL = "speed of the tool [mm/s]"


def speed_figure(run: Runs, task: PathTask | None = None, rollout: int = 0) -> Figure:
    """Draw the rate σ̇ of the path parameter beside the velocity profile ϑ(σ) [1/s], over time.

    Of paths that were made for a tool, as toolpaths are, the speed of the tool beside the feed of the plan [mm/s].

    Args:
        run: a run, or several by their names.
        task: the path and its profile; by default each run's own, where it knows it.
        rollout: which rollout of each run.

    Raises:
        InputError: there is no such rollout, or runs and task do not belong together.
    """
    runs = shown(run, task, rollout)
    with style():
        figure = new_figure(COLUMN, 2.3)
        axes, of_tool = apply_style(figure.add_subplot()), all(map(_has_tool, runs))
        draw = _draw_feed if of_tool else draw_speed
        drawn, times = [draw(axes, one) for one in runs], [one.run.time for one in runs]
        axes.set(xlabel="time [s]", ylabel=FEED_LABEL if of_tool else SPEED_LABEL, ylim=speed_limits(drawn))
        over_time(axes, times)
        add_inset(axes, times, drawn, lambda inset: [draw(inset, one) for one in runs])
        names = {one.label or ("tool" if of_tool else RATE): Line2D([], [], **one.look) for one in runs}
        profile = (
            {"feed" if of_tool else PROFILE: Line2D([], [], **PROFILE_LOOK)}
            if any(one.task is not None for one in runs)
            else {}
        )
        legend(figure, names | profile)
    return figure


def draw_speed(axes: Axes, one: Shown) -> Array:
    """Draw σ̇ and, where the path is known, ϑ(σ), of the first rollout; return the values, (1 or 2, time)."""
    drawn = [drawable(one.run.array("sdot")[0])]
    series(axes, one.run.time, drawn[0], **one.look)
    if one.task is not None:
        drawn.append(_profile(one.task, drawable(one.run.array("s")[0])))
        series(axes, one.run.time, drawn[1], zorder=2.5, **PROFILE_LOOK)
    return np.array(drawn)


def _has_tool(one: Shown) -> bool:
    """Return whether a run is along a path made for a tool of its arm, whose speed is known."""
    arm = own_robot(one.run)
    return arm is not None and one.task is not None and "qd" in one.run and find_tool(arm, one.task) is not None


def _draw_feed(axes: Axes, one: Shown) -> Array:
    """Draw the speed of the tool and the feed, of the first rollout; return the values, (2, time)."""
    assert one.task is not None
    task, robot = one.task, one.run.robot
    wanted = apply_where_finite(lambda s: feed_along(task, robot, s), one.run.array("s"))
    drawn = [drawable(1e3 * tool_speed(one.run, robot, task)[0]), drawable(1e3 * wanted[0])]
    series(axes, one.run.time, drawn[0], **one.look)
    series(axes, one.run.time, drawn[1], zorder=2.5, **PROFILE_LOOK)
    return np.array(drawn)


def speed_limits(drawn: Sequence[Array]) -> tuple[float, float]:
    """Return limits for all values and zero, so that a share of the speed can be seen."""
    low, high = span([*drawn, np.zeros(1)])
    return (0.0, high) if extent(drawn)[0] >= 0 else (low, high)


def _profile(task: PathTask, s: Array) -> Array:
    """Return ϑ(s) (time,), NaN where s is."""
    known = ~np.isnan(s)
    values = np.full(s.shape, np.nan)
    values[known] = task.theta(s[known])
    return drawable(values)
