"""The paper's figures for any run: the path in joint space, and the error norms over time.

Degrees here only, where a person reads.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pathcontrol.errors import InputError, TaskError
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.base import PathTask
from pathcontrol.view.figures.style import BLUE, GREY, ORANGE, save_figure, style


def path_figure(
    run: Run, task: PathTask | None = None, joints: tuple[int, int] | None = None, rollout: int = 0
) -> Figure:
    """q_j over q_i [deg], as in the paper's figures 7 and 9, over the desired path.

    ``joints`` are the indices (i, j); by default the two that move the most.
    """
    names = _joint_names(run)
    i, j = joints = _moving_joints(run.rollout(rollout)) if joints is None else joints
    if not {i, j} <= set(range(len(names))):
        raise InputError(f"joints = {joints}, expected two indices from 0 to {len(names) - 1}: {', '.join(names)}")
    (q,), unit = _readable(run.rollout(rollout), "q")
    with style():
        figure = Figure(figsize=(3.5, 3.5), layout="constrained")
        axes = figure.add_subplot(aspect="equal")
        desired = _desired_path(task)
        if desired is not None:
            desired = np.rad2deg(desired) if unit == "deg" else desired
            axes.plot(desired[:, i], desired[:, j], color=GREY, linewidth=2.4, label="desired path")
        axes.plot(q[:, i], q[:, j], color=BLUE, label="arm")
        axes.plot(q[0, i], q[0, j], "o", color=ORANGE, markersize=5, label="start")
        axes.set(xlabel=f"{_symbol(i, names)} [{unit}]", ylabel=f"{_symbol(j, names)} [{unit}]")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.14), ncols=3, handlelength=1.4, columnspacing=1.2)
    return figure


def error_figure(run: Run, rollout: int = 0) -> Figure:
    """‖e_p‖ [deg] and ‖e_v‖ [deg/s] over time, as in the paper's figures 8 and 10, with the steady-state peaks."""
    run = run.rollout(rollout)
    with style():
        figure = Figure(figsize=(3.5, 4.2), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True)
        _norm(upper, run, "e_p")
        _norm(lower, run, "e_v")
        lower.set(xlabel="time [s]", xlim=(0, run.time[-1]))
    return figure


def torque_figure(run: Run, limits: np.ndarray | None = None, rollout: int = 0) -> Figure:
    """Applied torques [N m] over time, one panel for each joint, beside their limits (n,) where given."""
    names = _joint_names(run)
    tau = run.rollout(rollout).array("tau")[0]
    with style():
        figure = Figure(figsize=(3.5, 1.2 + 1.1 * len(names)), layout="constrained")
        panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
        for k, axes in enumerate(panels):
            axes.plot(run.time, tau[:, k], color=BLUE)
            axes.set_ylabel(rf"$\tau_{{{k + 1}}}$ [{run['tau'].attrs['units']}]")
            if limits is not None and np.isfinite(limits[k]):
                axes.axhline(limits[k], color=ORANGE, linewidth=0.8)
                axes.axhline(-limits[k], color=ORANGE, linewidth=0.8)
        panels[-1].set(xlabel="time [s]", xlim=(0, run.time[-1]))
    return figure


def run_figure(run: Run, path: str | Path, task: PathTask | None = None) -> list[Path]:
    """The path and the error norms of a run, as ``<path>-path`` and ``<path>-errors``."""
    stem = Path(path).with_suffix("") if Path(path).suffix in (".svg", ".png") else Path(path)
    figures = {"errors": error_figure(run)}
    if run.data.sizes["joint"] > 1:
        figures["path"] = path_figure(run, task)
    return [p for name, f in figures.items() for p in save_figure(f, stem.with_name(f"{stem.name}-{name}"))]


def _norm(axes: Axes, run: Run, name: str) -> None:
    """One norm over all the time, and magnified in an inset over the second half, with its peak there."""
    vectors, unit = _readable(run, name)
    values = np.linalg.norm(vectors[0], axis=-1)
    symbol, index = name.split("_")
    label = rf"$\|\mathbf{{{symbol}}}_{index}\|$ [{unit}]"
    late = run.time >= 0.5 * run.time[-1]
    peak = values[late].max()
    axes.plot(run.time, values, color=BLUE)
    axes.set(ylabel=label, ylim=(0, 1.05 * values.max()))
    if peak > 0.3 * values.max():  # no room for an inset, and no need
        axes.axhline(peak, color=ORANGE, linewidth=0.9, linestyle=(0, (4, 2)))
        axes.set_title(f"steady-state peak {peak:.3g} {unit}", fontsize=8, color=ORANGE, loc="right", pad=3)
        return
    inset = axes.inset_axes((0.42, 0.36, 0.58, 0.5))
    inset.plot(run.time[late], values[late], color=BLUE, linewidth=0.9)
    inset.axhline(peak, color=ORANGE, linewidth=0.9, linestyle=(0, (4, 2)))
    inset.set_title(f"steady state, peak {peak:.3g} {unit}", fontsize=8, color=ORANGE, loc="right", pad=3)
    inset.set(ylim=(0, 1.15 * peak), xlim=(run.time[late][0], run.time[-1]))
    inset.tick_params(labelsize=7)


def _readable(run: Run, name: str) -> tuple[np.ndarray, str]:
    """A variable in the unit a person reads, and that unit: degrees for angles, as it is where joints slide."""
    unit = run[name].attrs["units"]
    if unit.split("/")[0] != "rad" or " or " in unit:
        return run.array(name), unit
    return np.rad2deg(run.array(name)), unit.replace("rad", "deg")


def _moving_joints(run: Run) -> tuple[int, int]:
    """The two joints that move the most, in their order; needs two."""
    travel = np.ptp(run.array("q")[0], axis=0)
    if len(travel) < 2:
        raise InputError("the arm has one joint only; path_figure draws two over one another")
    i, j = sorted(np.argsort(travel)[-2:])
    return int(i), int(j)


def _joint_names(run: Run) -> list[str]:
    return [str(name) for name in run["joint"].to_numpy()]


def _desired_path(task: PathTask | None) -> np.ndarray | None:
    """Samples of the path [rad], (K, n)."""
    if task is None:
        return None
    try:
        lower, upper = task.one_traverse
    except TaskError:
        return None  # an endless path has no whole to draw
    return task.q_d(np.linspace(lower, upper, 721))


def _symbol(index: int, names: list[str]) -> str:
    return rf"$q_{{{index + 1}}}$" if len(names) <= 2 else rf"$q_{{{index + 1}}}$ ({names[index]})"
