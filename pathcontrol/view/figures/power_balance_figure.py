"""The figure of the Lyapunov function of a law along a run, and of the causes of its rate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol.analysis.power.power_balance import PowerBalance, power_balance
from pathcontrol.analysis.power.power_balance_table import list_causes, relative_rates
from pathcontrol.control.base import Controller
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.limits import over_time, span
from pathcontrol.view.figures.lines import drawable, series
from pathcontrol.view.figures.shown import Runs, Shown, shown
from pathcontrol.view.figures.style import (
    AMBER,
    BLUE,
    COLUMN,
    DASHED,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    SMALL,
    Look,
    apply_style,
    new_figure,
    style,
)

_LOOKS: dict[str, Look] = {
    "predicted": {"color": INK, "linestyle": DASHED, "linewidth": 0.9},
    "measured": {"color": INK, "linewidth": 1.3, "zorder": 3},
    "friction": {"color": ORANGE},
    "saturation": {"color": PURPLE},
    "sampling": {"color": BLUE},
    "model": {"color": GREEN},
    "disturbance": {"color": AMBER},
    "residual": {"color": SKY, "linewidth": 0.8},
}
_DECADES = 30  # of V below its largest value that are drawn


def power_balance_figure(run: Runs, controller: Controller | None = None, *, rollout: int = 0) -> Figure:
    """Draw V over time, and below it for each run the rates of V relative to V [1/s], by their causes.

    Rates are means over a sixtieth of the time: of V̇ that the theorem predicts, of V̇ that is measured, and of the
    shares by which they part. Causes below half a per cent of the largest rate are left out.

    Args:
        run: a run, or several by their names.
        controller: the law of all runs; by default that of each.
        rollout: which rollout of each run.

    Raises:
        InputError: a law is not known or has no theorem, or there is no such rollout.
    """
    runs = shown(run, rollout=rollout)
    balances = [power_balance(one.run, controller) for one in runs]
    with style():
        figure = new_figure(COLUMN, 1.9 + 1.7 * len(runs))
        first, *panels = figure.subplots(1 + len(runs), 1, sharex=True)
        _draw_levels(apply_style(first), runs, balances)
        drawn: dict[str, None] = {}
        for axes, one, balance in zip(panels, runs, balances, strict=True):
            drawn |= dict.fromkeys(_draw_rates(apply_style(axes), balance))
            axes.set_title(one.label, fontsize=SMALL, loc="left", pad=3)
        panels[-1].set_xlabel("time [s]")
        over_time(panels[-1], [one.run.time for one in runs])
        figure.align_ylabels()
        named = {one.label: Line2D([], [], **_level_look(i)) for i, one in enumerate(runs) if one.name}
        legend(figure, named | {name: Line2D([], [], **_LOOKS[name]) for name in _LOOKS if name in drawn})
    return figure


def _draw_levels(axes: Axes, runs: Sequence[Shown], balances: Sequence[PowerBalance]) -> None:
    """Draw V of each run on a logarithmic axis."""
    levels = [drawable(balance.V[0]) for balance in balances]
    largest = max(float(level[np.isfinite(level)].max(initial=0.0)) for level in levels)
    units = dict.fromkeys(balance.unit for balance in balances)
    for i, (one, level) in enumerate(zip(runs, levels, strict=True)):
        seen = np.where(level > 10.0**-_DECADES * largest, level, np.nan)
        series(axes, one.run.time, seen, **_level_look(i))
    axes.set_ylabel(f"$V$ [{' or '.join(map(_mathematical, units))}]")
    if largest > 0:
        axes.set_yscale("log")
        apply_style(axes)


def _level_look(i: int) -> Look:
    """Return the look of V of the i-th run, in greys, as colours stand for causes."""
    return {"color": (INK, GREY)[i % 2], "linestyle": ("-", DASHED, ":")[i // 2 % 3]}


def _draw_rates(axes: Axes, balance: PowerBalance) -> list[str]:
    """Draw the relative rates of a run that are not negligible; return their names."""
    times, rates = relative_rates(balance)
    names = ["predicted", "measured", *list_causes(rates)]
    values: list[Array] = [drawable(rates[name]) for name in names]
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    for name, value in zip(names, values, strict=True):
        series(axes, times, value, **_LOOKS[name])
    axes.set_ylim(span([*values, np.zeros(1)]))
    axes.set_ylabel(r"$\dot V / V$ [1/s]")
    return names


def _mathematical(unit: str) -> str:
    """Return a unit with its powers as Matplotlib draws them."""
    return unit.replace("^2", "$^2$")
