"""The files an experiment asks for, each written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pathcontrol._files import whole_file
from pathcontrol._json import to_json
from pathcontrol._progress import progress_bar
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.analysis.deviation import toolpath_metrics
from pathcontrol.analysis.run_metrics import UNITS, metrics
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.errors import InputError
from pathcontrol.experiments.builders.setup import Setup
from pathcontrol.experiments.schema.experiment import Output
from pathcontrol.simulation.run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FIGURES = 5  # at most


@contextlib.contextmanager
def output_folder(out_dir: Path, output: Output) -> Iterator[None]:
    """Make the output folder and see that every file can be written, before time is spent on a simulation.

    Folders that were made are removed where the block ends by an exception, or by Ctrl-C, and nothing is in them.

    Raises:
        InputError: the folder is named like a file, cannot be made or written to, or is where a file should go.
    """
    targets = [out_dir / name for name in output.model_dump(exclude_none=True, exclude={"figure_joints"}).values()]
    folders = {folder for target in targets for folder in target.parents}
    new = sorted((folder for folder in folders if not folder.exists()), key=lambda folder: -len(folder.parts))
    try:
        _check_folder(out_dir, targets)
        yield
    except BaseException:
        for folder in new:
            with contextlib.suppress(OSError):  # it is not empty
                folder.rmdir()
        raise


def _check_folder(out_dir: Path, targets: Sequence[Path]) -> None:
    """Make the folder, and see that files can be written."""
    refuse_suffix(out_dir, "a folder", name="out_dir")
    for target in targets:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"the output folder {str(target.parent)!r} cannot be made: {error}", file=str(target.parent)
            ) from error
        if not os.access(target.parent, os.W_OK):
            raise InputError(f"the output folder {str(target.parent)!r} cannot be written to", file=str(target.parent))
        if target.is_dir():
            raise InputError(
                f"there is a folder where the file {str(target)!r} should go; remove or rename it", file=str(target)
            )


def measure_run(run: Run, setup: Setup) -> dict[str, Any]:
    """Return the metrics of a run as JSON can hold them: those of a toolpath, or the usual ones."""
    if isinstance(setup.task, ToolpathTask):
        return to_json(toolpath_metrics(run, setup.plant, setup.task))
    return to_json(metrics(run, setup.task))


def write_outputs(
    run: Run, numbers: dict[str, Any], setup: Setup, out_dir: Path, progress: bool = True
) -> dict[str, Path]:
    """Write the files that ``setup.output`` names, with a bar for what takes a while.

    Returns:
        The files by what they are: ``data``, ``summary``, ``html``, and ``figure-…`` for each figure.
    """
    output = setup.output
    written = {"data": run.save(out_dir / output.data)}
    if output.summary:
        written["summary"] = _write_summary(numbers, out_dir / output.summary)
    if output.figure:
        with progress_bar("drawing figures", _FIGURES, progress, at_once=True) as update:
            update(0)
            for i, files in enumerate(_write_figures(run, setup, out_dir / output.figure)):
                written |= files
                update(i + 1)
    if output.html:
        with progress_bar("writing the animation", 1, progress, at_once=True) as update:
            update(0)
            written["html"] = _write_html(run, setup, out_dir / output.html)
    return written


def _write_summary(numbers: dict[str, Any], path: Path) -> Path:
    text = json.dumps(numbers | {"units": {name: UNITS[name] for name in numbers}}, indent=2, allow_nan=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return path


def _write_figures(run: Run, setup: Setup, path: Path) -> Iterator[dict[str, Path]]:
    """Write the figures; yield the files of each when they are there."""
    from pathcontrol.view.figures.run_figures import add_name, draw_figures
    from pathcontrol.view.figures.style import save_figure

    def save(name: str, figure: Figure) -> dict[str, Path]:
        files, stem = save_figure(figure, add_name(path, name)), path.with_suffix("").name
        return {f"figure{file.name.removeprefix(stem)}": file for file in files}

    pair = setup.output.figure_joints
    joints = None if pair is None else (pair[0], pair[1])
    for name, figure in draw_figures(run, setup.task, joints, setup.plant.limits.effort):
        yield save(name, figure)
    if isinstance(setup.task, ToolpathTask):
        from pathcontrol.view.figures.deviation_figure import deviation_figure

        yield save("deviation", deviation_figure(run, setup.plant, setup.task))


def _write_html(run: Run, setup: Setup, path: Path) -> Path:
    from pathcontrol.view.animation.record import record

    record(run, setup.plant, task=setup.task).save(path)
    return path
