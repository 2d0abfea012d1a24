"""The connection to the Dask cluster of a sweep: its client, and checks of its workers."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pathcontrol._extras import load_extra
from pathcontrol.errors import ClusterError, InputError, warn
from pathcontrol.sweeps.manifest import PACKAGES, versions

if TYPE_CHECKING:
    from distributed import Client, Security

_PATIENCE = 5.0  # s, for an answer that is immediate if there is any
_ANSWER = 30.0  # s, for the answer of a worker that may be busy
_LOOK = 0.2  # s
_EXTRA = "cluster", "a sweep on a cluster"


class NoAnswerError(TimeoutError):
    """An answer has not come in time."""


class GoneError(Exception):
    """The requested result is not there any more."""


@contextmanager
def connect(cluster: Any, security: Security | None = None) -> Iterator[Client | None]:
    """Give the client of a cluster after its workers were checked; ``None`` for no cluster.

    Args:
        cluster: the address of a scheduler, its scheduler file, a ``distributed.Client`` or what makes one.
        security: certificates for TLS; a client has its own.

    Raises:
        ClusterError: nobody answers, there is no worker, or one has other versions than this process.
        MissingExtraError: the extra ``cluster`` is not installed.
    """
    if cluster is None:
        if security is not None:
            raise InputError(
                "security is given without a cluster; give cluster=, as 'tls://host:8786'",
                argument="security",
                value=security,
            )
        yield None
        return
    if isinstance(cluster, load_extra("distributed", *_EXTRA).Client):
        _check_workers(cluster)
        yield cluster
        return
    with _open_client(_address(cluster), security) as client:
        _check_workers(client)
        yield client


def _address(cluster: Any) -> Any:
    """Return the address in a scheduler file, or else the given one."""
    if not isinstance(cluster, str | Path) or not str(cluster).endswith(".json"):
        return cluster
    try:
        return json.loads(Path(cluster).read_text(encoding="utf-8"))["address"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ClusterError(
            f"the scheduler file {str(cluster)!r} cannot be read: {error}; "
            "`dask scheduler --scheduler-file` writes one",
            argument="cluster",
            value=str(cluster),
            file=str(cluster),
        ) from error


def load_security(ca: str | Path | None, cert: str | Path | None, key: str | Path | None) -> Security | None:
    """Return the certificates for TLS from PEM files: the authority, one's own, and its key; ``None`` for none.

    Raises:
        InputError: one of the three is left out, or is no file.
        MissingExtraError: the extra ``cluster`` is not installed.
    """
    given = {"tls-ca": ca, "tls-cert": cert, "tls-key": key}
    if not any(given.values()):
        return None
    for name, file in given.items():
        if file is None or not Path(file).is_file():
            raise InputError(
                f"{name} = {None if file is None else str(file)!r}, expected a file; TLS needs {', '.join(given)}",
                argument=name,
                value=None if file is None else str(file),
            )
    files = {"tls_ca_file": str(ca), "tls_client_cert": str(cert), "tls_client_key": str(key)}
    return load_extra("distributed.security", *_EXTRA).Security(require_encryption=True, **files)


def _open_client(address: Any, security: Security | None) -> Client:
    """Connect to a scheduler."""
    from distributed import Client

    try:
        if isinstance(address, str):  # a client that cannot connect takes long, or waits forever for what says nothing
            _check_scheduler(address, security)
        return Client(address, timeout=_PATIENCE, set_as_default=False, security=security)
    except Exception as error:  # any kind of process may answer
        raise ClusterError(
            f"cluster = {address!r}: no Dask scheduler answers ({str(error) or 'it says nothing'}); start one with "
            "`dask scheduler`, and give its address, as tcp://host:8786, or its scheduler file",
            argument="cluster",
            value=address,
        ) from error


def _check_scheduler(address: str, security: Security | None) -> None:
    """Check that the process at the address says that it is a scheduler.

    Raises:
        Exception: of any kind, for instance since there is no process.
    """
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.core import rpc
    from distributed.security import Security

    known = Security() if security is None else security

    async def ask_kind() -> str:
        async with rpc(address, timeout=_PATIENCE, connection_args=known.get_connection_args("client")) as there:
            return (await asyncio.wait_for(there.identity(), _PATIENCE))["type"]

    socket.create_connection(parse_host_port(parse_address(address)[1]), timeout=_PATIENCE).close()  # refused at once
    with ThreadPoolExecutor(1) as thread:  # the present thread may have a loop, as in a notebook
        kind = thread.submit(lambda: asyncio.run(ask_kind())).result()
    if kind != "Scheduler":
        raise OSError(f"it is a {kind}")


def _check_workers(client: Client) -> None:
    """Check that there are workers with the versions of this process; the scheduler must have them too."""
    scheduler: Any = client.scheduler
    address = scheduler.address
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        raise ClusterError(
            f"{address} has no workers; start some: `dask worker {address} --nworkers=-1 --nthreads 1`",
            value=address,
        ) from error
    expected, ask = expected_versions(), _make_question()
    found = {"the scheduler": client.run_on_scheduler(ask), **_ask_workers(client, ask)}
    unfit = [f"{name} has {other}" for name, there in found.items() if (other := _differences(expected, there))]
    if unfit:
        raise ClusterError(
            f"numbers depend on versions, and {len(unfit)} of {len(found)} processes of the cluster have others than "
            f"this one: {'; '.join(unfit[:5])}; install the same ones everywhere",
            value=unfit,
        )
    crowded = [name for name, threads in client.nthreads().items() if threads > 1]
    if crowded:
        warn(
            f"{len(crowded)} workers have several threads, as {crowded[0]}, of which one computes at a time; start "
            "them as processes: --nworkers=-1 --nthreads 1"
        )


def _ask_workers(client: Client, ask: Callable[[], dict[str, str]]) -> dict[str, Any]:
    """Return the answers of the workers; frozen ones that do not answer are given up.

    Raises:
        ClusterError: none answers.
    """
    try:
        return within(_ANSWER, lambda: client.run(ask))
    except NoAnswerError:
        gone = drop_silent_workers(client, _ANSWER / 2)
    except OSError:  # one has died meanwhile
        gone = []
    warn(f"{', '.join(gone) or 'a worker'} did not answer, and the sweep goes on without it")
    try:
        return within(_ANSWER, lambda: client.run(ask, on_error="ignore"))
    except (NoAnswerError, OSError) as error:
        raise ClusterError(
            f"no worker answers within {_ANSWER:g} s; stop those that hang, and start others", limit=_ANSWER
        ) from error


def within(seconds: float, ask: Callable[[], Any], there: Callable[[], bool] = lambda: True) -> Any:
    """Return the result of ``ask``, run in a thread that is abandoned when time is up or ``there`` becomes False.

    Raises:
        NoAnswerError: it takes longer.
        GoneError: it is no longer there.
    """
    answer: Future[Any] = Future()

    def work() -> None:
        try:
            answer.set_result(ask())
        except BaseException as error:
            own = error.__traceback__  # this frame's, which would keep the answer alive
            answer.set_exception(error.with_traceback(None if own is None else own.tb_next))

    threading.Thread(target=work, daemon=True).start()
    until = time.monotonic() + seconds
    while not wait([answer], _LOOK).done:
        if not there():
            raise GoneError
        if time.monotonic() > until:
            raise NoAnswerError(f"no answer within {seconds:g} s")
    return answer.result()


def drop_silent_workers(client: Client, silence: float) -> list[str]:
    """Have the scheduler give up workers without a sign of life for ``silence`` [s]; others take over.

    Returns:
        Their addresses.
    """

    async def drop(dask_scheduler: Any = None) -> list[str]:
        from time import time

        silent = [a for a, worker in dask_scheduler.workers.items() if time() - worker.last_seen > silence]
        for address in silent:
            await dask_scheduler.remove_worker(address, stimulus_id="frozen")
        return silent

    try:
        return within(_PATIENCE, lambda: client.run_on_scheduler(drop))
    except Exception:  # the scheduler has gone, which shows elsewhere
        return []


def all_idle(client: Client) -> bool:
    """Return whether there are workers, and none of them computes anything."""

    def idle(dask_scheduler: Any = None) -> bool:
        workers = list(dask_scheduler.workers.values())
        return bool(workers) and not any(worker.executing for worker in workers)

    try:
        return within(_PATIENCE, lambda: client.run_on_scheduler(idle))
    except Exception:  # the scheduler has gone, which shows elsewhere
        return False


_ENGINE = "the compiled engine"


def expected_versions() -> dict[str, str]:
    """Return what every process of the cluster must have: this one's packages, Python version and engine."""
    here = _make_question()()
    return versions() | {name: here[name] for name in ("python", _ENGINE) if here[name]}


def other_versions(expected: Mapping[str, str]) -> str:
    """Return the versions of this process that differ, in words, or an empty text."""
    return _differences(expected, _make_question()())


def _make_question() -> Callable[[], dict[str, str]]:
    """Return a function that lists what is installed.

    It is local, so that it is pickled whole, and needs no package there.
    """
    packages, engine = PACKAGES, _ENGINE

    def installed() -> dict[str, str]:
        import sys
        from importlib.metadata import PackageNotFoundError, version

        found = {"python": f"{sys.version_info.major}.{sys.version_info.minor}"}
        for name in packages:
            try:
                found[name] = version(name)
            except PackageNotFoundError:
                found[name] = ""
        try:
            from pathcontrol.engine.library import load_library

            load_library()
            found[engine] = "installed"
        except Exception:  # neither the package nor its library need be there
            found[engine] = ""
        return found

    return installed


def _differences(expected: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Return the versions that differ, in words."""
    other = [name for name, wanted in expected.items() if there[name] != wanted]
    return ", ".join(f"{name} {there[name] or 'missing'} (here {expected[name]})" for name in other)
