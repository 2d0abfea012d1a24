"""The figure of identified friction: what was measured, the law, and what it leaves."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pathcontrol._expect import expect
from pathcontrol.analysis.friction_identification import FrictionEstimate
from pathcontrol.view.figures.lettering import joint_label
from pathcontrol.view.figures.style import COLUMN, GREY, INK, RUN_COLOURS, SMALL, apply_style, new_figure, style

_POINTS = 400  # of a curve
_ROW = 1.35  # in


def friction_figure(estimate: FrictionEstimate) -> Figure:
    """Draw friction torque over speed of each joint: the windows of the run and the law on the left, residuals right.

    Args:
        estimate: what :func:`identify_friction` returned.
    """
    expect("estimate", estimate, FrictionEstimate)
    n = len(estimate.joints)
    with style():
        figure = new_figure(2 * COLUMN, 0.6 + _ROW * n)
        panels = figure.subplots(n, 2, squeeze=False, sharex="row")
        for joint, (left, right) in enumerate(panels):
            _draw_law(apply_style(left), estimate, joint)
            _draw_residuals(apply_style(right), estimate, joint)
        for axes in panels[-1]:
            axes.set_xlabel("speed [rad/s]")
    return figure


def _draw_law(axes: Axes, estimate: FrictionEstimate, joint: int) -> None:
    """Draw the friction torques of one joint and the law through them, or why there is none."""
    windows = estimate.windows[joint]
    speed = windows.speed @ windows.share
    axes.plot(speed, windows.torque, ".", color=GREY, markersize=2.5)
    axes.set_ylabel("friction [N m]")
    axes.set_title(joint_label(joint, estimate.joints), fontsize=SMALL, loc="left", pad=3)
    if estimate.joints[joint] in estimate.remarks:
        axes.text(
            0.5, 0.5, "not excited", transform=axes.transAxes, ha="center", va="center", fontsize=SMALL, color=INK
        )
        return
    for sign in (-1.0, 1.0):
        most = float(np.max(sign * speed, initial=0.0))
        if most > 0:
            along = sign * np.linspace(1e-6 * most, most, _POINTS)
            axes.plot(along, estimate.torque(joint, along), color=RUN_COLOURS[0], linewidth=1.2)


def _draw_residuals(axes: Axes, estimate: FrictionEstimate, joint: int) -> None:
    """Draw what the law leaves of the friction torques of one joint."""
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    axes.set_ylabel("residual [N m]")
    if estimate.joints[joint] in estimate.remarks:
        return
    windows = estimate.windows[joint]
    left = windows.torque - estimate.torque(joint, windows.speed) @ windows.share
    axes.plot(windows.speed @ windows.share, left, ".", color=RUN_COLOURS[1], markersize=2.5)
    axes.set_title(f"{estimate.residual[joint]:.3g} N m rms", fontsize=SMALL, loc="right", pad=3)
