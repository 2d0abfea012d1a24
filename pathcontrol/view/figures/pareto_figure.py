"""Pareto fronts: the trade-off of two metrics, over all samples of a sweep or all candidates of a tuning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from string import ascii_uppercase
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol.analysis.readable import readable_parameters
from pathcontrol.errors import InputError
from pathcontrol.sweeps.objectives import Limits, check_limits, front, within
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.tuning.tuning_result import Tuning
from pathcontrol.view.figures.lettering import legend, plain
from pathcontrol.view.figures.style import (
    BLUE,
    COLUMN,
    GREY,
    INK,
    LIMIT_LOOK,
    ORANGE,
    SMALL,
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
    readable_factor,
    readable_metric,
    set_scales,
    table_of,
    wide,
)

_FRONT: Look = {"color": ORANGE, "linewidth": 1.2, "zorder": 2.5}
_BEYOND: Look = {"marker": "o", "linestyle": "none", "markersize": 2.2, "color": "#D5D5D5", "mew": 0, "zorder": 1.5}
_KEPT: Look = {"marker": "o", "linestyle": "none", "markersize": 2.2, "color": BLUE, "alpha": 0.5, "mew": 0}


class _Choice(NamedTuple):
    """The content of a figure: metrics along both axes, their directions, and limits."""

    x: str
    y: str
    goals: Mapping[str, str]
    limits: Mapping[str, tuple[float, float]]


def pareto_figure(
    sweep: SweepResult | Tuning | xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    colour: str | None = None,
    *,
    goals: Mapping[str, str] | None = None,
    limits: Limits | None = None,
    labelled: int = 3,
) -> Figure:
    """Draw two metrics of all samples and the Pareto front of these two as a staircase; degrees for radians.

    Samples beyond a limit of another metric are grey and never on the front; limits of the two themselves are lines,
    beyond which the front goes on, as that is what it costs to keep them. Of a tuning its best candidate is marked too.

    Args:
        sweep: a sweep, a tuning, or the table of one.
        x: the metric to the right; of a tuning by default its first objective.
        y: the metric upwards; of a tuning by default its second objective, or what it limits first.
        colour: a parameter that colours the points; of a vector one component, as ``q[0]``.
        goals: ``"min"`` or ``"max"`` by metric, ``"min"`` if not said; of a tuning its own.
        limits: of metrics the largest value allowed, or (smallest, largest); of a tuning its own.
        labelled: how many points of the front have a letter, and their parameters below.

    Raises:
        InputError: ``x`` or ``y`` is left out, or there is no sample to be drawn.
        UnknownNameError: there is no such metric or parameter.
    """
    table = table_of(sweep.table() if isinstance(sweep, Tuning) else sweep)
    choice = _choice(sweep, x, y, goals, limits)
    names = (choice.x, choice.y)
    (right, x_unit), (up, y_unit) = (readable_metric(table, name) for name in names)
    others = {name: ends for name, ends in choice.limits.items() if name not in names}
    best = front(table, {name: choice.goals.get(name, "min") for name in names}, others)
    rows = np.searchsorted(table["sample"], best["sample"])
    if not len(rows):
        raise InputError(f"no sample has {names[0]} and {names[1]} and keeps the limits; there is no front to be drawn")
    chosen = _best(sweep, choice.x, best) if labelled else []
    marked = sorted({*_spread([_scale(values)[rows] for values in (right, up)], labelled), *chosen})
    words = [f"{letter}  {_describe_point(best, i)}" for letter, i in zip(ascii_uppercase, marked, strict=False)]
    words = [line + ", best" * (i in chosen) for line, i in zip(words, marked, strict=False)]
    with style():
        figure = new_figure(COLUMN, 2.7 + 0.14 * len(words))
        axes = apply_style(figure.add_subplot())
        kept = within(table, others)
        set_scales(axes, right, up)
        axes.margins(0.09)  # for letters at the ends
        _draw_points(figure, axes, (right, up), kept, None if colour is None else (colour, table))
        axes.plot(right[rows], up[rows], drawstyle="steps-post", marker="o", markersize=2.6, **_FRONT)
        _draw_limits(axes, table, choice)
        for letter, i in zip(ascii_uppercase, marked, strict=False):
            _mark(axes, letter, (right[rows[i]], up[rows[i]]), choice, INK if i in chosen else "white")
        axes.set(xlabel=label(choice.x, x_unit), ylabel=label(choice.y, y_unit))
        figure.supxlabel("\n".join(plain(line, 1.1 * COLUMN) for line in words), fontsize=SMALL, ha="left", x=0.02)
        legend(figure, _entries(choice, bool((~kept & np.isfinite(right * up)).any()), colour is None))
    return figure


def _choice(sweep: Any, x: str | None, y: str | None, goals: Mapping[str, str] | None, limits: Any) -> _Choice:
    """Return the content of the figure."""
    if isinstance(sweep, Tuning):
        known = [*sweep.objectives, *sweep.limits]
        x = known[0] if x is None else x
        y = next((name for name in known if name != x), None) if y is None else y
        goals = sweep.directions if goals is None else goals
        limits = sweep.limits if limits is None else limits
    if x is None or y is None:
        raise InputError(f"x = {x!r}, y = {y!r}, expected the names of two metrics", argument="x", value=x)
    return _Choice(x, y, goals or {}, check_limits(limits))


def _describe_point(best: xr.Dataset, row: int) -> str:
    """Return the parameters of a marked point in words."""
    one = best.isel(sample=row)
    values = {str(name): v.to_numpy()[()] for name, v in one.coords.items() if name != "sample"}
    return f"{int(one['sample'])}: {readable_parameters(values)}"


def _scale(values: Array) -> Array:
    """Return values scaled to their range."""
    return np.log(values) if wide(values) else values


def _draw_points(
    figure: Figure, axes: Axes, at: tuple[Array, Array], kept: Array, colour: tuple[str, xr.Dataset] | None
) -> None:
    """Draw all samples."""
    right, up = at
    many: Look = {"rasterized": len(right) > VECTORS}
    axes.plot(right[~kept], up[~kept], **_BEYOND, **many)
    if colour is None:
        axes.plot(right[kept], up[kept], **_KEPT, **many)
        return
    name, table = colour
    shade = column_of_parameter(table, name)[kept]
    norm = LogNorm() if wide(shade) else None
    points = axes.scatter(right[kept], up[kept], c=shade, s=7, lw=0, cmap=error_colours(), norm=norm, zorder=2, **many)
    colour_bar(figure, points, axes, plain(name))


def _draw_limits(axes: Axes, table: xr.Dataset, choice: _Choice) -> None:
    """Draw the limits."""
    for name, draw in ((choice.x, axes.axvline), (choice.y, axes.axhline)):
        for end in choice.limits.get(name, ()):
            if np.isfinite(end):
                draw(end * readable_factor(table, name)[0], **LIMIT_LOOK)


def _best(sweep: Any, objective: str, front: xr.Dataset) -> list[int]:
    """Return the row of a front that is the best candidate of a tuning, if it is one of them."""
    best = sweep.best(objective) if isinstance(sweep, Tuning) and objective in sweep.objectives else None
    return [] if best is None else np.flatnonzero(front["sample"].to_numpy() == best.number).tolist()


def _mark(axes: Axes, letter: str, at: tuple[float, float], choice: _Choice, fill: str) -> None:
    """Draw a letter beside a point of the front, on the side without samples."""
    axes.plot(*at, marker="o", markersize=4.5, markerfacecolor=fill, color=INK, zorder=3)
    sides = {"min": -5.5, "max": 5.5}
    away = (sides[choice.goals.get(choice.x, "min")], sides[choice.goals.get(choice.y, "min")])
    axes.annotate(
        letter, at, xytext=away, textcoords="offset points", fontsize=SMALL, zorder=4, ha="center", va="center"
    )


def _spread(columns: Sequence[Array], count: int) -> Sequence[int]:
    """Return rows of a front that are as far apart along it as possible, its ends among them."""
    if count < 1:
        return []
    points = np.stack(columns, axis=1)
    spread = np.ptp(points, axis=0)
    steps = np.abs(np.diff(points, axis=0)) / np.where(spread > 0, spread, 1.0)
    along = np.concatenate([[0.0], np.cumsum(steps.sum(1))])
    wanted = np.linspace(0.0, along[-1], count) if count > 1 else along[-1:] / 2
    return sorted({int(np.abs(along - one).argmin()) for one in wanted})


def _entries(choice: _Choice, beyond: bool, plainly: bool) -> dict[str, Line2D]:
    """Return the entries of the legend."""
    entries = {"front": Line2D([], [], marker="o", markersize=2.6, **_FRONT)}
    if plainly:
        entries["samples"] = Line2D([], [], marker="o", linestyle="none", markersize=2.6, color=BLUE)
    if beyond:
        entries["beyond a limit"] = Line2D([], [], **(_BEYOND | {"markersize": 3.5, "color": GREY}))
    if {choice.x, choice.y} & set(choice.limits):
        entries["limit"] = Line2D([], [], **LIMIT_LOOK)
    return entries
