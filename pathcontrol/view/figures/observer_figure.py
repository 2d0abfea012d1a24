"""The figure of the torques that act on the joints beside their motors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.analysis.disturbance_estimate import momentum_observer
from pathcontrol.control.base import KnownFriction
from pathcontrol.view.figures.joint_panels import figure_of_joints, joint_panels
from pathcontrol.view.figures.lettering import joint_label, legend
from pathcontrol.view.figures.limits import over_time, span
from pathcontrol.view.figures.lines import drawable, series
from pathcontrol.view.figures.shown import Runs, Shown, check_joints, readable, shown
from pathcontrol.view.figures.style import GREY, SMALL, style


def observer_figure(
    run: Runs, *, cutoff_hz: ArrayLike = 20.0, friction: KnownFriction = "none", rollout: int = 0
) -> Figure:
    """Draw the estimate r of the torque that acts beside the motors [N m] over time, one panel for each joint.

    Sliding joints have forces [N]. The estimate is that of :func:`momentum_observer`.

    Args:
        run: a run, or several of one arm by their names.
        cutoff_hz: corner frequency of the observer's filter [Hz], a number or (n,).
        friction: what of the model's friction is known and so not drawn: ``"none"``, ``"viscous"`` or ``"full"``.
        rollout: which rollout of each run.

    Raises:
        InputError: there is no such rollout, a run does not know its robot, or the frequency is not above 0.
    """
    runs = shown(run, rollout=rollout)
    names = check_joints(runs)
    estimates = [drawable(momentum_observer(one.run, cutoff_hz=cutoff_hz, friction=friction)[0]) for one in runs]
    with style():
        figure = figure_of_joints(len(names))
        for k, axes in enumerate(joint_panels(figure, len(names))):
            _draw_joint(axes, runs, k, [estimate[:, k] for estimate in estimates])
        legend(figure, {one.label: Line2D([], [], **one.look) for one in runs if one.name})
    return figure


def _draw_joint(axes: Axes, runs: Sequence[Shown], k: int, estimates: Sequence[Array]) -> None:
    """Draw the estimates of one joint, (time,) each, about a line at zero."""
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    for one, estimate in zip(runs, estimates, strict=True):
        series(axes, one.run.time, estimate, **one.look)
    over_time(axes, [one.run.time for one in runs])
    axes.set_ylim(span([*estimates, np.zeros(1)]))
    axes.set_ylabel(rf"$r_{{{k + 1}}}$ [{readable(runs[0].run, 'tau', k)[1]}]")
    axes.set_title(joint_label(k, runs[0].joints) if len(runs[0].joints) > 2 else "", fontsize=SMALL, loc="left", pad=3)
