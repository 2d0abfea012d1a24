"""The figure of the deviation of the tool from its drawing, in millimetres and micrometres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.deviation import contour_deviation, tool_positions
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.limits import extent, from_zero, over_time
from pathcontrol.view.figures.lines import curve, drawable, series
from pathcontrol.view.figures.shown import Runs, Shown, shown
from pathcontrol.view.figures.style import GREY, INK, PEAK_LOOK, SMALL, apply_style, style
from pathcontrol.view.figures.tool_figure import distance_unit, draw_coloured_line
from pathcontrol.view.figures.toolpath_figure import outline, plan_figure


def deviation_figure(
    run: Runs, robot: RobotModel | None = None, task: ToolpathTask | None = None, rollout: int = 0
) -> Figure:
    """Draw the tool's path over the drawing, coloured by its distance from it, and that distance over time.

    Only cuts count: between them the tool has no drawing to keep to. Several runs have a colour each instead.

    Args:
        run: a run along a toolpath, or several along the same one by their names.
        robot: the arm; by default each run's own.
        task: the toolpath; by default the runs' own.
        rollout: which rollout of each run.

    Raises:
        InputError: a run is along no toolpath, or it knows neither robot nor task and they are not given.
    """
    runs = shown(run, task, rollout)
    toolpath = _toolpath(runs)
    with style():
        figure, (plan, below), (i, j) = plan_figure(toolpath.drawing, extra=1.6)
        for contour in toolpath.drawing.cuts:
            plan.plot(*(1e3 * outline(contour)[:, [i, j]].T), color=GREY, linewidth=3.0, alpha=0.4)
        plan.autoscale_view()
        distances = []
        for one in runs:
            way, distance, cutting = _measure(one, robot)
            way = 1e3 * way[:, [i, j]]
            if len(runs) == 1:
                draw_coloured_line(figure, plan, way, distance, cutting)
            else:
                curve(plan, *np.where(cutting[:, None], way, np.nan).T, linewidth=0.8, **one.look)
            distances.append(np.where(cutting, distance, np.nan))
        _over_time(apply_style(below), runs, distances)
        legend(figure, {one.label: Line2D([], [], **one.look) for one in runs if one.name})
    return figure


def _toolpath(runs: Sequence[Shown]) -> ToolpathTask:
    """Return the toolpath that all runs follow."""
    for one in runs:
        if not isinstance(one.task, ToolpathTask):
            name = f" {one.name!r}" if one.name else ""
            raise InputError(
                f"the run{name} is not known to follow a toolpath; give task=ToolpathTask(...)",
                argument="task",
                value=one.task,
            )
    assert isinstance(runs[0].task, ToolpathTask)
    return runs[0].task


def _measure(one: Shown, robot: RobotModel | None) -> tuple[Array, Array, Array]:
    """Return the tool's path (k, 3) in the workpiece's frame, its distance (k,) [m], and whether it cuts."""
    task, robot = one.task, one.run.robot if robot is None else robot
    expect("robot", robot, RobotModel)
    assert isinstance(task, ToolpathTask)
    position = tool_positions(one.run, robot, task.frame)
    way = (position[0] - task.workpiece[:3, 3]) @ task.workpiece[:3, :3]
    distance = drawable(contour_deviation(one.run, task.contours, position)[0])
    cutting = np.array([not contour.rapid for contour in task.contours])[one.run.array("path_index")]
    return way, distance, cutting


def _over_time(axes: Axes, runs: Sequence[Shown], distances: Sequence[Array]) -> None:
    """Draw the distance over time."""
    factor, unit = distance_unit(np.concatenate(distances))
    values = [factor * distance for distance in distances]
    for one, v in zip(runs, values, strict=True):
        series(axes, one.run.time, v, linewidth=0.8, **one.look)
        axes.axhline(extent([v])[1], color=one.colour if one.name else INK, **PEAK_LOOK)
    peaks = ", ".join(f"{extent([v])[1]:.3g}" for v in values)
    axes.set_title(f"largest over the cuts {peaks} {unit}", fontsize=SMALL, loc="right", pad=3)
    axes.set(xlabel="time [s]", ylabel=f"distance [{unit}]")
    from_zero(axes, values, 1.15)
    over_time(axes, [one.run.time for one in runs])
