"""The figure of the reach of a path: the tube in which nearest points are unique, and what limits it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pathcontrol._arrays import Array
from pathcontrol.analysis.path_reach import Reach, reach
from pathcontrol.analysis.readable import reading
from pathcontrol.geometry.arc_length import curvature_vector
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.figures.lettering import joint_label, legend, plain
from pathcontrol.view.figures.limits import equal_plane
from pathcontrol.view.figures.lines import drawable
from pathcontrol.view.figures.style import COLUMN, DASHED, GREY, INK, ORANGE, Look, apply_style, new_figure, style

_SAMPLES = 2001
_TURN = np.linspace(0.0, 2 * np.pi, 181)
_TUBE: Look = {"color": "#D3E3F0", "linewidth": 0.0}
_LIMIT: Look = {"color": ORANGE, "linewidth": 1.3}
_MOST = 100.0  # times the reach, up to which radii of curvature are drawn


def reach_figure(task: PathTask, robot: RobotModel | None = None) -> Figure:
    """Draw a path with the tube of its reach and what limits that, and below it its radius of curvature along s.

    The tube, and the circle of curvature or the bottleneck, are drawn in the plane of the two joints that move the
    most: of two joints it is the tube, of more a shadow of it.

    Args:
        task: the path.
        robot: the arm, which names the joints.

    Raises:
        TaskError: the path neither ends nor repeats, or does not move somewhere.
        InputError: it is a batch or a sequence of paths.
    """
    found, s = reach(task, robot), np.linspace(*task.one_traverse, _SAMPLES)
    factor, unit = reading("m" if found.unit == "m" else "rad", task.q_d(s))
    names = [f"joint_{i + 1}" for i in range(task.n)] if robot is None else list(robot.joint_names)
    with style():
        figure = new_figure(COLUMN, 2.0 if task.n == 1 else 4.6)
        entries: dict[str, Line2D | Patch] = {}
        if task.n > 1:
            upper, lower = figure.subplots(2, 1, height_ratios=(2.4, 1.0))
            entries = _draw_plane(apply_style(upper), task, found, s, (factor, unit, names))
        else:
            lower = figure.add_subplot()
        _draw_radii(apply_style(lower), task, found, s, (factor, unit))
        legend(figure, entries)
    return figure


def _draw_plane(
    axes: Axes, task: PathTask, found: Reach, s: Array, words: tuple[float, str, list[str]]
) -> dict[str, Line2D | Patch]:
    """Draw the path, its tube and its limit in a plane; return the entries of the legend."""
    factor, unit, names = words
    points = task.q_d(s)
    pair = sorted(np.argsort(-np.ptp(points, axis=0), kind="stable")[:2].tolist())
    x, y = factor * drawable(points[:, pair]).T
    entries: dict[str, Line2D | Patch] = {}
    width = factor * found.value
    outline = [x, y] if not np.isfinite(width) else [np.r_[x - width, x + width], np.r_[y - width, y + width]]
    limits = equal_plane([outline[0]], [outline[1]])
    if 0 < width < np.inf:
        ring = width * np.stack([np.cos(_TURN[::6]), np.sin(_TURN[::6])], axis=-1)
        discs = np.stack([x, y], axis=-1)[::4, None] + ring
        axes.add_collection(PolyCollection(list(discs), rasterized=True, zorder=1.0, **_TUBE))
        said = f"within the reach, {width:.4g} {unit}"
        entries[plain(said)] = Patch(**_TUBE)
    axes.plot(x, y, color=GREY, linewidth=2.0)
    if found.limit != "none":
        entries |= _draw_limit(axes, task, found, factor, pair)
    axes.set(xlim=limits[0], ylim=limits[1], aspect="equal")
    labels = [f"{joint_label(joint, names)} [{unit}]" for joint in pair]
    axes.set(xlabel=labels[0], ylabel=labels[1])
    return {"path": Line2D([], [], color=GREY, linewidth=2.0)} | entries


def _draw_limit(axes: Axes, task: PathTask, found: Reach, factor: float, pair: list[int]) -> dict[str, Line2D | Patch]:
    """Draw the circle of the least curvature or the bottleneck; return the entry of the legend."""
    ends = np.array([found.s, found.other])
    here = task.q_d(ends)[:, pair]
    if found.limit == "bottleneck":
        middle, radius = here.mean(0), found.value
        axes.plot(*(factor * here.T), marker="o", markersize=3.0, **_LIMIT)
    else:
        bend = curvature_vector(task.dq_d(ends), task.ddq_d(ends))[0]
        middle, radius = here[0] + (bend / (bend @ bend))[pair], found.radius
        axes.plot(*(factor * here[0]), marker="o", markersize=3.5, color=ORANGE)
    axes.plot(*(factor * (middle[:, None] + radius * np.stack([np.cos(_TURN), np.sin(_TURN)]))), **_LIMIT)
    label = "circle of curvature" if found.limit == "curvature" else "bottleneck"
    return {label: Line2D([], [], **_LIMIT)}


def _draw_radii(axes: Axes, task: PathTask, found: Reach, s: Array, words: tuple[float, str]) -> None:
    """Draw the radius of curvature along s, and the reach."""
    factor, unit = words
    s = np.unique(np.r_[s, found.radius_s])
    with np.errstate(divide="ignore"):
        radius = 1 / np.linalg.norm(curvature_vector(task.dq_d(s), task.ddq_d(s)), axis=-1)
    least = found.value if 0 < found.value < np.inf else found.radius
    axes.plot(s, factor * np.where(radius < _MOST * least, radius, np.nan), color=INK)
    if 0 < found.value < np.inf:
        axes.axhline(factor * found.value, color=ORANGE, linestyle=DASHED, linewidth=0.9)
    axes.set_yscale("log")
    apply_style(axes)
    axes.set(xlabel="s", ylabel=f"radius [{unit}]", xlim=(s[0], s[-1]))
