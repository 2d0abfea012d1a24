"""The figure of the radial error round a circle, magnified, as a ballbar draws it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol.analysis.lap_accuracy.ballbar import Ballbar, ballbar
from pathcontrol.analysis.readable import reading
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.figures.lettering import joint_label, legend
from pathcontrol.view.figures.shown import Runs, check_joints, shown
from pathcontrol.view.figures.style import COLUMN, GREY, INK, RUN_COLOURS, SMALL, Look, new_figure, style

_ROOM = 0.3  # of the radius, that the largest error takes
_MARK = 1.03, 1.1  # radii between which a reversal is marked, beyond the largest error
_TURN = np.linspace(0.0, 2 * np.pi, 361)
_DASHES = (0, (1.5, 1.5))


def ballbar_figure(
    run: Runs, task: PathTask | None = None, *, frame: str | None = None, skip: int = 1, rollout: int = 0
) -> Figure:
    """Draw the radial error round a circle, magnified, and where joints turn back.

    The nominal circle is grey; dotted circles are divisions apart. Where a joint turns back, friction that is
    not compensated makes a spike.

    Args:
        run: a run, or several by their names.
        task: the path; by default each run's own.
        frame: the frame of the arm that goes round; by default the tool that the path was made for, or else the joints.
        skip: laps at the beginning that do not count.
        rollout: which rollout of each run.

    Raises:
        InputError: a path is no circle there, or a run has no lap after those.
    """
    runs = shown(run, task)
    names = check_joints(runs)
    found = [ballbar(one.run, one.task, frame=frame, skip=skip, rollout=rollout) for one in runs]
    largest = max(float(np.abs(one.error).max()) for one in found)
    division, factor, unit = _choose_division(largest, found[0].unit)
    gain = _ROOM / max(largest, division)
    with style():
        figure = new_figure(COLUMN, COLUMN + 0.35)
        axes = figure.add_subplot()
        ends = [gain * min(one.error.min() for one in found), gain * max(one.error.max() for one in found)]
        _draw_circles(axes, gain * division, ends)
        for one, at in zip(runs, found, strict=True):
            axes.plot(*_place(at.angle, 1 + gain * at.error), **one.look)
        marks = _draw_reversals(axes, found, 1 + max(ends[1], gain * division), names) if len(runs) == 1 else {}
        _say(axes, f"division {factor * division:g} {unit}", *_describe(found))
        legend(figure, {one.label: Line2D([], [], **one.look) for one in runs if one.name} | marks)
    return figure


def _choose_division(largest: float, unit: str) -> tuple[float, float, str]:
    """Return the division in SI units, a round number of a reader's unit, with the factor to that unit and its name."""
    factor, name = reading(unit, np.array([largest]))
    wanted = factor * max(largest, 1e-12) / 2
    power = 10.0 ** np.floor(np.log10(wanted))
    step = next(digit for digit in (5.0, 2.0, 1.0) if digit * power <= wanted * (1 + 1e-9)) * power
    return step / factor, factor, name


def _draw_circles(axes: Axes, division: float, ends: Sequence[float]) -> None:
    """Draw the nominal circle, and others a division apart, as far as the error goes."""
    least, most = min(np.floor(ends[0] / division), -1), max(np.ceil(ends[1] / division), 1)
    for k in np.arange(least, most + 1):
        circle = _place(_TURN, np.full(len(_TURN), 1 + k * division))
        axes.plot(*circle, color=GREY, linewidth=0.5, linestyle=_DASHES, zorder=1)
    axes.plot(*_place(_TURN, np.ones(len(_TURN))), color=GREY, linewidth=1.2)
    spoke = 1 + division * np.array([least, most])
    for angle in np.arange(0.0, 2 * np.pi, np.pi / 4):
        axes.plot(*_place(np.full(2, angle), spoke), color="#E3E3E3", linewidth=0.6, zorder=0.5)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_reversals(axes: Axes, found: Sequence[Ballbar], beyond: float, names: Sequence[str]) -> dict[str, Line2D]:
    """Mark where joints turn back, and return the entries of the legend."""
    entries = {}
    for joint in range(len(names)):
        look: Look = {"color": RUN_COLOURS[(joint + 1) % len(RUN_COLOURS)], "linewidth": 1.6}
        angles = [angle for one in found for angle in one.reversal[one.reversing == joint]]
        for angle in angles:
            axes.plot(*_place(np.full(2, angle), beyond * np.array(_MARK)), **look)
        if angles:
            entries[f"{joint_label(joint, names)} turns back"] = Line2D([], [], **look)
    return entries


def _say(axes: Axes, *lines: str) -> None:
    """Write lines in the middle of the circle."""
    axes.text(0.0, 0.0, "\n".join(lines), ha="center", va="center", fontsize=SMALL, color=INK)


def _describe(found: Sequence[Ballbar]) -> Iterator[str]:
    """Yield the radius, and of a single run the range of its error, in words."""
    one = found[0]
    factor, unit = reading(one.unit, np.array([one.radius]))
    yield f"radius {factor * one.radius:.4g} {unit}"
    if len(found) == 1:
        small, name = reading(one.unit, one.error)
        yield f"error {small * one.error.min():+.3g} to {small * one.error.max():+.3g} {name}".replace("-", "−")


def _place(angle: Array, radius: Array) -> tuple[Array, Array]:
    """Return the coordinates of polar ones."""
    return radius * np.cos(angle), radius * np.sin(angle)
