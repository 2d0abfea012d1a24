"""A chunk of a sweep: its rollouts are simulated together and reduced to numbers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array, as_array
from pathcontrol.analysis.metric_names import check_metric_names
from pathcontrol.analysis.progress import is_unfinished
from pathcontrol.analysis.run_metrics import metrics
from pathcontrol.analysis.window import own_samples
from pathcontrol.errors import InputError, SimulationError, UnknownNameError
from pathcontrol.simulation.checks.too_long import StepWarning
from pathcontrol.simulation.engines import Engine
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.simulate import simulate
from pathcontrol.sweeps.histories import Keep
from pathcontrol.sweeps.step_warnings import find_step_warnings

Arguments = Mapping[str, Any]
Parts = Sequence[tuple[NDArray[np.intp], Arguments]]
#: from parameters (k,) or (k, d) each and the numbers of their samples (k,) to the arguments of simulate()
Build = Callable[[Mapping[str, Array], NDArray[np.int64]], Arguments | Parts]
#: numbers of a run, each with one entry for each rollout
Measure = Callable[[Run], Mapping[str, ArrayLike]]
#: the input of a chunk: its parameters (k,) or (k, d) each, and the numbers of its samples (k,)
Piece = tuple[dict[str, Array], NDArray[np.int64]]

#: the outcome of a rollout, beside its metrics
OUTCOME = ("status", "finish_time", "diverged_time", "reason")
_BLOCK = 128  # rollouts that are measured together: it bounds the memory for their distances
_NOT_YOURS = ("first_rollout", "progress")


class Chunk(NamedTuple):
    """The results of some samples.

    Attributes:
        columns: their numbers and texts by name, (k,) or (k, d) each.
        runs: the histories that may have to be kept, by sample.
        warnings: warnings of a period or of steps that are too long.
    """

    columns: dict[str, Array]
    runs: dict[int, Run]
    warnings: tuple[str, ...] = ()


class Job(NamedTuple):
    """The computation of any chunk.

    Attributes:
        build: maps parameters and samples to the arguments of simulations.
        measure: maps a run to numbers, one for each rollout.
        keep: the histories to keep.
        at_random: the samples whose histories are kept by chance.
        engine: the engine of the simulations where ``build`` names none.
    """

    build: Build
    measure: Measure
    keep: Keep = Keep()
    at_random: NDArray[np.intp] = np.empty(0, dtype=np.intp)
    engine: Engine = "auto"

    def __call__(self, parameters: Mapping[str, Array], samples: NDArray[np.int64]) -> Chunk:
        """Simulate and measure ``samples`` (k,), with the values of their ``parameters``, (k,) or (k, d) each.

        Raises:
            InputError: the parameters, or what was built of them, are refused; the message says of which samples.
        """
        return _compute(self, parameters, samples)


def make_measure(wanted: Sequence[str] | Measure | None) -> Measure:
    """Return the function that measures runs: all usual metrics, the ``wanted`` ones, or a function of the user.

    Raises:
        UnknownNameError: there is no such metric.
    """
    if wanted is None:
        return metrics
    if callable(wanted):
        return wanted
    check_metric_names("metrics", wanted, also=", or a function of a Run")
    return lambda run: _select_metrics(metrics(run, only=wanted), wanted)


def _select_metrics(values: Mapping[str, ArrayLike], wanted: Sequence[str]) -> dict[str, ArrayLike]:
    """Return the ``wanted`` metrics; raise if one is missing."""
    missing = [name for name in wanted if name not in values]
    if missing:
        raise UnknownNameError(
            f"metrics = {missing}: not defined for these runs; leave it out",
            argument="metrics",
            value=missing,
            choices=tuple(values),
        )
    return {name: values[name] for name in wanted}


def _compute(job: Job, parameters: Mapping[str, Array], samples: NDArray[np.int64]) -> Chunk:
    """Simulate and measure samples, as :class:`Job` does."""
    measured: dict[str, Array] = {}
    runs: dict[int, Run] = {}
    warnings: list[str] = []
    try:
        built = job.build(parameters, samples)
        parts = [(np.arange(len(samples)), built)] if isinstance(built, Mapping) else built
        for rows, arguments in parts:
            run = _simulate(job.engine, samples[rows], arguments)
            warnings += find_step_warnings(arguments, samples[rows])
            values = _measure(run, job.measure)
            _put(measured, values, rows, len(samples))
            for row in _candidates(values, samples[rows], job.keep, job.at_random):
                at = rows[row]
                alone = run if run.rollouts == 1 else _simulate_alone(job, parameters, samples, at)
                runs[int(samples[at])] = _history(
                    alone, {name: value[at].tolist() for name, value in parameters.items()}
                )
    except InputError as error:
        raise InputError(f"samples {samples[0]} to {samples[-1]}: {error}", **error.details_with()) from error
    clash = set(parameters) & set(measured) | {"sample"} & set(measured)
    if clash:
        raise InputError(
            f"{', '.join(sorted(clash))}: both a parameter and a metric; call one of them otherwise",
            value=sorted(clash),
        )
    return Chunk({"sample": samples, **parameters, **measured}, runs, tuple(warnings))


def _simulate(engine: Engine, samples: NDArray[np.int64], arguments: Arguments) -> Run:
    """Simulate samples with the built arguments; check that there is one rollout for each."""
    taken = [name for name in _NOT_YOURS if name in arguments]
    if taken:
        raise InputError(
            f"build gives {', '.join(taken)}, which the sweep sets itself; leave it out", argument=taken[0]
        )
    loop = arguments.get("loop")
    noisy = isinstance(loop, SampledLoop) and loop.noise is not None
    if noisy and (np.diff(samples) != 1).any():
        raise InputError("the rows of a part with sensor noise have to follow one another, as noise goes by sample")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StepWarning)  # the sweep warns of each kind once
            run = simulate(**({"engine": engine} | dict(arguments)), first_rollout=int(samples[0]), progress=False)
    except SimulationError as error:
        if error.run is None:
            raise
        run = error.run
    if run.rollouts != len(samples):
        raise InputError(
            f"build gives {run.rollouts} rollouts for {len(samples)} samples; make q (k, n), one row each",
            value=run.rollouts,
            limit=len(samples),
        )
    return run


def _measure(run: Run, measure: Measure) -> dict[str, Array]:
    """Return the outcome and the metrics of each rollout, as if it had been alone, (k,) each."""
    values: dict[str, Array] = {name: np.array(run.array(name)) for name in OUTCOME}
    values["status"] = np.where(is_unfinished(run), "unfinished", values["status"])
    sound = values["status"] != "diverged"
    some = np.flatnonzero(sound) if sound.any() else np.array([0])  # one at least, for the names
    for rows, part in _blocks(run, some):
        for name, value in measure(part).items():
            array = as_array(name, value)
            if array.shape != (len(rows),):
                raise InputError(
                    f"the metric {name} has shape {array.shape}, expected ({len(rows)},): one a rollout",
                    argument=name,
                    value=array,
                )
            _put(values, {name: np.where(sound[rows], array, np.nan)}, rows, run.rollouts)
    return values


def _blocks(run: Run, some: NDArray[np.intp]) -> Iterator[tuple[NDArray[np.intp], Run]]:
    """Yield some rollouts of a run, a few at a time, which end when all of these would have ended alone."""
    ends = count_samples_alone(run)
    for end in np.unique(ends[some]):
        rows = some[ends[some] == end]
        for first in range(0, len(rows), _BLOCK):
            block = rows[first : first + _BLOCK]
            yield block, run.excerpt(block, int(end))


def count_samples_alone(run: Run) -> NDArray[np.intp]:
    """Return the number of samples that each rollout would have alone: until it finished or diverged, (k,)."""
    ends = (run.status == "diverged") | ((run.status == "finished") & (run.config.get("until") == "end"))
    return np.where(ends, own_samples(run), len(run.time))


def _put(into: dict[str, Array], values: Mapping[str, Array], rows: NDArray[np.intp], count: int) -> None:
    """Put values of some ``rows`` into columns of ``count`` rows; others are NaN, or empty texts."""
    for name, value in values.items():
        if value.dtype.kind == "U":
            value = value.astype(object)
        if name not in into:
            into[name] = np.full(count, "" if value.dtype == object else np.nan, dtype=value.dtype)
        into[name][rows] = value


def _candidates(
    values: Mapping[str, Array], samples: NDArray[np.int64], keep: Keep, at_random: NDArray[np.intp]
) -> list[int]:
    """Return the rows that may have to be kept, regardless of the other samples."""
    if keep.worst and (keep.by not in values or values[keep.by].dtype.kind not in "fiu"):
        known = [name for name in values if name not in OUTCOME]
        raise UnknownNameError(
            f"keep.by = {keep.by!r}, expected a metric: {', '.join(known)}",
            argument="keep.by",
            value=keep.by,
            choices=tuple(known),
        )
    by = values[keep.by] if keep.worst else np.full(len(samples), np.nan)
    chosen = keep.chosen(samples, by, values["status"] == "diverged") | set(at_random.tolist())
    return [row for row, sample in enumerate(samples.tolist()) if sample in chosen]


def _simulate_alone(job: Job, parameters: Mapping[str, Array], samples: NDArray[np.int64], at: int) -> Run:
    """Simulate one sample alone, so that its run describes its own gains, arm and path, not those of the chunk."""
    built = job.build({name: value[[at]] for name, value in parameters.items()}, samples[[at]])
    [(_, arguments)] = [(0, built)] if isinstance(built, Mapping) else built
    return _simulate(job.engine, samples[[at]], arguments)


def _history(alone: Run, parameters: Mapping[str, Any]) -> Run:
    """Return the run of one sample up to its end, with its ``parameters``."""
    kept = alone.excerpt(np.array([0]), int(count_samples_alone(alone)[0]))
    kept.config["sweep"] = {"sample": int(alone.array("rollout")[0]), **parameters}
    return kept
