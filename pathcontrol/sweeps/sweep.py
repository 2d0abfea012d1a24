"""The function :func:`sweep`, from a space of parameters to a table of numbers on disk."""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pathcontrol._arrays import Array, check_whole
from pathcontrol._expect import expect
from pathcontrol._files import as_path, hold_lock, writing
from pathcontrol._progress import progress_bar
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.arguments import Form
from pathcontrol.errors import InputError
from pathcontrol.simulation.engines import Engine, settle_engine
from pathcontrol.sweeps.chunk import Build, Chunk, Job, Measure, Piece, make_measure
from pathcontrol.sweeps.cluster.connection import connect
from pathcontrol.sweeps.cluster.dispatch import Dispatcher
from pathcontrol.sweeps.histories import Keep
from pathcontrol.sweeps.manifest import MANIFEST
from pathcontrol.sweeps.parquet import load_parquet
from pathcontrol.sweeps.result import SweepResult
from pathcontrol.sweeps.space import Space, check_seed, digest
from pathcontrol.sweeps.step_warnings import WarningFilter
from pathcontrol.sweeps.store import Store

if TYPE_CHECKING:
    from distributed import Client, Security


def sweep(
    build: Build,
    space: Space,
    out: str | Path,
    *,
    metrics: Annotated[Sequence[str] | Measure | None, Form.TEXTS] = None,
    chunk: int = 500,
    keep: Keep | None = None,
    seed: int = 0,
    resume: bool = False,
    progress: bool = True,
    cluster: str | Path | Client | None = None,
    security: Security | None = None,
    engine: Engine = "auto",
) -> SweepResult:
    """Simulate every sample of a space, a chunk at a time, and keep its numbers on disk.

    A rollout that diverges is a row with the status ``"diverged"`` and NaN for its metrics. The numbers of a sample
    are those of a simulation of it alone, to the last bit in a sampled loop, and so the same in chunks of any size; in
    continuous time they agree within the integrator's tolerance. Memory is bounded by a chunk: a rollout of 10 s at
    400 samples a second takes 0.5 MB with two joints and 1.6 MB with seven, twice while it is measured.

    A process may be killed at any moment: what is on disk is a number of whole chunks, and ``resume`` goes on from
    there. A function's definition is its name and its source; what it takes from elsewhere is for you to keep the same.

    Args:
        build: from the parameters of k samples, (k,) or (k, d) each, and the numbers of these samples (k,), to the
            arguments of :func:`simulate` for k rollouts, as a dict: controller, q, duration, plant, loop and so on. Or
            a list of pairs, of rows of the chunk and the arguments for these, where they do not fit in one batch. With
            a method ``describe``, what that gives is its definition.
        space: the parameters and how they are sampled.
        out: the folder of the sweep, made if need be.
        metrics: names of some of those of :func:`pathcontrol.metrics`, or a function from a :class:`Run` to numbers
            by name, one for each rollout; default all the usual ones.
        chunk: number of samples that are simulated together, and lost if the process is killed.
        keep: the rollouts whose whole history is kept; default none.
        seed: seed of the random numbers of the design and of the choice of histories.
        resume: go on with the sweep in ``out``, if there is one.
        progress: show a bar with the time left on standard error when it takes longer than two seconds.
        cluster: a Dask cluster whose workers compute the chunks: the address of its scheduler, as
            ``"tcp://host:8786"``, its scheduler file, or a ``distributed.Client``; default this process. The table and
            the histories are the same.
        security: certificates for TLS, a ``distributed.Security``, where the cluster asks for some.
        engine: the engine of the simulations, as for :func:`simulate`, where ``build`` names none.

    Raises:
        ClusterError: the cluster does not answer or cannot go on, or a worker has other versions than this process.
        InputError: an argument has the wrong value, ``out`` holds a sweep and ``resume`` is not asked for, or it holds
            one of another definition.
        MissingExtraError: the extra ``sweep`` or, for a cluster, ``cluster`` is not installed.
    """
    expect("space", space, Space)
    chunk = check_whole("chunk", chunk)
    engine = settle_engine(engine)
    keep, measure, seed = Keep() if keep is None else keep, make_measure(metrics), check_seed(seed)
    if not isinstance(keep, Keep):
        raise InputError(
            f"keep = {keep!r}, expected a Keep, such as Keep(worst=5), or None", argument="keep", value=keep
        )
    with connect(cluster, security) as client:
        design = space.design(seed)
        job = Job(build, measure, keep, keep.at_random(space.samples, seed), engine)
        computed = partial(_compute_here, job) if client is None else Dispatcher(client, job).chunks
        definition = _definition(build, space, design, metrics, keep, seed)
        definition |= {"engine": engine}
        with open_store(out, space.samples, definition, resume) as store:
            store.tidy(keep, job.at_random)
            missing, done, tell = store.missing(chunk), 0, WarningFilter()
            pieces = (({name: values[samples] for name, values in design.items()}, samples) for samples in missing)
            with closing(computed(pieces)) as chunks, progress_bar("sweep", sum(map(len, missing)), progress) as update:
                for finished in chunks:
                    store.write(finished, keep, job.at_random)
                    tell(finished.warnings)
                    done += len(finished.columns["sample"])
                    update(done)
    return SweepResult(out)


def _compute_here(job: Job, pieces: Iterable[Piece]) -> Generator[Chunk]:
    """Yield the chunks of all pieces, computed in this process."""
    for parameters, samples in pieces:
        yield job(parameters, samples)


@contextmanager
def open_store(out: str | Path, samples: int, definition: Mapping[str, Any], resume: bool) -> Iterator[Store]:
    """Give the store of a new sweep, or with ``resume`` of one that was begun; remove it if it stays empty.

    Raises:
        InputError: something else is there, or another process writes there.
    """
    load_parquet()
    folder = as_path("out", out)
    if folder.exists() and not folder.is_dir():
        raise InputError(
            f"{str(folder)!r} is a file, expected a folder for the sweep; name another",
            argument="out",
            value=str(folder),
            file=str(folder),
        )
    refuse_suffix(folder, "the folder of a sweep", name="out")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with hold_lock(folder) as ours:
        if not ours:
            raise InputError(
                f"another process is writing to {str(folder)!r}; wait for it, or name another folder", file=str(folder)
            )
        begun = (folder / MANIFEST).exists()
        store = (
            Store.resume(folder, samples, definition) if resume and begun else Store.begin(folder, samples, definition)
        )
        try:
            yield store
        finally:
            store.settle()


def _definition(
    build: Build, space: Space, design: Mapping[str, Array], metrics: Any, keep: Keep, seed: int
) -> dict[str, Any]:
    """Return all that the numbers depend on, as JSON has it."""
    whole = {
        "build": fingerprint(build),
        "space": space.describe(),
        "design_sha256": digest(list(design.values())),
        "seed": seed,
        "metrics": fingerprint(metrics) if callable(metrics) else metrics if metrics is None else list(metrics),
        "keep": keep.describe(),
    }
    return json.loads(json.dumps(whole))


def fingerprint(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the fingerprint of a callable, compared when a sweep is resumed.

    It is what the callable describes itself by, or its name and a digest of its source where that is known.
    """
    if hasattr(function, "describe"):
        return function.describe()
    name = getattr(function, "__qualname__", type(function).__qualname__)
    try:
        source = inspect.getsource(function if hasattr(function, "__qualname__") else type(function))
    except (OSError, TypeError):
        return {"function": name}
    return {"function": name, "source_sha256": hashlib.sha256(source.encode()).hexdigest()}
