"""One call from an experiment file with a ``[sweep]`` to its table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.builders.file_errors import report_by_key
from pathcontrol.experiments.load import load_experiment, make_build_error, read_toml
from pathcontrol.experiments.samples.swept_experiment import SweptExperiment
from pathcontrol.experiments.schema.sweep_sections import SweepSection
from pathcontrol.simulation.engines import Engine
from pathcontrol.sweeps.chunk import make_measure
from pathcontrol.sweeps.cluster.connection import connect
from pathcontrol.sweeps.histories import Keep
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.sweeps.space import Space
from pathcontrol.sweeps.sweep import sweep

if TYPE_CHECKING:
    from distributed import Client, Security


def run_sweep(
    path: str | Path,
    out: str | Path,
    *,
    chunk: int = 500,
    resume: bool = False,
    progress: bool = True,
    cluster: str | Path | Client | None = None,
    security: Security | None = None,
    engine: Engine | None = None,
) -> SweepResult:
    """Run the sweep of an experiment file; every sample is checked before anything is computed.

    Args:
        path: the experiment file, with a section ``[sweep]``; paths in it are relative to its folder.
        out: the folder of the sweep, made if need be.
        chunk: how many samples are simulated together at most.
        resume: go on with the sweep in ``out``, if there is one.
        progress: show a bar with the time left on standard error when it takes longer than two seconds.
        cluster: a Dask cluster whose workers compute the chunks, as :func:`sweep` takes it; files that the experiment
            names are sent to them.
        security: certificates for TLS, a ``distributed.Security``, where the cluster asks for some.
        engine: which engine runs the simulations, instead of what the file says.

    Raises:
        ClusterError: the cluster does not answer or cannot go on, or a worker has other versions than this process.
        ExperimentError: the file is invalid.
        InputError: ``out`` holds a sweep and ``resume`` is not asked for, or it holds another one.
        MissingExtraError: the extra ``sweep`` or, for a cluster, ``cluster`` is not installed.
    """
    section = load_experiment(path).sweep
    with connect(cluster, security) as client:
        try:
            if section is None:
                raise ExperimentError("sweep: missing; add a section [sweep] with its parameters", argument="sweep")
            data = of_samples(read_toml(path)) | ({} if engine is None else {"engine": engine})
            build = SweptExperiment(data, Path(path).parent.absolute(), section.parameters)
            space = space_of(section)
            options = section.arguments(float)
            with report_by_key("sweep", ("metrics",)):
                make_measure(options.get("metrics"))
                if "keep" in options:
                    options["keep"] = Keep(**options["keep"].arguments(float))
                design = space.design(section.seed)
            build.check(design)
        except ExperimentError as error:
            raise make_build_error(path, error) from error
        return sweep(build, space, out, chunk=chunk, resume=resume, progress=progress, cluster=client, **options)


def space_of(section: SweepSection) -> Space:
    """Return the samples that a section ``[sweep]`` asks for.

    Raises:
        ExperimentError: the parameters do not fit the method.
    """
    parameters = {key: values_of(f"sweep.parameters.{key}", given) for key, given in section.parameters.items()}
    if (section.method == "grid") != (section.samples is None):
        large = "is as large as its grids; leave samples out, or take method = 'random'"
        said = large if section.method == "grid" else "needs samples = …"
        raise ExperimentError(
            f"sweep.samples: method = {section.method!r} {said}", argument="sweep.samples", value=section.samples
        )
    with report_by_key("sweep", ("samples",)):
        return Space(parameters, section.method, section.samples)


def values_of(key: str, given: dict[str, list[Any]]) -> Any:
    """Return the values of a grid, or the frozen distribution; errors tell the ``key``."""
    from scipy import stats

    [(kind, values)] = given.items()
    if kind == "grid":
        return values
    with report_by_key(key):
        try:
            a, b = (np.asarray(value, dtype=np.float64) for value in values)
            a, b = np.broadcast_arrays(a, b)
        except (TypeError, ValueError) as error:
            raise ExperimentError(
                f"{key}: {kind} = {values}, expected numbers or lists", argument=key, value=values
            ) from error
        least = {"uniform": a < b, "log_uniform": (a > 0) & (a < b), "normal": b > 0}[kind]
        if not least.all() or not np.isfinite([a, b]).all():
            wanted = {"uniform": "a < b", "log_uniform": "0 < a < b", "normal": "a deviation greater than 0"}[kind]
            raise ExperimentError(f"{key}: {kind} = {values}, expected {wanted}", argument=key, value=values)
    a, b = a[()], b[()]
    if kind == "uniform":
        return stats.uniform(a, b - a)
    return stats.norm(a, b) if kind == "normal" else stats.loguniform(a, b)


def of_samples(data: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a file that are about each sample."""
    return {name: value for name, value in data.items() if name not in ("sweep", "tune", "output")}
