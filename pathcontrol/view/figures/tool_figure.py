"""The figure of the tool in the plane in which its path extends most, in millimetres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.engine.frame_kinematics import frame_poses
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.view.default_tool import with_tool
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.limits import aspect, equal_plane, extent
from pathcontrol.view.figures.lines import curve, drawable
from pathcontrol.view.figures.shown import Runs, Shown, cutting, path_parameters, shown
from pathcontrol.view.figures.style import (
    COLUMN,
    DESIRED_LOOK,
    GREY,
    INK,
    SMALL,
    START_LOOK,
    apply_style,
    error_colours,
    new_figure,
    style,
)
from pathcontrol.view.figures.ticks import label_plainly

_AXES = "xyz"
_MOST_POSES = 50_000
_MOST_PIECES = 4000
_RAPID = (0, (4, 3))


class ToolPositions(NamedTuple):
    """The actual and the desired positions of a tool, in the robot's base frame [m].

    Attributes:
        taken: (k, 3).
        cutting: whether that counts (k,): it is on no rapid.
        desired: pieces of the path, each (m, 3), with whether it is a rapid.
    """

    taken: Array
    cutting: NDArray[np.bool_]
    desired: list[tuple[Array, bool]]

    @property
    def deviation(self) -> Array:
        """The distance of the tool from its path [m], (k,), NaN where it is not known."""
        distance = np.full(len(self.taken), np.nan)
        known = ~np.isnan(self.taken).any(-1)
        lines = [Polyline(points) for points, _ in self.desired if len(points) > 1 and np.ptp(points, axis=0).max() > 0]
        if lines:
            distance[known] = np.min([line.distance(self.taken[known]) for line in lines], axis=0)
        return distance


def tool_figure(
    run: Runs,
    robot: RobotModel | None = None,
    task: PathTask | None = None,
    *,
    tool: str | None = None,
    errors: bool = False,
    rollout: int = 0,
) -> Figure:
    """Draw the tool's path [mm] in the robot's base frame, desired and actual, in its two widest axes.

    Args:
        run: a run, or several by their names.
        robot: the arm; by default each run's own.
        task: the path; by default each run's own, where it knows it.
        tool: the frame that is drawn; by default the one that the path was made for, or the end of the robot's longest
            limb.
        errors: colour the path taken by its distance from the desired one; for one run.
        rollout: which rollout of each run.

    Raises:
        InputError: a run knows no robot and none is given, or runs, robot and task do not belong together.
        UnknownNameError: the robot has no frame ``tool``.
    """
    runs = shown(run, task, rollout)
    ways = [_tool_path(one, robot, tool) for one in runs]
    points = [p for way in ways for p in (way.taken, *(piece for piece, _ in way.desired))]
    i, j = wide_axes(points)
    limits = equal_plane([1e3 * p[:, i] for p in points], [1e3 * p[:, j] for p in points])
    with style():
        bar = 0.55 if errors and len(runs) == 1 else 0.0
        figure = new_figure(COLUMN, 0.75 + (2.8 - bar) * aspect(limits))
        axes = apply_style(figure.add_subplot(aspect="equal"))
        axes.set(xlim=limits[0], ylim=limits[1], xlabel=f"{_AXES[i]} [mm]", ylabel=f"{_AXES[j]} [mm]")
        entries: dict[str, Line2D] = {}
        desired: dict[str, Line2D] = {}
        for way in ways:
            desired |= _draw_desired(axes, way, i, j)
        for one, way in zip(runs, ways, strict=True):
            taken = 1e3 * way.taken[:, [i, j]]
            if bar and way.desired:
                draw_coloured_line(figure, axes, taken, way.deviation, way.cutting)
            else:
                _draw_taken(axes, taken, way.cutting, one)
                entries[one.label or "tool"] = Line2D([], [], **one.look)
            axes.plot(*taken[:1].T, color=INK if bar else one.colour, **START_LOOK)
        legend(figure, entries | desired | {"start": Line2D([], [], color=INK, linestyle="", **START_LOOK)})
    return figure


def _draw_taken(axes: Axes, taken: Array, cutting: NDArray[np.bool_], one: Shown) -> None:
    """Draw the path taken (k, 2): rapids in dashes, with the steps that lead to them and from them."""
    rapid = ~cutting
    if not rapid.any():
        curve(axes, *taken.T, **one.look)
        return
    rapid[:-1] |= ~cutting[1:]
    rapid[1:] |= ~cutting[:-1]
    curve(axes, *np.where(cutting[:, None], taken, np.nan).T, **one.look)
    curve(axes, *np.where(rapid[:, None], taken, np.nan).T, color=one.colour, linewidth=0.7, linestyle=_RAPID)


def draw_coloured_line(figure: Figure, axes: Axes, way: Array, deviation: Array, cutting: Array) -> None:
    """Draw a line (k, 2) coloured by a distance [m], (k,), with its scale; grey where not ``cutting`` (k,).

    Each of the pieces that a long line is drawn in has the colour of the largest distance on it.
    """
    starts = np.arange(0, max(len(way) - 1, 1), max(1, -(-len(way) // _MOST_PIECES)))
    worst = np.fmax.reduceat(deviation, starts)
    counts = np.logical_and.reduceat(cutting, starts) & np.isfinite(worst)
    ends = np.append(starts[1:], len(way) - 1)
    pieces = np.stack([way[starts], way[ends]], axis=1)
    factor, unit = distance_unit(worst[counts])
    axes.add_collection(LineCollection(list(pieces[~counts]), colors=GREY, linewidths=0.5), autolim=False)
    lines = LineCollection(list(pieces[counts]), cmap=error_colours(), linewidths=1.5, capstyle="round")
    lines.set_array(factor * worst[counts])
    lines.set_clim(0, factor * extent([worst[counts]])[1] or 1.0)
    axes.add_collection(lines, autolim=False)
    bar = figure.colorbar(lines, cax=axes.inset_axes((1.03, 0.0, 0.035, 1.0)))
    bar.set_label(f"distance [{unit}]")
    bar.outline.set_visible(False)
    label_plainly(bar.ax.yaxis)
    bar.ax.tick_params(labelsize=SMALL, width=0.7, length=2.5, pad=2.5)


def distance_unit(distance: Array) -> tuple[float, str]:
    """Return a factor for distances [m] and the unit it gives: micrometres below a millimetre."""
    return (1e6, "µm") if extent([distance])[1] < 1e-3 else (1e3, "mm")


def wide_axes(points: Sequence[Array]) -> tuple[int, int]:
    """Return the indices of the two axes in which points (k, 3) extend most, in their order."""
    sizes = [high - low for low, high in (extent([p[:, k] for p in points]) for k in range(3))]
    i, j = sorted(np.argsort(-np.array(sizes), kind="stable")[:2])
    return int(i), int(j)


def _tool_path(one: Shown, robot: RobotModel | None, tool: str | None) -> ToolPositions:
    """Return the positions of the tool of a run."""
    robot = one.run.robot if robot is None else robot
    expect("robot", robot, RobotModel)
    robot, frame = with_tool(robot, one.task, tool)
    q = drawable(one.run.array("q")[0])
    some = slice(None, None, -(-len(q) // _MOST_POSES))
    return ToolPositions(_positions(robot, q[some], frame), cutting(one)[some], _desired(one, robot, frame))


def _positions(robot: RobotModel, q: Array, frame: str) -> Array:
    """Return the positions of a frame (k, 3) at q (k, n); NaN where q is not finite."""
    x, known = np.full((len(q), 3), np.nan), ~np.isnan(q).any(-1)
    x[known] = frame_poses(robot, q[known], [frame])[:, 0, :3, 3]
    return x


def _rapids(task: PathSequence) -> list[bool]:
    """Return which paths of a task are rapids."""
    return [contour.rapid for contour in task.contours] if isinstance(task, ToolpathTask) else [False] * len(task)


def _desired(one: Shown, robot: RobotModel, frame: str) -> list[tuple[Array, bool]]:
    """Return the desired paths of the tool, and whether each is a rapid."""
    if one.task is None:
        return []
    s = path_parameters(one)
    x = _positions(robot, one.task.q_d(s), frame)
    if not isinstance(one.task, PathSequence):
        return [(x, False)]
    bounds = np.searchsorted(s, one.task.starts)
    return [(x[a : b + 1], rapid) for a, b, rapid in zip(bounds[:-1], bounds[1:], _rapids(one.task), strict=True)]


def _draw_desired(axes: Axes, way: ToolPositions, i: int, j: int) -> dict[str, Line2D]:
    """Draw the desired path."""
    lines = {}
    for points, rapid in way.desired:
        thin = {"linewidth": 0.7, "linestyle": _RAPID} if rapid else {}
        lines["rapid" if rapid else "desired path"] = curve(axes, *(1e3 * points[:, [i, j]].T), **DESIRED_LOOK | thin)
    return dict(sorted(lines.items()))
