"""Chunks computed by the workers of a Dask cluster, which may come, go and die meanwhile."""

from __future__ import annotations

import asyncio
import threading
import warnings
from collections.abc import Generator, Iterable, Iterator
from contextlib import suppress
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import ClusterError
from pathcontrol.sweeps.cluster import expected_versions, other_versions
from pathcontrol.sweeps.compute import Chunk, Job, Piece

if TYPE_CHECKING:
    from distributed import Client, Future

    from pathcontrol.sweeps.parcel import Parcel

_AHEAD = 2  # chunks for each worker: the one that it computes, and the next
_PATIENCE = 10.0  # s, for a worker to answer
_RESTART = 60.0  # s, for workers to be started again when all have died
_LOSSES = 3  # how often they may all die without a chunk in between
_KEPT = "finished chunks are kept, resume the sweep"
_one_at_a_time = threading.Lock()  # neither Pinocchio's data nor what users write is for several threads


class Desk:
    """Gives out pieces, a few for each worker, and takes chunks in.

    What computes them goes once to each worker, and chunks come straight from the workers: neither passes the scheduler
    where this machine can reach the workers. A piece whose worker dies is given to another one.

    Args:
        client: of the cluster.
        job: what computes a chunk.

    Raises:
        InputError: the job cannot be sent.
    """

    def __init__(self, client: Client, job: Job) -> None:
        from distributed import as_completed

        from pathcontrol.sweeps.parcel import Parcel

        self._client, self._parcel = client, Parcel.of(job, expected_versions())
        self._direct = _reachable(client)
        self._there: Future | None = None  # the parcel, on the workers
        self._out: dict[Any, tuple[Future, Piece]] = {}  # by key
        self._ready = as_completed(loop=client.loop)
        self._pieces: Iterator[Piece] = iter(())

    def chunks(self, pieces: Iterable[Piece]) -> Generator[Chunk]:
        """The chunks of all pieces, each as soon as it is there, in any order.

        Raises:
            ClusterError: the cluster cannot go on.
            InputError: a piece is refused.
        """
        self._pieces = iter(pieces)
        try:
            yield from self._finished()
        finally:
            self._cancel()

    def _finished(self) -> Iterator[Chunk]:
        losses = 0
        while self._give_out():
            chunk = self._taken(next(self._ready))
            losses = losses + 1 if chunk is None else 0
            if chunk is not None:
                yield chunk
            elif losses > _LOSSES:
                raise ClusterError(
                    f"all workers were lost {losses} times one after another, perhaps for lack of memory; make chunks "
                    f"smaller; {_KEPT}"
                )

    def _cancel(self) -> None:
        """Nobody waits for what is out."""
        with suppress(Exception):  # a cluster that has gone has forgotten it too
            self._client.cancel([future for future, _ in self._out.values()], force=True)

    def _give_out(self) -> bool:
        """Whether anything is out."""
        try:
            if self._there is None:
                self._there = self._sent()
            room = _AHEAD * max(1, len(self._client.nthreads())) - len(self._out)
            for parameters, samples in islice(self._pieces, max(0, room)):
                future = self._client.submit(sweep_chunk, self._there, parameters, samples, pure=False)
                self._out[future.key] = future, (parameters, samples)
                self._ready.add(future)
        except OSError as error:
            raise ClusterError(f"the cluster is lost: {error}; {_KEPT}") from error
        return bool(self._out)

    def _sent(self) -> Future:
        """The parcel, once it is on all workers that there are; others will get it from these."""
        try:
            self._client.wait_for_workers(1, timeout=_RESTART)
        except TimeoutError as error:
            raise ClusterError(f"no worker is left, and none has come for {_RESTART:g} s; {_KEPT}") from error
        return self._client.scatter(self._parcel, broadcast=True, direct=self._direct, hash=False, timeout=_RESTART)

    def _taken(self, future: Future) -> Chunk | None:
        """The chunk of a future, or None where it is lost, and with it all that is out."""
        from distributed import CancelledError, KilledWorker

        try:
            chunk = self._client.gather(future, direct=self._direct)
        except CancelledError:
            self._take_back()
            return None
        except KilledWorker as error:
            _, (_, samples) = self._out[future.key]
            raise ClusterError(
                f"samples {samples[0]} to {samples[-1]}: every worker that computed them died, perhaps for lack of "
                f"memory; make chunks smaller; {_KEPT}"
            ) from error
        except ModuleNotFoundError as error:
            raise ClusterError(f"a worker lacks the module {error.name!r}; install it there; {_KEPT}") from error
        del self._out[future.key]
        return chunk

    def _take_back(self) -> None:
        """The parcel died with the last worker that had it, and all that was to be done with it."""
        self._pieces = chain([piece for _, piece in self._out.values()], self._pieces)
        self._cancel()
        self._ready.clear()
        self._out.clear()
        self._there = None


def sweep_chunk(parcel: Parcel, parameters: dict[str, Array], samples: NDArray[np.int64]) -> Chunk:
    """What a worker does.

    Raises:
        ClusterError: the worker has joined since, and has other versions.
    """
    from distributed import get_worker

    worker: Any = get_worker()
    if other := other_versions(parcel.versions):
        raise ClusterError(f"{worker.address} has joined with other versions: {other}; {_KEPT} without it")
    with _one_at_a_time:
        return parcel.compute((parameters, samples), worker.local_directory)


def _reachable(client: Client) -> bool:
    """Whether this machine can talk to each worker, or else a warning."""

    async def ask() -> None:
        scheduler: Any = client.scheduler
        addresses = await scheduler.ncores()
        await asyncio.wait_for(asyncio.gather(*(client.rpc(a).identity() for a in addresses)), _PATIENCE)

    try:
        client.sync(ask)
    except (OSError, TimeoutError) as error:
        warnings.warn(
            f"this machine cannot reach all workers ({error!r}), so that all results go through the scheduler; start "
            "the sweep on a machine in their network if that is too slow",
            stacklevel=5,
        )
        return False
    return True
