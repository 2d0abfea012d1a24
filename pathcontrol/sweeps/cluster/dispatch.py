"""The dispatch of chunks to the workers of a Dask cluster, which may come, go and die meanwhile."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from contextlib import suppress
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import ClusterError, warn
from pathcontrol.sweeps.chunk import Chunk, Job, Piece
from pathcontrol.sweeps.cluster.connection import (
    GoneError,
    NoAnswerError,
    all_idle,
    drop_silent_workers,
    expected_versions,
    other_versions,
    within,
)

if TYPE_CHECKING:
    from distributed import Client, Future

    from pathcontrol.sweeps.cluster.shipping import ShippedJob

_AHEAD = 2  # chunks submitted for each worker: the one that it computes, and the next
_PATIENCE = 10.0  # s, for a worker to answer
_RESTART = 60.0  # s, for workers to be started again when all have died
_LOSSES = 10  # limit of losses of all workers without a chunk in between
_KILLS = 3  # limit of how often Dask may give up a chunk after its workers died
_LOOK = 5.0  # s without news, after which workers are checked that may be frozen
_SILENCE = 30.0  # s without a sign of life, after which a worker is given up
_POLL = 0.005  # s
_KEPT = "finished chunks are kept, resume the sweep"
_one_at_a_time = threading.Lock()  # neither Pinocchio's data nor what users write is for several threads


class Dispatcher:
    """The dispatcher of pieces to the workers, a few for each, which collects the chunks.

    The job goes once to each worker, and chunks come straight from the workers: neither passes the scheduler where
    this machine can reach the workers. A piece whose worker dies, or shows no sign of life, goes to another one.

    Args:
        client: the client of the cluster.
        job: the computation of a chunk.

    Raises:
        InputError: the job cannot be sent.
    """

    def __init__(self, client: Client, job: Job) -> None:
        from distributed import as_completed

        from pathcontrol.sweeps.cluster.shipping import ShippedJob

        self._client, self._shipped = client, ShippedJob.of(job, expected_versions())
        self._direct = _can_reach_workers(client)
        self._there: Future | None = None  # the shipped job, on the workers
        self._known: dict[str, None] = {}  # workers by their address, those that have been there longest first
        self._out: dict[Any, tuple[Future, Piece]] = {}  # by key
        self._kills: Counter[int] = Counter()  # by the first sample of a piece
        self._ready = as_completed(loop=client.loop)
        self._pieces: Iterator[Piece] = iter(())

    def chunks(self, pieces: Iterable[Piece]) -> Generator[Chunk]:
        """Yield the chunks of all pieces, each as soon as it is there, in any order.

        Raises:
            ClusterError: the cluster cannot go on.
            InputError: a piece is refused.
        """
        self._pieces = iter(pieces)
        try:
            yield from self._collect_all()
        finally:
            self._cancel()

    def _collect_all(self) -> Iterator[Chunk]:
        """Yield chunks while work is pending; give up when all workers were lost too often."""
        losses = 0
        while self._submit_work():
            chunk = self._collect(self._next())  # no name for the future, whose task would be kept after Ctrl-C
            if chunk is not None:
                losses = 0
                yield chunk
            elif self._there is None:
                losses += 1
            if losses > _LOSSES:
                raise ClusterError(
                    f"all workers were lost {losses} times one after another, perhaps for lack of memory; make chunks "
                    f"smaller; {_KEPT}",
                    value=losses,
                    limit=_LOSSES,
                )

    def _next(self) -> Future | None:
        """Return the next future that is done, or None if no worker can make any progress.

        That is so when the data they need were on a worker that has gone. Workers without a sign of life are given up.
        """
        looked, idle = time.monotonic(), 0
        while not self._ready.has_ready():
            time.sleep(_POLL)
            if time.monotonic() - looked > _LOOK:
                drop_silent_workers(self._client, _SILENCE)
                idle = idle + 1 if all_idle(self._client) else 0
                if idle > 1:
                    return None
                looked = time.monotonic()
        return next(self._ready)

    def _cancel(self) -> None:
        """Cancel all pending work, and release the job on the workers."""
        with suppress(Exception):  # a cluster that has gone has forgotten it too
            shipped = [] if self._there is None else [self._there]
            self._client.cancel([*(future for future, _ in self._out.values()), *shipped], force=True)

    def _submit_work(self) -> bool:
        """Submit work until each worker has two chunks; return whether any is pending."""
        try:
            while self._there is None:
                self._there = self._send()
            room = _AHEAD * max(1, len(self._client.nthreads())) - len(self._out)
            for parameters, samples in islice(self._pieces, max(0, room)):
                self._submit((parameters, samples))
        except OSError as error:
            raise ClusterError(f"the cluster is lost: {error}; {_KEPT}") from error
        return bool(self._out)

    def _submit(self, piece: Piece) -> None:
        """Submit one piece."""
        future = self._client.submit(sweep_chunk, self._there, *piece, pure=False)
        self._out[future.key] = future, piece
        self._ready.add(future)

    def _send(self) -> Future | None:
        """Send the job to all present workers, from which later ones get it; return None to try again.

        Then it goes to one worker, which has been there longest: others may come and go faster than they can take it.
        """
        try:
            self._client.wait_for_workers(1, timeout=_RESTART)
        except TimeoutError as error:
            raise ClusterError(
                f"no worker is left, and none has come for {_RESTART:g} s; {_KEPT}", limit=_RESTART
            ) from error
        there = self._client.nthreads()
        steady = next((address for address in self._known if address in there), None)
        self._known |= dict.fromkeys(there)
        where = {"broadcast": True} if steady is None else {"workers": [steady]}
        try:
            return within(
                _RESTART,
                lambda: self._client.scatter(self._shipped, direct=self._direct, hash=False, timeout=_RESTART, **where),
            )
        except (OSError, TimeoutError, KeyError):  # a worker died, or froze, or is gone from the scheduler, meanwhile
            self._check_scheduler()
            drop_silent_workers(self._client, _SILENCE)
            time.sleep(_POLL)
            return None

    def _check_scheduler(self) -> None:
        """Check that the scheduler lives, where a worker does not answer.

        Raises:
            ClusterError: it does not.
        """
        scheduler: Any = self._client.scheduler
        try:
            within(_PATIENCE, lambda: self._client.sync(scheduler.identity))
        except Exception as error:  # the error may be of any kind, since the connection is closed
            raise ClusterError(f"the cluster is lost: {error}; {_KEPT}") from error

    def _collect(self, future: Future | None) -> Chunk | None:
        """Return the chunk of a future, or None where it is lost and will be computed again."""
        from distributed import CancelledError, KilledWorker

        if future is None:
            self._requeue()
            return None
        _, piece = self._out[future.key]
        try:
            chunk = within(
                _SILENCE,
                lambda: self._client.gather(future, direct=self._direct),
                lambda: future.status != "pending",
            )
        except GoneError:  # with its worker, which is still being called; another one computes it
            self._ready.add(future)
            return None
        except CancelledError:
            self._requeue()
            return None
        except KilledWorker as error:
            self._retry(future, piece, error)
            return None
        except ModuleNotFoundError as error:
            raise ClusterError(
                f"a worker lacks the module {error.name!r}; install it there; {_KEPT}", value=error.name
            ) from error
        except (OSError, TimeoutError) as error:
            if not _is_connection_error(error):  # the user's own function has failed with it
                raise
            self._check_scheduler()
            drop_silent_workers(self._client, _SILENCE)
            self._submit_again(future, piece)
            return None
        del self._out[future.key]
        return chunk

    def _retry(self, future: Future, piece: Piece, error: Exception) -> None:
        """Submit a piece again whose workers died, perhaps of another cause.

        Raises:
            ClusterError: they did too often.
        """
        samples = piece[1]
        self._kills[int(samples[0])] += 1
        if self._kills[int(samples[0])] >= _KILLS:
            raise ClusterError(
                f"samples {samples[0]} to {samples[-1]}: every worker that computed them died, perhaps for lack of "
                f"memory; make chunks smaller; {_KEPT}",
                value=(samples[0], samples[-1]),
            ) from error
        self._submit_again(future, piece)

    def _submit_again(self, future: Future, piece: Piece) -> None:
        """Cancel a future and queue its piece again."""
        del self._out[future.key]
        with suppress(Exception):  # a cluster that has gone has forgotten it too
            self._client.cancel([future], force=True)
        self._pieces = chain([piece], self._pieces)

    def _requeue(self) -> None:
        """Queue all pending pieces again, as the job died with the last worker that had it."""
        self._pieces = chain([piece for _, piece in self._out.values()], self._pieces)
        self._cancel()
        self._ready.clear()
        self._out.clear()
        self._there = None


def _is_connection_error(error: Exception) -> bool:
    """Return whether an error comes from the connection to a worker, not from the user's function."""
    from distributed.comm.core import CommClosedError

    return isinstance(error, CommClosedError | NoAnswerError)


def sweep_chunk(shipped: ShippedJob, parameters: dict[str, Array], samples: NDArray[np.int64]) -> Chunk:
    """Compute a chunk; this function runs on a worker.

    Raises:
        ClusterError: the worker has joined since, and has other versions.
    """
    from distributed import get_worker

    worker: Any = get_worker()
    if other := other_versions(shipped.versions):
        raise ClusterError(f"{worker.address} has joined with other versions: {other}; {_KEPT} without it", value=other)
    with _one_at_a_time:
        return shipped.compute((parameters, samples), worker.local_directory)


def _can_reach_workers(client: Client) -> bool:
    """Return whether this machine can talk to each worker; warn if not."""

    async def ask() -> None:
        scheduler: Any = client.scheduler
        addresses = await scheduler.ncores()
        await asyncio.wait_for(asyncio.gather(*(client.rpc(a).identity() for a in addresses)), _PATIENCE)

    try:
        client.sync(ask)
    except (OSError, TimeoutError) as error:
        warn(
            f"this machine cannot reach all workers ({error!r}), so that all results go through the scheduler; start "
            "the sweep on a machine in their network if that is too slow"
        )
        return False
    return True
