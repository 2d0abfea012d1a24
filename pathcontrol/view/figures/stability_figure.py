"""The figure of a gain map: how fast deviations decay, and the boundary of stability."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._expect import did_you_mean, expect
from pathcontrol.analysis.stability.stability_map import StabilityMap
from pathcontrol.errors import UnknownNameError
from pathcontrol.view.figures.lettering import legend, plain
from pathcontrol.view.figures.style import BEYOND, BLUE, COLUMN, DASHED, INK, Look, apply_style, new_figure, style
from pathcontrol.view.figures.sweep_columns import colour_bar, set_scales, wide

_UNSTABLE = "#EFE3E0"
_SHADES = LinearSegmentedColormap.from_list("decay", ["#F2F7FB", "#8FBFE0", BLUE, "#00395A"])
_LEVELS = 9
_LINE: Look = {"color": BEYOND, "linewidth": 1.4}
_MARK: Look = {
    "marker": "*",
    "color": "white",
    "markeredgecolor": INK,
    "linestyle": "none",
    "markersize": 10,
    "mew": 0.9,
}


def stability_figure(stability: StabilityMap, mark: Mapping[str, float] | None = None) -> Figure:
    """Draw how fast the slowest deviation from the path decays over the gains, and the boundary of stability.

    Of two gains the map is coloured where the loop is stable; of one gain the rate is a line. A scale is logarithmic
    where its values are far apart.

    Args:
        stability: the map.
        mark: gains that are marked, by their names; by default the law's own, where they are within the map. ``{}``
            marks none.

    Raises:
        UnknownNameError: a gain that is to be marked is none of the map.
    """
    expect("stability", stability, StabilityMap)
    marked = _find_mark(stability, mark)
    with style():
        figure = new_figure(COLUMN, 2.9)
        axes = apply_style(figure.add_subplot())
        if len(stability.names) == 1:
            entries = _draw_line(axes, stability)
            ends = stability.grids[0], np.array([-1.0, 1.0])
        else:
            entries = _draw_plane(figure, axes, stability)
            ends = stability.grids[0], stability.grids[1]
            axes.set_ylim(*_limits(ends[1]))
            axes.set_ylabel(_label(stability, 1))
        axes.set_xlim(*_limits(ends[0]))
        set_scales(axes, *ends)
        axes.set_xlabel(_label(stability, 0))
        if marked is not None:
            axes.plot(*marked, **_MARK, zorder=5, clip_on=False)
            entries[_name_mark(stability, mark)] = Line2D([], [], **_MARK)
        legend(figure, entries)
    return figure


def _draw_plane(figure: Figure, axes: Axes, stability: StabilityMap) -> dict[str, Line2D | Patch]:
    """Draw a map of two gains, and return the entries of its legend."""
    points = np.stack(np.meshgrid(*stability.grids, indexing="ij"), axis=-1).reshape(-1, 2)
    # with the boundary among the points, where the rate is 0, colours end at it
    points = np.concatenate([points, stability.boundary])
    rates = np.concatenate([stability.decay_rate.ravel(), np.zeros(len(stability.boundary))])
    axes.grid(False)
    entries: dict[str, Line2D | Patch] = {}
    if (rates > 0).any() and min(map(len, stability.grids)) > 1:
        levels = MaxNLocator(_LEVELS).tick_values(0.0, float(rates.max()))
        mesh = _triangulate(points)
        colour_bar(figure, axes.tricontourf(mesh, rates, levels, cmap=_SHADES), axes, "decay rate [1/s]")
    if (rates < 0).any():
        axes.set_facecolor(_UNSTABLE)
        entries["unstable"] = Patch(color=_UNSTABLE)
    if len(stability.boundary):
        axes.add_collection(LineCollection(list(stability.boundary[stability.segments]), **_LINE))
        entries["boundary"] = Line2D([], [], **_LINE)
    return entries


def _triangulate(points: Array) -> Triangulation:
    """Return triangles between points (k, 2), chosen on the scales of the axes."""
    scaled = [np.log(each) if wide(each) else each for each in points.T]
    spans = [(each - each.min()) / max(np.ptp(each), 1e-300) for each in scaled]
    return Triangulation(points[:, 0], points[:, 1], Triangulation(*spans).triangles)


def _draw_line(axes: Axes, stability: StabilityMap) -> dict[str, Line2D | Patch]:
    """Draw the decay rate over one gain, and return the entries of its legend."""
    gains = np.concatenate([stability.grids[0], stability.boundary[:, 0]])
    rates = np.concatenate([stability.decay_rate, np.zeros(len(stability.boundary))])
    order = np.argsort(gains)
    axes.plot(gains[order], rates[order], color=BLUE)
    axes.axhline(0.0, color=INK, linewidth=0.7, linestyle=DASHED)
    axes.set_ylabel("decay rate [1/s]")
    for at in stability.boundary[:, 0]:
        axes.axvline(at, **_LINE)
    return {"boundary": Line2D([], [], **_LINE)} if len(stability.boundary) else {}


def _find_mark(stability: StabilityMap, mark: Mapping[str, float] | None) -> list[float] | None:
    """Return the place of the mark in the figure, or ``None`` where there is nothing to be marked within it."""
    if mark is None:
        gains: dict[str, float | None] = dict(zip(stability.names, stability.own, strict=True))
    else:
        expect("mark", mark, Mapping)
        gains = {name: as_scalar(f"mark[{name!r}]", value) for name, value in mark.items()}
    for name in gains:
        if name not in stability.names:
            known = ", ".join(stability.names)
            raise UnknownNameError(
                f"mark has {name!r}, expected {known}{did_you_mean(name, stability.names)}",
                argument="mark",
                value=name,
                choices=tuple(stability.names),
            )
    place = [gains.get(name) for name in stability.names]
    found = [value for value in place if value is not None]
    inside = zip(found, stability.grids, strict=False)
    if len(found) < len(place) or not all(grid.min() <= value <= grid.max() for value, grid in inside):
        return None
    if len(found) == 1:
        found.append(float(np.interp(found[0], stability.grids[0], stability.decay_rate)))
    return found


def _name_mark(stability: StabilityMap, mark: Mapping[str, float] | None) -> str:
    """Return the words for the marked gains."""
    values = stability.own if mark is None else [mark[name] for name in stability.names]
    return ", ".join(f"{plain(name)} = {value:g}" for name, value in zip(stability.names, values, strict=True))


def _limits(values: Array) -> tuple[float, float]:
    """Return the ends of an axis for values; around one that is alone."""
    low, high = float(values.min()), float(values.max())
    room = 0.0 if high > low else 0.5 * abs(low) or 1.0
    return low - room, high + room


def _label(stability: StabilityMap, index: int) -> str:
    """Return the label of the axis of a gain."""
    unit = stability.units[index]
    return plain(stability.names[index]) + (f" [{plain(unit.replace('^2', '²'))}]" if unit else "")
