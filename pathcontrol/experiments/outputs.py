"""The files an experiment asks for, each written whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from pathcontrol._files import whole_file
from pathcontrol._json import to_json
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.analysis.deviation import toolpath_metrics
from pathcontrol.analysis.run_metrics import UNITS, metrics
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import InputError
from pathcontrol.experiments.builders.setup import Setup
from pathcontrol.experiments.schema.experiment import Output
from pathcontrol.simulation.run import Run


def check_folder(out_dir: Path, output: Output) -> None:
    """Make the output folder and see that every file can be written, before time is spent on a simulation.

    Raises:
        InputError: the folder is named like a file, cannot be made or written to, or is where a file should go.
    """
    refuse_suffix(out_dir, "a folder")
    for name in output.model_dump(exclude_none=True, exclude={"figure_joints"}).values():
        target = out_dir / name
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"the output folder {str(target.parent)!r} cannot be made: {error}") from error
        if not os.access(target.parent, os.W_OK):
            raise InputError(f"the output folder {str(target.parent)!r} cannot be written to")
        if target.is_dir():
            raise InputError(f"there is a folder where the file {str(target)!r} should go; remove or rename it")


def measure_run(run: Run, setup: Setup) -> dict[str, Any]:
    """Return the metrics of a run as JSON can hold them: those of a toolpath, or the usual ones."""
    if isinstance(setup.task, ToolpathTask):
        return to_json(toolpath_metrics(run, setup.plant, setup.task))
    return to_json(metrics(run, setup.task))


def write_outputs(run: Run, numbers: dict[str, Any], setup: Setup, out_dir: Path) -> dict[str, Path]:
    """Write the files that ``setup.output`` names.

    Returns:
        The files by what they are: ``data``, ``summary``, ``html``, and ``figure-…`` for each figure.
    """
    output = setup.output
    written = {"data": run.save(out_dir / output.data)}
    if output.summary:
        written["summary"] = _write_summary(numbers, out_dir / output.summary)
    if output.figure:
        written |= _write_figures(run, setup, out_dir / output.figure)
    if output.html:
        written["html"] = _write_html(run, setup, out_dir / output.html)
    return written


def _write_summary(numbers: dict[str, Any], path: Path) -> Path:
    text = json.dumps(numbers | {"units": {name: UNITS[name] for name in numbers}}, indent=2, allow_nan=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return path


def _write_figures(run: Run, setup: Setup, path: Path) -> dict[str, Path]:
    from pathcontrol.view.figures.run_figures import add_name, run_figure

    pair = setup.output.figure_joints
    joints = None if pair is None else (pair[0], pair[1])
    figures = run_figure(run, path, setup.task, joints=joints, limits=setup.plant.limits.effort)
    if isinstance(setup.task, ToolpathTask):
        from pathcontrol.view.figures.deviation_figure import deviation_figure
        from pathcontrol.view.figures.style import save_figure

        figures += save_figure(deviation_figure(run, setup.plant, setup.task), add_name(path, "deviation"))
    stem = path.with_suffix("").name
    return {f"figure{figure.name.removeprefix(stem)}": figure for figure in figures}


def _write_html(run: Run, setup: Setup, path: Path) -> Path:
    from pathcontrol.view.animation.record import record

    record(run, setup.plant, task=setup.task).save(path)
    return path
