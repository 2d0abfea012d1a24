"""One call from an experiment file to its run and the files it asks for."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._files import as_path
from pathcontrol.errors import ExperimentError, warn
from pathcontrol.experiments.builders.setup import Setup, build
from pathcontrol.experiments.load import load_experiment, make_build_error, read_text
from pathcontrol.experiments.outputs import measure_run, output_folder, write_outputs
from pathcontrol.simulation.engines import Engine
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.sequence import simulate_sequence
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.joined.path_sequence import PathSequence


class Outcome(NamedTuple):
    """The results of an experiment.

    Attributes:
        run: the run; ``run.config["experiment"]`` is the text of the file.
        metrics: its :func:`metrics`, fit for JSON: null where a number is not finite.
        written: the files, by what they are; see :func:`write_outputs`.
    """

    run: Run
    metrics: dict[str, Any]
    written: dict[str, Path]


def run_experiment(
    path: str | Path, out_dir: str | Path, progress: bool = True, engine: Engine | None = None
) -> Outcome:
    """Run the experiment of a file; everything it says is checked before anything is computed.

    Args:
        path: the experiment file; paths in it are relative to its folder.
        out_dir: the folder to write to, made if need be.
        progress: show a bar on standard error when it takes longer than two seconds.
        engine: which engine runs it, instead of what the file says.

    Raises:
        EngineError: the compiled engine is asked for and cannot run it.
        ExperimentError: the file is invalid.
        InputError: ``out_dir`` cannot be written to.
        SimulationError: the simulation diverged.
    """
    setup, text, out_dir = load_setup(path), read_text(path), as_path("out_dir", out_dir)
    with output_folder(out_dir, setup.output):
        run = _simulate(setup if engine is None else setup._replace(engine=engine), progress)
        run.config["experiment"] = text
        numbers = measure_run(run, setup)
        return Outcome(run, numbers, write_outputs(run, numbers, setup, out_dir, progress))


def _simulate(setup: Setup, progress: bool) -> Run:
    options: dict[str, Any] = {"plant": setup.plant, "loop": setup.loop, "disturbance": setup.disturbance}
    options |= {"engine": setup.engine, "progress": progress}
    if isinstance(setup.task, PathSequence):
        options["task"] = setup.task
        _warn_of_timed_override(setup)
        return simulate_sequence(setup.controllers, setup.q, setup.qd, duration=setup.duration, **options)
    options |= {"laps": setup.laps, "until": setup.until}
    return simulate(setup.controller, setup.q, setup.qd, duration=float(setup.duration), **options)


def _warn_of_timed_override(setup: Setup) -> None:
    """Warn of steps of an override in time where several paths are followed, each with a time of its own."""
    steps, paths = np.asarray(setup.controller.describe().get("override", 1.0)), len(setup.controllers)
    if paths > 1 and steps.ndim == 2 and (steps[:, 0] > 0).any():
        warn(
            f"override = {steps.tolist()}: its times count from the begin of each of the {paths} paths, so that each "
            "is held, slowed down or turned back; in Python simulate_sequence takes an override for each path"
        )


def load_setup(path: str | Path) -> Setup:
    """Return the objects that an experiment file names, built and checked.

    Raises:
        ExperimentError: the file is invalid.
    """
    experiment = load_experiment(path)
    try:
        return build(experiment, Path(path).parent)
    except ExperimentError as error:
        raise make_build_error(path, error) from error
