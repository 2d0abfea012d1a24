"""Workers that freeze or die over and over end no sweep, and nobody else can reach what docs/cluster.md starts."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from cluster_sweeps import QUIET, free_port, when_chunks_are_there
from patience import PATIENCE, wait_until
from scipy import stats

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import InputError
from pathcontrol.sweeps.cluster import dispatch

distributed = pytest.importorskip("workers").distributed
pytest.importorskip("pyarrow")

ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
SPACE = pc.Space.random({"K_p": stats.loguniform(100.0, 1e4)}, 24)
TWO = QUIET | {"n_workers": 2, "threads_per_worker": 1}
PAGE = Path(__file__).parents[3] / "docs" / "cluster.md"


def slowly(p, samples):
    time.sleep(0.1)
    law = pc.ComputedTorque(ROBOT, CIRCLE, p["K_p"][:, None], K_v=45.0)
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.02}


def swept(folder, **options):
    return pc.sweep(slowly, SPACE, folder, metrics=["e_p_peak"], chunk=2, progress=False, **options)


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    return swept(tmp_path_factory.mktemp("here") / "out").table()


def pids(cluster):
    return [nanny.process.process.pid for nanny in cluster.workers.values()]


def test_others_take_over_from_a_frozen_worker(here, tmp_path, monkeypatch):
    monkeypatch.setattr(dispatch, "_SILENCE", 3.0)
    monkeypatch.setattr(dispatch, "_LOOK", 0.5)
    monkeypatch.setattr(dispatch, "_RESTART", 10.0)  # what computes chunks may go to the frozen one
    with distributed.LocalCluster(**TWO) as cluster:
        frozen = pids(cluster)[0]
        when_chunks_are_there(tmp_path / "out", 2, lambda: os.kill(frozen, signal.SIGSTOP))
        try:
            result = swept(tmp_path / "out", cluster=cluster.scheduler_address)
        finally:
            os.kill(frozen, signal.SIGKILL)
    assert result.table().identical(here)


@pytest.mark.parametrize("mortal", [1, 2], ids=["one of two", "both"])
def test_workers_that_die_every_second_do_not_end_a_sweep(mortal, here, tmp_path, monkeypatch):
    monkeypatch.setattr(dispatch, "_LOOK", 1.0)  # two such times pass whenever all that was known of the job has died,
    monkeypatch.setattr(dispatch, "_SILENCE", 5.0)  # or this one, where a chunk was on its way
    over, deaths = threading.Event(), []
    with distributed.LocalCluster(**TWO) as cluster:

        def kill():
            while not over.wait(1.0 if deaths else 0.1):  # the first before a fast machine is done
                for nanny in list(cluster.workers.values())[:mortal]:
                    with contextlib.suppress(AttributeError, ProcessLookupError):  # it is being started
                        os.kill(nanny.process.process.pid, signal.SIGKILL)
                        deaths.append(time.monotonic())
                if mortal == 2 and len(deaths) > 5:
                    return  # none would ever finish a chunk on a slow machine

        threading.Thread(target=kill, daemon=True).start()
        try:
            result = swept(tmp_path / "out", cluster=cluster.scheduler_address)
        finally:
            over.set()
    assert deaths
    assert result.table().identical(here)


# --- who can reach it --------------------------------------------------------------------------------------------


def commands():
    """What the page says to start on one machine."""
    block = next(text for text in re.findall(r"```sh\n(.*?)```", PAGE.read_text(), re.S) if "dask scheduler" in text)
    return [line for line in block.splitlines() if line.startswith("dask ")]


def listening(pids):
    """The addresses on which processes listen for others, by /proc."""
    sockets = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                if found := re.fullmatch(r"socket:\[(\d+)\]", os.readlink(link)):
                    sockets.add(found[1])
    found = set()
    for table, kind in (("tcp", socket.AF_INET), ("tcp6", socket.AF_INET6)):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in sockets:
                words = bytes.fromhex(fields[1].partition(":")[0])
                host = b"".join(words[i : i + 4][::-1] for i in range(0, len(words), 4))
                found.add(socket.inet_ntop(kind, host))
    return found


def family(pid):
    """A process and those that it has started."""
    found = [pid]
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += family(int(child))
    return found


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="looks into /proc")
def test_what_the_page_starts_listens_on_this_machine_only(here, tmp_path):
    port, started = str(free_port()), []
    try:
        for line in commands():
            _, *words = shlex.split(line.replace("8786", port).replace("--nworkers=-1", "--nworkers=1"))
            if words[0] == "scheduler":
                words += ["--port", port]
            started.append(
                subprocess.Popen(
                    [sys.executable, "-m", "dask", *words],
                    cwd=tmp_path,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
            )
            wait_until(lambda: listening(family(started[-1].pid)), pause=0.1)
        with distributed.Client(f"tcp://127.0.0.1:{port}", set_as_default=False, timeout=PATIENCE) as client:
            client.wait_for_workers(1, timeout=PATIENCE)
        assert len(started) == 2
        for process in started:
            assert listening(family(process.pid)) in ({"127.0.0.1"}, {"127.0.0.1", "::1"}, {"::1"})
    finally:
        for process in started[::-1]:
            process.terminate()
            process.wait(PATIENCE)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tls")
    line = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=localhost"
    line += " -keyout key.pem -out cert.pem"
    try:
        subprocess.run(shlex.split(line), cwd=folder, check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("openssl is not there")
    return folder / "cert.pem", folder / "key.pem"


def test_a_sweep_over_tls(certificate, here, tmp_path):
    cert, key = map(str, certificate)
    files = {"tls_ca_file": cert, "tls_client_cert": cert, "tls_client_key": key}
    files |= {
        f"tls_{role}_{kind}": file for role in ("scheduler", "worker") for kind, file in (("cert", cert), ("key", key))
    }
    security = distributed.Security(require_encryption=True, **files)
    quiet = TWO | {"n_workers": 1}
    with distributed.LocalCluster(**quiet, protocol="tls://", security=security, host="127.0.0.1") as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        result = swept(tmp_path / "out", cluster=address, security=security)
        assert result.table().identical(here)
        with pytest.raises(pc.ClusterError, match="no Dask scheduler answers"):
            swept(tmp_path / "none", cluster=address)
        (tmp_path / "sweep.toml").write_text(FILE)
        options = ["--cluster", address, "--tls-ca", cert, "--tls-cert", cert, "--tls-key", key]
        done = CliRunner().invoke(
            main, ["sweep", str(tmp_path / "sweep.toml"), "--out", str(tmp_path / "cli"), *options]
        )
        assert done.exit_code == 0, done.output
        assert "contour_error_peak" in done.output
        assert " rad" in done.output


def test_half_of_the_certificates_are_refused(certificate, tmp_path):
    (tmp_path / "sweep.toml").write_text(FILE)
    command = ["sweep", str(tmp_path / "sweep.toml"), "--out", str(tmp_path / "out"), "--tls-ca", str(certificate[0])]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 2
    assert "tls-cert = None, expected a file" in done.stderr
    with pytest.raises(InputError, match="security is given without a cluster"):
        swept(tmp_path / "out", security=distributed.Security())


FILE = """
duration = 0.02
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 2.0
[controller]
type = "computed_torque"
K_p = 800.0
K_v = 45.0
[sweep]
metrics = ["contour_error_peak"]
[sweep.parameters]
"controller.K_p" = { grid = [500.0, 700.0] }
"""
