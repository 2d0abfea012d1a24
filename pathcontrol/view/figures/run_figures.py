"""The figures of any run, its path, errors, torques and speed, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from pathcontrol._suffixes import refuse_suffix
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.figures.error_figures import error_figure as error_figure
from pathcontrol.view.figures.path_figures import path_figure as path_figure
from pathcontrol.view.figures.speed_figure import speed_figure
from pathcontrol.view.figures.style import save_figure, stem_of
from pathcontrol.view.figures.torque_figure import torque_figure


def run_figure(
    run: Run,
    path: str | Path,
    task: PathTask | None = None,
    *,
    joints: tuple[int, int] | None = None,
    limits: ArrayLike | None = None,
) -> list[Path]:
    """Write the figures of a run: ``<path>-errors``, ``-path``, ``-torque`` and ``-speed``, as SVG and PNG.

    Args:
        run: what happened.
        path: the beginning of the names of the files; with the suffix ``.pdf`` they are written as PDF too.
        task: the path; by default the run's own.
        joints: which two the path is drawn in; by default the two that move the most.
        limits: largest torques (n,); by default those of the run's own robot.
    """
    refuse_suffix(path, "figures", ".svg", ".png", ".pdf")
    figures = dict(draw_figures(run, task, joints, limits))
    return [file for name, figure in figures.items() for file in save_figure(figure, add_name(path, name))]


def draw_figures(
    run: Run, task: PathTask | None, joints: tuple[int, int] | None, limits: ArrayLike | None
) -> Iterator[tuple[str, Figure]]:
    """Yield the figures of :func:`run_figure` by name, one after another, as each takes a while."""
    yield "errors", error_figure(run)
    if len(run.joints) > 1:
        yield "path", path_figure(run, task, joints)
    yield "torque", torque_figure(run, limits)
    yield "speed", speed_figure(run, task)


def add_name(path: str | Path, name: str) -> Path:
    """Return ``path`` with ``-name`` at its end, before the suffix of a format."""
    stem = stem_of(path)
    return stem.with_name(f"{stem.name}-{name}{Path(path).name.removeprefix(stem.name)}")
