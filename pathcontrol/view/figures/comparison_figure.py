"""The figure of several runs side by side on the same axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.figures.error_figures import draw_norm, norm_label, norms
from pathcontrol.view.figures.inset import later
from pathcontrol.view.figures.lettering import legend, plain
from pathcontrol.view.figures.limits import aspect, extent, over_time
from pathcontrol.view.figures.lines import series
from pathcontrol.view.figures.path_figures import choose_pair, draw_path, label_plane, plane_limits
from pathcontrol.view.figures.shown import Shown, check_joints, shown
from pathcontrol.view.figures.speed_figure import PROFILE, SPEED_LABEL, draw_speed, speed_limits
from pathcontrol.view.figures.style import COLUMN, LIMIT_LOOK, PAGE, PROFILE_LOOK, SMALL, apply_style, new_figure, style
from pathcontrol.view.figures.torque_figure import torque_limits, torque_share

_COLUMN = 1.75  # in, of a run where there are many
_HEIGHT = 1.1  # in, of a row over time
_PLANE = (1.0, 3.0)  # in, least and largest height of the row with the paths
_BEGINNING, _DWARFED = 0.1, 0.5  # shares of the time, and of the range


class _Row(NamedTuple):
    """A quantity over time, one run in each column.

    Attributes:
        label: with its unit.
        draw: draws it and gives what was drawn, (lines, time).
        limits: the axis that holds what was drawn in all columns.
        cut: whether the axis may end below what happens at the beginning.
    """

    label: str
    draw: Callable[[Axes, Shown], Array]
    limits: Callable[[Sequence[Array]], tuple[float, float]]
    cut: bool = True


def comparison_figure(
    run: Mapping[str, Run],
    task: PathTask | None = None,
    joints: tuple[int, int] | None = None,
    limits: ArrayLike | None = None,
    rollout: int = 0,
) -> Figure:
    """Draw a column for each run, a row for each quantity, and the same axes all along a row.

    The path in the plane of two joints, ‖e_p‖, ‖e_v‖, the rate σ̇ beside ϑ(σ), and the largest torque of all joints as
    a share of its limit. Where the first tenth of the time dwarfs the rest in all columns, the axis ends above the
    rest, and an arrow in each column says how far its line goes.

    Args:
        run: runs of one arm by their names.
        task: the path; by default each run's own, where it knows it.
        joints: the two joints of the plane; by default the two that move the most. An arm of one joint has no plane.
        limits: largest torques (n,); by default those clamped to, else the robot's. Without any there is no row.
        rollout: which rollout of each run.

    Raises:
        InputError: the runs are of different joints, there is no such rollout, or runs and task do not belong together.
    """
    runs = shown(run, task, rollout)
    pair = choose_pair(runs, joints) if len(check_joints(runs)) > 1 else None
    rows, width = _rows(runs, limits), COLUMN if len(runs) == 1 else max(PAGE, _COLUMN * len(runs))
    heights = ([] if pair is None else [_plane_height(runs, pair, width)]) + [_HEIGHT] * len(rows)
    with style():
        figure = new_figure(width, 0.7 + sum(heights) + 0.12 * len(heights))
        places = figure.add_gridspec(len(heights), len(runs), height_ratios=heights)
        grid = [[apply_style(figure.add_subplot(places[r, c])) for c in range(len(runs))] for r in range(len(heights))]
        entries = {} if pair is None else _draw_planes(grid[0], runs, pair)
        for row, axes in zip(rows, grid[-len(rows) :], strict=True):
            _draw_row(row, axes, runs)
        _label(grid, runs, len(rows), width / len(runs) - 0.4)
        figure.align_ylabels()
        bounded = {"limit": Line2D([], [], **LIMIT_LOOK)} if len(rows) > _SPEED else {}
        known = {PROFILE: Line2D([], [], **PROFILE_LOOK)} if any(one.task is not None for one in runs) else {}
        legend(figure, entries | known | bounded)
    return figure


_SPEED = 3  # rows without that of the torques


def _rows(runs: Sequence[Shown], limits: ArrayLike | None) -> list[_Row]:
    """Return the rows of the figure."""
    rows = [_norm_row(runs[0], name) for name in ("e_p", "e_v")]
    rows.append(_Row(SPEED_LABEL, draw_speed, speed_limits))
    largest = [torque_limits(one, limits) for one in runs]
    if not any(np.isfinite(one).any() for one in largest):
        return rows
    of_run = {id(one.run): torques for one, torques in zip(runs, largest, strict=True)}

    def draw_share(axes: Axes, one: Shown) -> Array:
        share = torque_share(one, of_run[id(one.run)])
        series(axes, one.run.time, share, **one.look)
        axes.axhline(100.0, **LIMIT_LOOK)
        return share[None]

    return [
        *rows,
        _Row(r"$|\tau|$ / limit [%]", draw_share, lambda drawn: (0.0, max(110.0, 1.1 * extent(drawn)[1])), False),
    ]


def _norm_row(one: Shown, name: str) -> _Row:
    """Return the row of an error norm."""
    return _Row(
        norm_label(name, norms(one, name)[1]),
        lambda axes, one: draw_norm(axes, one, name),
        lambda drawn: (0.0, 1.1 * extent(drawn)[1] or 1.0),
    )


def _draw_row(row: _Row, axes: Sequence[Axes], runs: Sequence[Shown]) -> None:
    """Draw a row."""
    drawn = [row.draw(panel, one) for panel, one in zip(axes, runs, strict=True)]
    rest = [values[:, later(one.run.time, _BEGINNING)] for values, one in zip(drawn, runs, strict=True)]
    (low, high), (least, most) = row.limits(drawn), row.limits(rest)
    if row.cut and most - least < _DWARFED * (high - low):
        low, high = least, most
    for panel, values in zip(axes, drawn, strict=True):
        panel.set_ylim(low, high)
        over_time(panel, [one.run.time for one in runs])
        _label_excess(panel, values)
    axes[0].set_ylabel(row.label)


def _label_excess(axes: Axes, values: Array) -> None:
    """Write above the panel how far lines go that leave it."""
    (low, high), (least, most) = axes.get_ylim(), extent([values])
    words = [f"↑ {most:.3g}"] * bool(most > high) + [f"↓ {least:.3g}"] * bool(least < low)
    axes.annotate("  ".join(words), (0.0, 1.0), (2, 1), "axes fraction", "offset points", fontsize=SMALL)


def _draw_planes(axes: Sequence[Axes], runs: Sequence[Shown], pair: tuple[int, int]) -> dict[str, Line2D]:
    """Draw the plane of two joints for each run."""
    entries: dict[str, Line2D] = {}
    for panel, one in zip(axes, runs, strict=True):
        lines = draw_path(panel, one, pair)
        label_plane(panel, runs, pair)
        entries |= {label: line for label, line in lines.items() if label not in (one.label, "arm")}
    return entries


def _plane_height(runs: Sequence[Shown], pair: tuple[int, int], width: float) -> float:
    """Return the height of the planes [in]."""
    limits, equal = plane_limits(runs, pair)
    wide = width / len(runs) - 0.3
    return float(np.clip(wide * (aspect(limits) if equal else 1.0), *_PLANE))


def _label(grid: Sequence[Sequence[Axes]], runs: Sequence[Shown], over_times: int, room: float) -> None:
    """Label the columns above, with ``room`` [in], numbers at the left and where they change, the time below."""
    for one, panel in zip(runs, grid[0], strict=True):
        panel.set_title(plain(one.name, room), color=one.colour)
    for r, axes in enumerate(grid):
        for panel in axes[1:]:
            panel.set_ylabel("")
            panel.tick_params(labelleft=False)
        for panel in axes if len(grid) - over_times <= r < len(grid) - 1 else ():
            panel.tick_params(labelbottom=False)
    for panel in grid[-1]:
        panel.set_xlabel("time [s]")
