"""The figure of a basin of attraction: the starts that return to the path, beside those that the theorem guarantees."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.errors import InputError
from pathcontrol.sweeps.basin import Basin
from pathcontrol.view.figures.lettering import joint_label, legend, plain
from pathcontrol.view.figures.limits import equal_plane
from pathcontrol.view.figures.style import (
    COLUMN,
    DASHED,
    GREY,
    INK,
    ORANGE,
    PAGE,
    RUN_COLOURS,
    SMALL,
    VECTORS,
    Look,
    apply_style,
    error_colours,
    new_figure,
    style,
)
from pathcontrol.view.figures.sweep_columns import colour_bar

_SAMPLES = 1441
_PATH: Look = {"color": INK, "linewidth": 1.4}
_BALL: Look = {"color": "white", "linewidth": 1.3, "linestyle": DASHED}
_LOST: Look = {"marker": "s", "color": GREY, "linestyle": "none", "mew": 0}


def attraction_figure(basin: Basin | Mapping[str, Basin]) -> Figure:
    """Draw from which starts an arm returns to its path, and how soon, beside the ball that the theorem guarantees.

    Of two joints a map of the starts, a panel for each basin: the time of the return as a colour, and grey where the
    arm did not return; the dashed lines bound what the theorem guarantees. Of more joints the share that returns over
    the distance from the path.

    Args:
        basin: a basin, or several of one arm by their names.

    Raises:
        InputError: there is none, or they are of arms of different numbers of joints.
    """
    basins = dict(basin) if isinstance(basin, Mapping) else {"": basin}
    for one in basins.values():
        expect("basin", one, Basin)
    joints = {one.q.shape[1] for one in basins.values()}
    if len(joints) != 1:
        raise InputError(
            f"the basins are of arms of {sorted(joints)} joints, expected some of one arm",
            argument="basin",
            value=sorted(joints),
        )
    with style():
        return _draw_maps(basins) if joints == {2} else _draw_shares(basins)


def _draw_maps(basins: Mapping[str, Basin]) -> Figure:
    """Draw a map of the starts of each basin."""
    figure = new_figure(COLUMN if len(basins) == 1 else PAGE, 3.1)
    panels = np.atleast_1d(figure.subplots(1, len(basins), sharey=True))
    latest = max((float(np.nanmax(one.return_time)) for one in basins.values() if one.returned.any()), default=1.0)
    entries, points = {"path": Line2D([], [], **_PATH)}, None
    for axes, (name, one) in zip(panels, basins.items(), strict=True):
        points = _draw_starts(apply_style(axes), one, latest)
        entries |= _draw_ball(axes, one)
        axes.plot(*np.rad2deg(one.task.q_d(_along(one))).T, **_PATH)
        axes.set_title(plain(name), fontsize=SMALL, loc="left", pad=3)
        axes.set_xlabel(f"{joint_label(0, ['', ''])} [deg]")
        if not one.returned.all():
            entries["does not return"] = Line2D([], [], **(_LOST | {"markersize": 4.0}))
    panels[0].set_ylabel(f"{joint_label(1, ['', ''])} [deg]")
    if points is not None:
        colour_bar(figure, points, panels[-1], "time to return [s]")
    legend(figure, entries)
    return figure


def _draw_starts(axes: Axes, one: Basin, latest: float) -> PathCollection:
    """Draw the starts in the colours of the time to return, or in grey."""
    x, y = np.rad2deg(one.q).T
    xlim, ylim = equal_plane([x], [y])
    side = min(1.25 * 150.0 / np.sqrt(len(x)), 12.0)  # pt, so that the points of a grid touch
    many: Look = {"rasterized": len(x) > VECTORS, "zorder": 1}
    lost = ~one.returned
    axes.plot(x[lost], y[lost], **(_LOST | many | {"markersize": side}))
    back = one.returned
    look: Look = {"s": side**2, "marker": "s", "cmap": error_colours(), "vmin": 0.0, "vmax": latest, "lw": 0}
    points = axes.scatter(x[back], y[back], c=one.return_time[back], **look, **many)
    axes.set(xlim=xlim, ylim=ylim, aspect="equal")
    axes.grid(visible=False)
    return points


def _draw_ball(axes: Axes, one: Basin) -> dict[str, Line2D]:
    """Draw the bounds of the ball that the theorem guarantees; return the entry of the legend."""
    if not 0 < one.ball < np.inf:
        return {}
    s = _along(one)
    points, slope = one.task.q_d(s), one.task.dq_d(s)
    normal = np.stack([-slope[:, 1], slope[:, 0]], axis=-1) / np.linalg.norm(slope, axis=1, keepdims=True)
    for side in (-one.ball, one.ball):
        axes.plot(*np.rad2deg(points + side * normal).T, **_BALL)
    return {"guaranteed": Line2D([], [], **(_BALL | {"color": GREY}))}


def _along(one: Basin) -> Array:
    """Return parameters along the whole path."""
    return np.linspace(*one.task.sampled_interval, _SAMPLES)


def _draw_shares(basins: Mapping[str, Basin]) -> Figure:
    """Draw the share that returns over the distance from the path."""
    figure = new_figure(COLUMN, 2.4)
    axes, entries = apply_style(figure.add_subplot()), {}
    for (name, one), colour in zip(basins.items(), RUN_COLOURS * len(basins), strict=False):
        edges, share, _ = one.share_by_distance()
        axes.stairs(100 * share, edges, color=colour, linewidth=1.2, baseline=None)
        if 0 < one.ball < np.inf:
            axes.axvline(one.ball, color=ORANGE if len(basins) == 1 else colour, linestyle=DASHED, linewidth=0.9)
            entries["guaranteed within"] = Line2D([], [], color=GREY, linestyle=DASHED)
        if name:
            entries[plain(name)] = Line2D([], [], color=colour)
    axes.set(xlabel="distance from the path [rad]", ylabel="returns [%]", ylim=(-3.0, 103.0), xlim=(0.0, None))
    legend(figure, entries)
    return figure
