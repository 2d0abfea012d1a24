"""The figure of torques beside their limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array
from pathcontrol.analysis.torque_limits import torque_limits as clamped_limits
from pathcontrol.analysis.torque_limits import torque_shares
from pathcontrol.view.figures.joint_panels import figure_of_joints, joint_panels
from pathcontrol.view.figures.lettering import joint_label, legend
from pathcontrol.view.figures.limits import extent, over_time, span
from pathcontrol.view.figures.lines import drawable, series
from pathcontrol.view.figures.shown import Runs, Shown, check_joints, own_robot, readable, shown
from pathcontrol.view.figures.style import LIMIT_LOOK, SMALL, style

_BEYOND = "#ECECEC"  # the region beyond a limit


def torque_figure(run: Runs, limits: ArrayLike | None = None, rollout: int = 0) -> Figure:
    """Draw applied torques [N m] over time, one panel for each joint, with their limits and the used share.

    Sliding joints have forces [N]. The limits are always inside the panel, so that the margin is seen.

    Args:
        run: a run, or several of one arm by their names.
        limits: largest torques (n,); by default those it was clamped to, else its robot's. Infinite ones are not drawn.
        rollout: which rollout of each run.

    Raises:
        InputError: there is no such rollout, or the limits are not one for each joint.
    """
    runs = shown(run, rollout=rollout)
    names = check_joints(runs)
    largest_torques = torque_limits(runs[0], limits)
    with style():
        figure = figure_of_joints(len(names))
        for k, axes in enumerate(joint_panels(figure, len(names))):
            _draw_joint(axes, runs, k, largest_torques[:, k])
        entries = {one.label: Line2D([], [], **one.look) for one in runs if one.name}
        bounded = np.isfinite(largest_torques).any()
        legend(figure, entries | ({"limit": Line2D([], [], **LIMIT_LOOK)} if bounded else {}))
    return figure


def torque_limits(one: Shown, limits: ArrayLike | None = None) -> Array:
    """Return the largest torques, (1 or time, n): given, of the loop, or the robot's own; infinite where unknown."""
    if limits is None:
        return clamped_limits(one.run, own_robot(one.run))
    given = np.abs(as_joint_array("limits", limits, len(one.joints), tuple(one.joints)))
    return np.where(drawable(given) > 0, given, np.inf)[None]


def torque_share(one: Shown, limits: Array) -> Array:
    """Return the largest over the joints of |τ_j| over its limit [%], (time,), of the first rollout."""
    return 100.0 * torque_shares(drawable(one.run.array("tau")[0]), limits).max(-1)


def _draw_joint(axes: Axes, runs: Sequence[Shown], k: int, limit: Array) -> None:
    """Draw the torque of one joint, with its limit (1,) or (time of the first run,)."""
    found = [readable(one.run, "tau", k) for one in runs]
    values, unit = [v[0] for v, _ in found], found[0][1]
    for one, v in zip(runs, values, strict=True):
        series(axes, one.run.time, v, **one.look)
    over_time(axes, [one.run.time for one in runs])
    axes.set_ylabel(rf"$\tau_{{{k + 1}}}$ [{unit}]")
    axes.set_title(joint_label(k, runs[0].joints) if len(runs[0].joints) > 2 else "", fontsize=SMALL, loc="left", pad=3)
    known = limit[np.isfinite(limit)]
    axes.set_ylim(span([*values, known, -known] if known.size else [*values, np.zeros(1)]))
    if known.size:
        time = runs[0].run.time
        _draw_limits(axes, time, limit)
        shares = [torque_shares(v, _hold(limit, time, one.run.time)) for one, v in zip(runs, values, strict=True)]
        whole = f"{known[0]:.4g} {unit}" if (limit == limit[0]).all() else "its limit"
        axes.set_title(f"peak {100.0 * extent(shares)[1]:.3g} % of {whole}", fontsize=SMALL, loc="right", pad=3)


def _draw_limits(axes: Axes, time: Array, limit: Array) -> None:
    """Draw a line at each limit (1,) or (time,), and grey beyond it."""
    low, high = axes.get_ylim()
    if len(limit) == 1 or (limit == limit[0]).all():
        for sign, end in ((1.0, high), (-1.0, low)):
            axes.axhline(sign * limit[0], **LIMIT_LOOK)
            axes.axhspan(sign * limit[0], end, color=_BEYOND, linewidth=0, zorder=0.5)
    else:
        for sign, end in ((1.0, high), (-1.0, low)):
            axes.plot(time, sign * drawable(limit), drawstyle="steps-post", **LIMIT_LOOK)
            axes.fill_between(time, sign * drawable(limit), end, step="post", color=_BEYOND, linewidth=0, zorder=0.5)
    axes.set_ylim(low, high)


def _hold(limit: Array, time: Array, later: Array) -> Array:
    """Return a limit (1,) or (time,) at other times, as it is held from one sample to the next."""
    return limit[np.clip(np.searchsorted(time, later, "right") - 1, 0, len(limit) - 1)]
