"""One call from an experiment file with a ``[tune]`` to what was found."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.file_errors import report_by_key
from pathcontrol.experiments.load import load_experiment, make_build_error, read_toml
from pathcontrol.experiments.samples.swept_experiment import SweptExperiment
from pathcontrol.experiments.schema.sweep_sections import TuneSection
from pathcontrol.experiments.sweep_runner import of_samples, values_of
from pathcontrol.simulation.engines import Engine
from pathcontrol.sweeps.chunk import make_measure
from pathcontrol.sweeps.space import Space
from pathcontrol.tuning.tune import tune
from pathcontrol.tuning.tuning_result import Tuning


def run_tune(
    path: str | Path,
    out: str | Path,
    *,
    chunk: int = 500,
    resume: bool = False,
    progress: bool = True,
    engine: Engine | None = None,
) -> Tuning:
    """Run the tuning of an experiment file; both ends of what is searched are checked before anything is computed.

    Args:
        path: the experiment file, with a section ``[tune]``; paths in it are relative to its folder.
        out: the folder that notes every rollout, made if need be.
        chunk: how many rollouts are simulated together at most.
        resume: go on with the tuning in ``out``, if there is one.
        progress: show a bar with the time left on standard error when it takes longer than two seconds.
        engine: which engine runs the simulations, instead of what the file says.

    Raises:
        ExperimentError: the file is invalid.
        InputError: ``out`` holds a sweep or a tuning and ``resume`` is not asked for, or it holds another one.
        MissingExtraError: the extra ``tune`` or ``sweep`` is not installed.
    """
    section = load_experiment(path).tune
    try:
        if section is None:
            raise ExperimentError("tune: missing; add a section [tune] with parameters and objectives", argument="tune")
        varied = {"parameters": section.parameters, "scenarios": section.scenarios}
        data = of_samples(read_toml(path)) | ({} if engine is None else {"engine": engine})
        build = SweptExperiment(data, Path(path).parent.absolute(), varied, "tune")
        space = _space(section)
        for key, names in (("objectives", section.objectives), ("limits", section.limits or ())):
            with report_by_key(f"tune.{key}"):
                make_measure([names] if isinstance(names, str) else list(names))
        with report_by_key("tune"):
            scenarios = None if section.scenarios is None else Space.given(section.scenarios)
        _check(build, space, scenarios)
    except ExperimentError as error:
        raise make_build_error(path, error) from error
    options = {"out": out, "chunk": chunk, "resume": resume, "progress": progress} | section.arguments(float)
    return tune(build, space, scenarios=scenarios, **options)


def _space(section: TuneSection) -> Space:
    for key, given in section.parameters.items():
        if "normal" in given:
            raise ExperimentError(
                f"tune.parameters.{key}: normal has no ends to search between; give uniform = [a, b]",
                argument=f"tune.parameters.{key}",
                value=given["normal"],
            )
    values = {key: values_of(f"tune.parameters.{key}", given) for key, given in section.parameters.items()}
    with report_by_key("tune.parameters"):
        return Space.random(values, 1)


def _check(build: SweptExperiment, space: Space, scenarios: Space | None) -> None:
    """Check that the least and the largest values, in every scenario, are valid experiments."""
    design = {} if scenarios is None else scenarios.design()
    count = 1 if scenarios is None else scenarios.samples
    ends = space.at(np.repeat([[0.0], [1.0]], space.width, axis=1))
    build.check(
        {name: np.repeat(values, count, axis=0) for name, values in ends.items()}
        | {name: np.concatenate([values] * 2) for name, values in design.items()}
    )
