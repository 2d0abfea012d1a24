"""Figures of how near the tool came to its drawing. Millimetres and micrometres, where a person reads."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from pathcontrol._arrays import Array
from pathcontrol.analysis.deviation import tool_deviation, tool_positions
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.view.figures.style import GREY, ORANGE, style
from pathcontrol.view.figures.toolpath import outline, plan_figure

_COLOURS = "viridis"
_MOST_PIECES = 4000


def deviation_figure(run: Run, robot: RobotModel, task: ToolpathTask, rollout: int = 0) -> Figure:
    """The tool's way over the drawing, seen on the workpiece, coloured by its distance from it; and that over time.

    Only cuts are coloured: between them the tool has no drawing to keep to.
    """
    run = run.rollout(rollout)
    deviation = 1e6 * tool_deviation(run, robot, task.frame, task.contours)[0]
    cutting = np.array([not contour.rapid for contour in task.contours])[run["path_index"].to_numpy()]
    with style():
        figure, (plan, below), (i, j) = plan_figure(task.drawing, extra=1.6)
        for contour in task.drawing.cuts:
            plan.plot(*(1e3 * outline(contour)[:, [i, j]].T), color=GREY, linewidth=3.0, alpha=0.4)
        way = 1e3 * _on_workpiece(tool_positions(run, robot, task.frame)[0], task.workpiece)[:, [i, j]]
        _coloured(figure, plan, way, deviation, cutting)
        _over_time(below, run.time, np.where(cutting, deviation, np.nan))
    return figure


def _on_workpiece(x: Array, pose: Array) -> Array:
    """Points (k, 3) of the base frame in the workpiece's."""
    return (x - pose[:3, 3]) @ pose[:3, :3]


def _coloured(figure: Figure, axes: Axes, way: Array, deviation: Array, cutting: Array) -> None:
    some = np.arange(0, len(way), -(-len(way) // _MOST_PIECES))
    way, deviation, cutting = way[some], deviation[some], cutting[some]
    pieces = np.stack([way[:-1], way[1:]], axis=1)
    cut = cutting[:-1] & cutting[1:]
    axes.add_collection(LineCollection(list(pieces[~cut]), colors=GREY, linewidths=0.5))
    lines = LineCollection(list(pieces[cut]), cmap=_COLOURS, linewidths=1.4)
    lines.set_array(deviation[:-1][cut])
    axes.add_collection(lines)
    axes.autoscale_view()
    figure.colorbar(lines, ax=axes, label="distance [µm]", fraction=0.05, pad=0.02)


def _over_time(axes: Axes, time: Array, deviation: Array) -> None:
    peak = np.nanmax(deviation)
    axes.plot(time, deviation, linewidth=0.8)
    axes.axhline(peak, color=ORANGE, linewidth=0.9, linestyle=(0, (4, 2)))
    axes.set_title(f"largest over the cuts {peak:.3g} µm", fontsize=8, color=ORANGE, loc="right", pad=3)
    axes.set(xlabel="time [s]", ylabel="distance [µm]", xlim=(time[0], time[-1]), ylim=(0, 1.15 * peak))
