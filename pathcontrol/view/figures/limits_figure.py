"""The figure of positions, velocities and torques as shares of their limits."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol.analysis.limit_shares import RATIOS, limit_shares
from pathcontrol.errors import InputError
from pathcontrol.simulation.run import Run
from pathcontrol.view.figures.lettering import legend
from pathcontrol.view.figures.limits import extent, over_time
from pathcontrol.view.figures.lines import drawable, series
from pathcontrol.view.figures.shown import Runs, shown
from pathcontrol.view.figures.style import BEYOND, COLUMN, INK, apply_style, new_figure, style

_LOOKS: dict[str, Any] = {"position": "-", "velocity": (0, (5, 1.5)), "torque": (0, (1.5, 1))}
_ROW = 0.1  # in, of the legend


def limits_figure(run: Runs, rollout: int = 0) -> Figure:
    """Draw the largest share [%] that any joint has of its limit of position, velocity and torque, over time.

    A red line stands at 100 %. Of a position it is 0 in the middle between its limits and 100 at either.

    Args:
        run: a run, or several by their names.
        rollout: which rollout of each run.

    Raises:
        InputError: there is no such rollout, or nothing of what was recorded has a limit.
    """
    runs = shown(run, rollout=rollout)
    drawn = [(one, kind, share) for one in runs for kind, share in largest_shares(one.run).items()]
    if not drawn:
        raise InputError(
            "limits_figure: no joint of the run has a limit of position, velocity or torque", argument="run"
        )
    with style():
        figure = new_figure(COLUMN, 2.2 + _ROW * len(runs))
        axes = apply_style(figure.add_subplot())
        names = {one.label: Line2D([], [], color=one.colour) for one, _, _ in drawn} if len(runs) > 1 else {}
        for one, kind, share in drawn:
            look: dict[str, Any] = {"color": one.colour, "linestyle": _LOOKS[kind]}
            series(axes, one.run.time, drawable(share), **look)
            names.setdefault(kind, Line2D([], [], **look | ({"color": INK} if len(runs) > 1 else {})))
        axes.axhline(100.0, color=BEYOND, linewidth=1.1)
        over_time(axes, [one.run.time for one in runs])
        top = max(extent([share for _, _, share in drawn])[1], 100.0)
        axes.set(xlabel="time [s]", ylabel="largest share of a limit [%]", ylim=(0.0, 1.08 * top))
        legend(figure, names | {"limit": Line2D([], [], color=BEYOND, linewidth=1.1)})
    return figure


def largest_shares(run: Run) -> dict[str, Array]:
    """Return the largest share [%] over the joints of the first rollout, (time,), of each kind of limit."""
    found = {}
    for name, shares in limit_shares(run).items():
        limited = np.isfinite(shares[0]).any(0)
        if limited.any():
            found[RATIOS[name]] = 100.0 * shares[0][:, limited].max(-1)
    return found
