"""The figures of a sweep: a metric over two parameters, as a basin of attraction, and its spread over one."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.style import (
    BLUE,
    COLUMN,
    GREY,
    INK,
    ORANGE,
    VECTORS,
    Look,
    apply_style,
    error_colours,
    new_figure,
    style,
)
from pathcontrol.view.figures.sweep_columns import (
    colour_bar,
    column_of_parameter,
    label,
    never,
    readable_metric,
    set_scales,
    table_of,
    wide,
)

_LOST: Look = {"marker": "x", "color": INK, "linestyle": "none", "markersize": 3.5}
_NEVER: Look = {"marker": "s", "color": GREY, "linestyle": "none", "mew": 0}
_BINS = 20  # bins of a distribution, with equally many samples


def basin_figure(sweep: SweepResult | xr.Dataset, x: str, y: str, metric: str = "contour_error_peak") -> Figure:
    """Draw a metric over two parameters, a point for each sample; diverged ones are crossed out.

    Samples whose metric is infinite, that never settled, are grey.

    Args:
        sweep: a sweep, or its table.
        x: the parameter to the right; of a vector one component, as ``q[0]``.
        y: the parameter upwards.
        metric: the metric.

    Raises:
        UnknownNameError: there is no such parameter or metric.
    """
    table = table_of(sweep)
    right, up = (column_of_parameter(table, name) for name in (x, y))
    value, unit = readable_metric(table, metric)
    side = min(180.0 / np.sqrt(len(value)), 12.0)  # so that the points of a square grid nearly touch, in pt
    with style():
        figure = new_figure(COLUMN, 2.9)
        axes = apply_style(figure.add_subplot())
        colour_bar(figure, _draw_known(axes, right, up, value, side), axes, label(metric, unit))
        entries = _cross_out(axes, right, up, _find_lost(table, metric), side)
        axes.set(xlabel=x, ylabel=y)
        set_scales(axes, right, up)
        if entries:
            legend(figure, entries)
    return figure


def _draw_known(axes: Axes, right: Array, up: Array, value: Array, side: float) -> PathCollection:
    """Draw the samples that have a finite value, as squares with a ``side`` [pt]."""
    known, norm = np.isfinite(value), LogNorm() if wide(value) else None
    many: Look = {"rasterized": len(value) > VECTORS}
    at, shade = (right[known], up[known]), value[known]
    return axes.scatter(*at, c=shade, s=side**2, marker="s", cmap=error_colours(), norm=norm, lw=0, **many)


def _find_lost(table: xr.Dataset, metric: str) -> dict[str, tuple[Array, Look]]:
    """Return the rows of samples without a finite value, and their looks, by the word for what became of them."""
    status = table["status"].to_numpy()
    lost = {"diverged": (status == "diverged", _LOST), "never": (never(table, metric), _NEVER)}
    short = status == "unfinished"
    return lost | ({"unfinished": (short, _LOST | {"marker": "+"})} if short.any() else {})


def _cross_out(
    axes: Axes, right: Array, up: Array, lost: dict[str, tuple[Array, Look]], side: float
) -> dict[str, Line2D]:
    """Mark the samples that are lost; return the entries of the legend."""
    many: Look = {"rasterized": len(right) > VECTORS}
    for word, (rows, look) in lost.items():
        size = side if word == "never" else min(side, _LOST["markersize"])
        axes.plot(right[rows], up[rows], **(look | {"markersize": size}), **many)
    return {word: Line2D([], [], **look) for word, (rows, look) in lost.items() if rows.any()}


def robustness_figure(sweep: SweepResult | xr.Dataset, parameter: str, metric: str = "contour_error_peak") -> Figure:
    """Draw the spread of a metric over a parameter: median, middle 80 %, worst, and the diverged share.

    Samples whose metric is infinite, that never settled, are counted below with those that diverged. Values of a grid
    each for themselves; samples of a distribution in bins with as many samples each, drawn at their medians. Degrees
    for radians.

    Args:
        sweep: a sweep, or its table.
        parameter: the parameter; of a vector one component, as ``q[0]``.
        metric: the metric.

    Raises:
        UnknownNameError: there is no such parameter or metric.
    """
    table = table_of(sweep)
    along, (value, unit) = column_of_parameter(table, parameter), readable_metric(table, metric)
    lost, unsettled = (table["status"] == "diverged").to_numpy(), never(table, metric)
    bins = _bins(along)
    where = np.array([np.median(along[rows]) for rows in bins])
    low, middle, high, worst = np.array([_spread(value[rows]) for rows in bins]).T
    with style():
        below = bool((lost | unsettled).any())
        figure = new_figure(COLUMN, 3.2 if below else 2.4)
        grid = figure.add_gridspec(2 if below else 1, 1, height_ratios=[3, 1][: 2 if below else 1])
        axes = apply_style(figure.add_subplot(grid[0]))
        axes.fill_between(where, low, high, color=BLUE, alpha=0.25, lw=0)
        axes.plot(where, middle, color=BLUE)
        axes.plot(where, worst, color=ORANGE)
        axes.set_ylabel(label(metric, unit))
        set_scales(axes, where, value)
        if below:
            axes = _draw_lost(apply_style(figure.add_subplot(grid[1], sharex=axes)), where, lost | unsettled, bins)
            axes.set_ylabel("diverged [%]" if not unsettled.any() else "diverged, never [%]")
        axes.set_xlabel(parameter)
        legend(figure, {"median, 10 to 90 %": Line2D([], [], color=BLUE), "worst": Line2D([], [], color=ORANGE)})
    return figure


def _draw_lost(axes: Axes, where: Array, lost: Array, bins: list[Array]) -> Axes:
    """Draw the share of samples that diverged."""
    axes.plot(where, [100 * lost[rows].mean() for rows in bins], color=INK)
    axes.set(ylim=(0, None))
    return axes


def _bins(values: Array) -> list[Array]:
    """Return rows with one value each where these repeat, else as many rows in each of some bins, in order."""
    found = np.unique(values)
    if len(found) <= max(_BINS, len(values) // 4):
        return [np.flatnonzero(values == one) for one in found]
    return np.array_split(np.argsort(values, kind="stable"), min(_BINS, max(1, len(values) // 5)))


def _spread(values: Array) -> tuple[float, float, float, float]:
    """Return 10 %, median, 90 % and the largest of the known values."""
    values = values[~np.isnan(values)]
    if not values.size:
        return (np.nan,) * 4
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    return float(low), float(middle), float(high), float(values.max())
