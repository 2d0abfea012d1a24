"""The figures of runs in joint space: the plane of two joints, and the phase plane of each joint, in degrees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.figures.lettering import joint_label, legend
from pathcontrol.view.figures.limits import aspect, equal_plane, extent, span
from pathcontrol.view.figures.lines import curve, drawable
from pathcontrol.view.figures.shown import Runs, Shown, check_joints, path_parameters, readable, readable_like, shown
from pathcontrol.view.figures.style import COLUMN, DESIRED_LOOK, INK, PAGE, START_LOOK, apply_style, new_figure, style

_DESIRED, _START = "desired path", "start"
_STILL = 0.01  # share of the largest travel below which a joint is left out


def path_figure(
    run: Runs, task: PathTask | None = None, joints: tuple[int, int] | None = None, rollout: int = 0
) -> Figure:
    """Draw q_j over q_i [deg], as in the paper's figures 7 and 9, over the desired path.

    Args:
        run: a run, or several of one arm by their names.
        task: the path; by default each run's own, where it knows it.
        joints: the indices (i, j); by default the two that move the most.
        rollout: which rollout of each run.

    Raises:
        InputError: there are no such joints or there is no such rollout, or runs and task do not belong together.
    """
    runs = shown(run, task, rollout)
    check_joints(runs)
    pair = choose_pair(runs, joints)
    with style():
        limits, equal = plane_limits(runs, pair)
        figure = new_figure(COLUMN, 0.75 + (2.85 * aspect(limits) if equal else 2.85))
        axes = apply_style(figure.add_subplot())
        lines = [draw_path(axes, one, pair) for one in runs]
        label_plane(axes, runs, pair)
        legend(figure, _sort_lines(lines))
    return figure


def phase_figure(
    run: Runs, joints: int | Sequence[int] | None = None, task: PathTask | None = None, rollout: int = 0
) -> Figure:
    """Draw q̇_j over q_j, a panel for each joint, over the path's own (q_d(s), q_d'(s)ϑ(s)) of eq. (5).

    Degrees and degrees a second; metres and metres a second for sliding joints.

    Args:
        run: a run, or several of one arm by their names.
        joints: one index or several; by default those that move, by a hundredth of the largest travel at least.
        task: the path; by default each run's own, where it knows it.
        rollout: which rollout of each run.

    Raises:
        InputError: there is no such joint or no such rollout, or runs and task do not belong together.
    """
    runs = shown(run, task, rollout)
    names = check_joints(runs)
    chosen = _find_moved(runs) if joints is None else [int(j) for j in np.atleast_1d(joints)]
    if not chosen or not set(chosen) <= set(range(len(names))):
        raise InputError(
            f"joints = {joints}, expected indices from 0 to {len(names) - 1}: {', '.join(names)}",
            argument="joints",
            value=joints,
            limit=(0, len(names) - 1),
        )
    columns = min(len(chosen), 2 if len(chosen) in (2, 4) else 3)
    rows = -(-len(chosen) // columns)
    with style():
        figure = new_figure(COLUMN if columns == 1 else PAGE, 0.4 + rows * (2.5 if columns < 3 else 2.1))
        lines = []
        for place, joint in enumerate(chosen):
            axes = apply_style(figure.add_subplot(rows, columns, place + 1))
            lines += [_draw_phase(axes, one, joint) for one in runs]
            unit, rate = readable(runs[0].run, "q", joint)[1], readable(runs[0].run, "qd", joint)[1]
            axes.set_xlabel(f"{joint_label(joint, names)} [{unit}]")
            axes.set_ylabel(rf"$\dot{{q}}_{{{joint + 1}}}$ [{rate}]")
        legend(figure, _sort_lines(lines))
    return figure


def draw_path(axes: Axes, one: Shown, pair: tuple[int, int]) -> dict[str, Line2D]:
    """Draw the desired path, the actual one and its start in the plane of two joints; return the lines by label."""
    (q,), desired = readable(one.run, "q")[0], _desired(one)
    i, j = pair
    return _draw(axes, one, q[:, i], q[:, j], None if desired is None else desired[:, [i, j]])


def label_plane(axes: Axes, runs: Sequence[Shown], pair: tuple[int, int]) -> None:
    """Set limits, labels, and equal scales where the units are equal, of the plane of two joints."""
    (x, y), equal = plane_limits(runs, pair)
    unit, names = readable(runs[0].run, "q")[1], runs[0].joints
    axes.set(xlim=x, ylim=y, aspect="equal" if equal else "auto")
    axes.set_xlabel(f"{joint_label(pair[0], names)} [{unit}]")
    axes.set_ylabel(f"{joint_label(pair[1], names)} [{unit}]")


def plane_limits(
    runs: Sequence[Shown], pair: tuple[int, int]
) -> tuple[tuple[tuple[float, float], tuple[float, float]], bool]:
    """Return limits of the plane of two joints for all runs and paths, and whether its scales are equal."""
    points = [readable(one.run, "q")[0].reshape(-1, len(one.joints)) for one in runs]
    points += [desired for one in runs if (desired := _desired(one)) is not None]
    x, y = ([p[:, k] for p in points] for k in pair)
    equal = " or " not in readable(runs[0].run, "q")[1]
    return (equal_plane(x, y) if equal else (span(x), span(y))), equal


def choose_pair(runs: Sequence[Shown], joints: Sequence[int] | None) -> tuple[int, int]:
    """Return the indices of the two given joints, or of the two that move the most, in their order."""
    travel, names = _travel(runs), runs[0].joints
    if joints is not None:
        pair = tuple(joints)
        if len(pair) != 2 or not set(pair) <= set(range(len(names))):
            raise InputError(
                f"joints = {joints}, expected two indices from 0 to {len(names) - 1}: {', '.join(names)}",
                argument="joints",
                value=joints,
                limit=(0, len(names) - 1),
            )
        return int(pair[0]), int(pair[1])
    if len(travel) < 2:
        raise InputError("the arm has one joint only; path_figure draws two over one another, try phase_figure")
    i, j = sorted(np.argsort(-travel, kind="stable")[:2])
    return int(i), int(j)


def _find_moved(runs: Sequence[Shown]) -> list[int]:
    """Return the joints that move."""
    travel = _travel(runs)
    return [j for j in range(len(travel)) if travel[j] >= _STILL * travel.max()]


def _travel(runs: Sequence[Shown]) -> Array:
    """Return how far each joint moves in any of the runs, (n,)."""
    ranges = []
    for one in runs:
        q = drawable(one.run.array("q")).reshape(-1, len(one.joints))
        ranges.append([high - low for low, high in (extent([column]) for column in q.T)])
    return np.max(ranges, axis=0)


def _draw_phase(axes: Axes, one: Shown, joint: int) -> dict[str, Line2D]:
    """Draw the phase plane of one joint."""
    (q,), unit = readable(one.run, "q", joint)
    (qd,), rate = readable(one.run, "qd", joint)
    desired = None
    if one.task is not None:
        point = one.task.at(path_parameters(one))
        positions, rates = readable_like(point.q_d[:, joint], unit), readable_like(point.velocity[:, joint], rate)
        desired = np.stack([positions, rates], axis=-1)
    lines = _draw(axes, one, q, qd, desired)
    axes.set_xlim(span([np.asarray(line.get_xdata()) for line in axes.lines]))
    axes.set_ylim(span([np.asarray(line.get_ydata()) for line in axes.lines]))
    return lines


def _draw(axes: Axes, one: Shown, x: Array, y: Array, desired: Array | None) -> dict[str, Line2D]:
    """Draw a run in a plane; return the lines by their labels."""
    taken = one.label or "arm"
    lines = {taken: curve(axes, x, y, label=taken, **one.look)}
    if desired is not None:
        lines[_DESIRED] = curve(axes, *desired.T, **DESIRED_LOOK)
    axes.plot(x[:1], y[:1], color=one.colour, **START_LOOK)
    lines[_START] = Line2D([], [], color=INK, linestyle="", **START_LOOK)
    return lines


def _sort_lines(drawn: Sequence[dict[str, Line2D]]) -> dict[str, Line2D]:
    """Return the lines of all runs by their labels: the runs, then what they share."""
    lines = {label: line for found in drawn for label, line in found.items()}
    return dict(sorted(lines.items(), key=lambda item: [_DESIRED, _START].count(item[0])))


def _desired(one: Shown) -> Array | None:
    """Return the path (k, n) in the unit in which the run is drawn."""
    if one.task is None:
        return None
    return readable_like(one.task.q_d(path_parameters(one)), readable(one.run, "q")[1])
