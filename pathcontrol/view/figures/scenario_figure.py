"""The figure of a comparison: contour and lag error of all laws over time, with the event marked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pathcontrol._arrays import Array, norms
from pathcontrol._expect import expect
from pathcontrol.analysis.readable import in_degrees
from pathcontrol.analysis.run_metrics import contour_error, lag_error
from pathcontrol.comparison.compare import Comparison
from pathcontrol.comparison.comparison_table import law_title
from pathcontrol.comparison.scenarios import Scenario
from pathcontrol.simulation.run import Run
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.limits import from_zero, span
from pathcontrol.view.figures.lines import drawable, series
from pathcontrol.view.figures.shown import Shown, shown
from pathcontrol.view.figures.style import COLUMN, apply_style, new_figure, style

_EVENT: dict[str, Any] = {"color": "#D9D9D9", "alpha": 0.6, "linewidth": 0}
_SCREEN = 11.5  # inches
_BEFORE, _AFTER = 0.5, 3.0  # lengths of the event that are shown around it


def scenario_figure(compared: Comparison, rollout: int = 0, *, wide: bool = False) -> Figure:
    """Draw contour error, lag and ‖q̇‖ of all laws of a comparison over time, with the event shaded.

    Where a scenario has an event, the time around it is shown, else all of the run.

    Args:
        compared: what :func:`compare` gives.
        rollout: which rollout of each run.
        wide: the panels are beside each other, for the width of a screen, and not above each other.

    Raises:
        InputError: there is no such rollout.
    """
    expect("compared", compared, Comparison)
    runs = shown({law_title(law): run for law, run in compared.runs.items()}, rollout=rollout)
    first, last = choose_span(compared.scenario)
    with style():
        figure = new_figure(_SCREEN, 2.9) if wide else new_figure(COLUMN, 5.2)
        panels = figure.subplots(*((1, 3) if wide else (3, 1)), sharex=True)
        for axes, (label, measure) in zip(panels, _ROWS.items(), strict=True):
            _draw(apply_style(axes), runs, measure, (first, last))
            axes.set_ylabel(f"{label} [{_unit(runs[0].run, measure)}]")
            if compared.scenario.event is not None:
                axes.axvspan(*compared.scenario.event, **_EVENT)
        panels[-1].set_xlim(first, last)
        for axes in panels if wide else panels[-1:]:
            axes.set_xlabel("time [s]")
        figure.align_ylabels()
        event = {} if compared.scenario.event is None else {"event": Patch(**_EVENT)}
        legend(figure, {one.label: Line2D([], [], **one.look) for one in runs} | event)
    return figure


def choose_span(scenario: Scenario) -> tuple[float, float]:
    """Return from when to when a scenario is shown [s]: around its event, or all of it."""
    if scenario.event is None:
        return 0.0, scenario.duration
    begin, end = scenario.event
    length = min(end, scenario.duration) - begin
    return max(0.0, begin - _BEFORE * length), min(scenario.duration, end + _AFTER * length)


_Measure = Callable[[Run], Array]


def _speed(run: Run) -> Array:
    """Return ‖q̇‖, (rollout, time)."""
    return norms(run.array("qd"))


#: what is drawn, by its label
_ROWS: dict[str, _Measure] = {"contour error": contour_error, "lag": lag_error, r"$\|\dot{\mathbf{q}}\|$": _speed}


def _unit(run: Run, measure: _Measure) -> str:
    """Return the unit for a reader."""
    return in_degrees(np.zeros(1), run.unit("qd" if measure is _speed else "q"))[1]


def _draw(axes: Axes, runs: list[Shown], measure: _Measure, seen: tuple[float, float]) -> None:
    """Draw one quantity of all runs, on an axis for what is ``seen`` of it."""
    visible = []
    for one in runs:
        values = drawable(in_degrees(measure(one.run)[0], one.run.unit("q"))[0])
        series(axes, one.run.time, values, **one.look)
        visible.append(values[(one.run.time >= seen[0]) & (one.run.time <= seen[1])])
    if measure is lag_error:
        axes.set_ylim(*span(visible))
    else:
        from_zero(axes, visible)
