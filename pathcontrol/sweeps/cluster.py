"""The Dask cluster of a sweep: its client, and whether its workers are fit."""

from __future__ import annotations

import asyncio
import json
import socket
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pathcontrol.errors import ClusterError, MissingExtraError
from pathcontrol.sweeps.manifest import PACKAGES, versions

if TYPE_CHECKING:
    from distributed import Client

_PATIENCE = 5.0  # s, for what answers at once if it is there


@contextmanager
def connected(cluster: Any) -> Iterator[Client | None]:
    """The client of a cluster whose workers have been seen to be fit; ``None`` for no cluster.

    Args:
        cluster: the address of a scheduler, its scheduler file, a ``distributed.Client`` or what makes one.

    Raises:
        ClusterError: nobody answers, there is no worker, or one has other versions than this process.
        MissingExtraError: the extra ``cluster`` is not installed.
    """
    if cluster is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingExtraError("distributed", "cluster", "a sweep on a cluster") from error
    if isinstance(cluster, Client):
        _check_workers(cluster)
        yield cluster
        return
    with _client(_address(cluster)) as client:
        _check_workers(client)
        yield client


def _address(cluster: Any) -> Any:
    """The address in a scheduler file, or else what was given."""
    if not isinstance(cluster, str | Path) or not str(cluster).endswith(".json"):
        return cluster
    try:
        return json.loads(Path(cluster).read_text(encoding="utf-8"))["address"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ClusterError(
            f"the scheduler file {str(cluster)!r} cannot be read: {error}; `dask scheduler --scheduler-file` writes one"
        ) from error


def _client(address: Any) -> Client:
    from distributed import Client

    try:
        if isinstance(address, str):  # a client that cannot connect takes long, or waits forever for what says nothing
            _check_scheduler(address)
        return Client(address, timeout=_PATIENCE, set_as_default=False)
    except Exception as error:  # what answers may be anything
        raise ClusterError(
            f"cluster = {address!r}: no Dask scheduler answers ({str(error) or 'it says nothing'}); start one with "
            "`dask scheduler`, and give its address, as tcp://host:8786, or its scheduler file"
        ) from error


def _check_scheduler(address: str) -> None:
    """Whoever is at the address says that it is a scheduler.

    Raises:
        Exception: of any kind, for instance as nobody is there.
    """
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.core import rpc
    from distributed.security import Security

    async def asked() -> str:
        async with rpc(address, timeout=_PATIENCE, connection_args=Security().get_connection_args("client")) as there:
            return (await asyncio.wait_for(there.identity(), _PATIENCE))["type"]

    socket.create_connection(parse_host_port(parse_address(address)[1]), timeout=_PATIENCE).close()  # refused at once
    with ThreadPoolExecutor(1) as thread:  # as this one may be in a loop of its own, such as that of a notebook
        kind = thread.submit(lambda: asyncio.run(asked())).result()
    if kind != "Scheduler":
        raise OSError(f"it is a {kind}")


def _check_workers(client: Client) -> None:
    """There are workers, and they have the versions of this process, as do those that unpickle what goes to them."""
    scheduler: Any = client.scheduler
    address = scheduler.address
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        raise ClusterError(
            f"{address} has no workers; start some: `dask worker {address} --nworkers=-1 --nthreads 1`"
        ) from error
    expected, ask = expected_versions(), _asker()
    found = {"the scheduler": client.run_on_scheduler(ask), **client.run(ask)}
    unfit = [f"{name} has {other}" for name, there in found.items() if (other := _differences(expected, there))]
    if unfit:
        raise ClusterError(
            f"numbers depend on versions, and {len(unfit)} of {len(found)} processes of the cluster have others than "
            f"this one: {'; '.join(unfit[:5])}; install the same ones everywhere"
        )
    crowded = [name for name, threads in client.nthreads().items() if threads > 1]
    if crowded:
        warnings.warn(
            f"{len(crowded)} workers have several threads, as {crowded[0]}, of which one computes at a time; start "
            "them as processes: --nworkers=-1 --nthreads 1",
            stacklevel=5,
        )


def expected_versions() -> dict[str, str]:
    """What every process of the cluster has to have: the packages of this one, and its Python up to the bugfix."""
    return versions() | {"python": _asker()()["python"]}


def other_versions(expected: Mapping[str, str]) -> str:
    """What this process has otherwise, or nothing."""
    return _differences(expected, _asker()())


def _asker() -> Callable[[], dict[str, str]]:
    """A function that tells what is installed; as it is local, it is pickled whole, and needs no package there."""
    packages = PACKAGES

    def installed() -> dict[str, str]:
        import sys
        from importlib.metadata import PackageNotFoundError, version

        found = {"python": f"{sys.version_info.major}.{sys.version_info.minor}"}
        for name in packages:
            try:
                found[name] = version(name)
            except PackageNotFoundError:
                found[name] = ""
        return found

    return installed


def _differences(expected: Mapping[str, str], there: Mapping[str, str]) -> str:
    other = [name for name, wanted in expected.items() if there[name] != wanted]
    return ", ".join(f"{name} {there[name] or 'missing'} (here {expected[name]})" for name in other)
