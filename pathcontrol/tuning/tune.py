"""The function :func:`tune`, from a space of gains to the best ones within limits, and to the cost of the limits."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import xarray as xr

from pathcontrol._arrays import Array, check_whole
from pathcontrol._expect import expect, expect_choice
from pathcontrol._progress import progress_bar
from pathcontrol.arguments import Form
from pathcontrol.errors import InputError
from pathcontrol.simulation.engines import Engine, settle_engine
from pathcontrol.sweeps.chunk import OUTCOME, Build, Job, Measure, make_measure
from pathcontrol.sweeps.histories import Keep
from pathcontrol.sweeps.objectives import Limits, Objectives, check_limits, check_objectives
from pathcontrol.sweeps.result import dataset
from pathcontrol.sweeps.space import MOST_NUMBERS, MOST_SAMPLES, Space, check_seed, digest
from pathcontrol.sweeps.store import Store
from pathcontrol.sweeps.sweep import fingerprint, open_store
from pathcontrol.tuning.cases import Cases
from pathcontrol.tuning.optimizer import Search
from pathcontrol.tuning.problem import Reduce, Terms
from pathcontrol.tuning.tuning_result import Tuning


def tune(
    build: Build,
    space: Space | Mapping[str, Any],
    objectives: Objectives,
    *,
    limits: Limits | None = None,
    scenarios: Space | Mapping[str, Any] | None = None,
    reduce: Reduce = "worst",
    metrics: Annotated[Sequence[str] | Measure | None, Form.TEXTS] = None,
    population: int = 40,
    generations: int = 25,
    seed: int = 0,
    chunk: int = 500,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = True,
    engine: Engine = "auto",
) -> Tuning:
    """Search gains, or other parameters, for objectives within limits; a generation is one batch of simulations.

    The result has every candidate that was tried, which of them keep the limits, the best ones, the Pareto front and
    what each limit costs. A candidate that diverges, or has an objective that is not finite, counts as beyond all
    limits. That none keeps the limits is a result, too: it says which limit is missed, and by how much.

    The optimiser sees the unit cube; a parameter is the quantile of its distribution there, so that a
    ``stats.loguniform`` is searched in its logarithm. The same seed gives the same candidates, whatever ``chunk`` is,
    in a sampled loop. After Ctrl-C the result has the generations that are whole.

    Args:
        build: as of :func:`sweep`: from parameters, (k,) or (k, d) each, and the numbers of k samples to the arguments
            of :func:`simulate`. Parameters are those of ``space`` and of ``scenarios``.
        space: the parameters that are searched, by name: a distribution of ``scipy.stats``, or a list of values. Of a
            :class:`Space` its parameters.
        objectives: a metric that is to be small, several, or ``"min"`` or ``"max"`` by name.
        limits: of metrics the largest value allowed, or (smallest, largest), of which one may be None.
        scenarios: what each candidate has to cope with: parameters with a value for each scenario, such as payloads, or
            a :class:`Space` with so many samples. Sensor noise goes by the number of the sample, so that each of
            ``{"repeat": range(5)}`` is another realisation.
        reduce: of the scenarios of a candidate the ``"worst"`` value of each metric counts, or the ``"mean"``.
        metrics: more metrics for the table, by name, or a function from a :class:`Run` to numbers by name in place of
            the usual ones.
        population: candidates in a generation, from 5.
        generations: number of generations.
        seed: seed of the random numbers.
        chunk: largest number of rollouts simulated together.
        out: a folder that notes every rollout, as that of a sweep does; :class:`SweepResult` reads it.
        resume: go on with the tuning in ``out``, if there is one.
        progress: show a bar with the time left on standard error when it takes longer than two seconds.
        engine: the engine of the simulations, as for :func:`simulate`, where ``build`` names none.

    Raises:
        InputError: an argument has the wrong value, or ``out`` holds something else.
        UnknownNameError: there is no such metric.
        MissingExtraError: the extra ``tune`` is not installed.
    """
    terms = Terms(check_objectives(objectives), check_limits(limits), _check_reduce(reduce))
    check_whole("population", population, 5)
    check_whole("generations", generations)
    check_whole("chunk", chunk)
    wanted = metrics if callable(metrics) else list(dict.fromkeys((*terms.metrics, *(metrics or ()))))
    space, several = _make_space(space, "random"), None if scenarios is None else _make_space(scenarios, "given")
    count = 1 if several is None else several.samples
    _check_size(space.width, population, generations, count)
    search = Search(space.width, (len(terms.goals), 1 + len(terms.bounds)), population, check_seed(seed))
    design = {} if several is None else several.design(seed)
    engine = settle_engine(engine)
    if both := set(design) & set(space.names):
        raise InputError(
            f"{', '.join(sorted(both))}: both searched and in the scenarios; call one of them otherwise",
            value=sorted(both),
        )
    definition = _definition(terms, build, (space, several), digest(list(design.values())), wanted) | {
        "population": population,
        "generations": generations,
        "seed": seed,
        "engine": engine,
    }
    total, measure = population * generations * count, make_measure(wanted)
    folder = nullcontext() if out is None else open_store(out, total, json.loads(json.dumps(definition)), resume)
    tables: list[xr.Dataset] = []
    with folder as store, progress_bar("tune", generations, progress) as update:
        cases = Cases(Job(build, measure, engine=engine), design, count, chunk, store, _read_recorded(store))
        try:
            for _ in range(generations):
                tables.append(
                    _run_generation(search, space, cases, terms, sum(table.sizes["sample"] for table in tables))
                )
                update(len(tables))
        except KeyboardInterrupt:
            if not tables:
                raise
    return Tuning(xr.concat(tables, "sample"), terms, count, (len(tables), generations))


def _check_size(width: int, population: int, generations: int, scenarios: int) -> None:
    """Check that a generation fits into memory, and that all of them are not more than a sweep may have."""
    if population * width > MOST_NUMBERS or population * generations * scenarios > MOST_SAMPLES:
        raise InputError(
            f"population = {population} candidates of {width} numbers, generations = {generations} and {scenarios} "
            f"scenarios, expected at most {MOST_SAMPLES} simulations, and {MOST_NUMBERS} numbers in a generation",
            argument="population",
            value=population,
        )


def _definition(
    terms: Terms,
    build: Build,
    spaces: tuple[Space, Space | None],
    scenarios: str,
    metrics: Sequence[str] | Measure,
) -> dict[str, Any]:
    """Return what the numbers of a candidate depend on, with the digest of its ``scenarios``."""
    described = [space.describe()["parameters"] for space in spaces if space is not None]
    return terms.describe() | {
        "build": fingerprint(build),
        "space": {"parameters": {name: value for one in described for name, value in one.items()}},
        "scenarios_sha256": scenarios,
        "metrics": fingerprint(metrics) if callable(metrics) else metrics,
    }


def _read_recorded(store: Store | None) -> Mapping[str, Array]:
    """Return the rollouts recorded before, by column."""
    if store is None:
        return {}
    store.tidy(Keep(), np.zeros(0, dtype=np.intp))
    known = store.columns()
    if len(known["sample"]) and "status" not in known:
        raise InputError(
            f"the tuning in {str(store.folder)!r} has no status of its candidates; begin it anew",
            file=str(store.folder),
        )
    return known


def _run_generation(search: Search, space: Space, cases: Cases, terms: Terms, first: int) -> xr.Dataset:
    """Simulate the candidates of the next generation and give their evaluation to the search."""
    parameters = space.at(search.ask())
    rows = cases.rows(parameters, first)
    inputs = {"sample", *OUTCOME, *parameters, *cases.scenarios}
    numbers = {name: _split_scenarios(name, v, cases.count) for name, v in rows.items() if name not in inputs}
    status = rows["status"].reshape(-1, cases.count)
    every = np.where((status == "finished").all(1), "finished", "running")
    every = np.where((status == "unfinished").any(1), "unfinished", every)
    columns = {
        "sample": first + np.arange(len(status)),
        **parameters,
        "status": np.where((status == "diverged").any(1), "diverged", every),
        **{name: terms.reduce_scenarios(name, values) for name, values in numbers.items()},
    }
    table = dataset(columns, parameters)
    search.tell(terms.evaluate(table))
    return table


def _split_scenarios(name: str, values: Array, count: int) -> Array:
    """Return a metric (N · m,) of N candidates in m scenarios as (N, m).

    Raises:
        InputError: it is no metric, as in a folder that something else has written to.
    """
    if values.ndim != 1 or values.dtype.kind not in "biuf":
        raise InputError(
            f"{name} of the candidates is {values.dtype} of shape {values.shape}, expected a number each",
            argument=name,
            value=values,
        )
    return values.reshape(-1, count)


def _make_space(given: Space | Mapping[str, Any], method: str) -> Space:
    """Check the space; return it, or make one of a mapping."""
    expect("space", given, Space, Mapping)
    return given if isinstance(given, Space) else Space(given, method, None if method == "given" else 1)


def _check_reduce(given: Any) -> Reduce:
    """Check the choice of the reduction; return it."""
    expect_choice("reduce", given, get_args(Reduce))
    reduce: Reduce = given
    return reduce
