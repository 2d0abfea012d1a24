"""A cluster that is not there, is another program or another version, and work that cannot be sent or fails."""

from __future__ import annotations

import os
import pickle
import platform
import socket
import subprocess
import sys
import threading
import time

import pytest
from click.testing import CliRunner
from cluster_sweeps import QUIET, circle, free_port, swept
from patience import PATIENCE

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import ClusterError, InputError, MissingExtraError
from pathcontrol.sweeps.cluster import connection as cluster_module
from pathcontrol.sweeps.cluster import dispatch

dask = pytest.importorskip("workers").dask
distributed = pytest.importorskip("workers").distributed
cloudpickle = pytest.importorskip("cloudpickle")
pytest.importorskip("pyarrow")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("tcp://127.0.0.1:{port}", "no Dask scheduler answers .*refused.*start one with `dask scheduler`"),
        ("nonsense", "no Dask scheduler answers .missing port number"),
        ("http://127.0.0.1:{port}", "no Dask scheduler answers .*"),
        ("nowhere.json", "the scheduler file 'nowhere.json' cannot be read: .*No such file"),
    ],
)
def test_where_nobody_answers_nothing_is_begun(wrong, message, tmp_path):
    began = time.monotonic()
    with pytest.raises(ClusterError, match=message):
        swept(tmp_path / "out", cluster=wrong.format(port=free_port()))
    assert time.monotonic() - began < PATIENCE / 10  # at once, not after all patience
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("says", [b"", b"SSH-2.0-OpenSSH_9.6\r\n"], ids=["nothing", "something else"])
def test_what_is_no_scheduler_is_told(says, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster_module, "_PATIENCE", 0.5)
    there = []

    def listen(listener):
        while True:
            there.append(listener.accept()[0])
            there[-1].sendall(says)

    listener = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=listen, args=[listener], daemon=True).start()
    began = time.monotonic()
    by_itself = dask.config.set({"distributed.comm.timeouts.connect": f"{PATIENCE} s"})
    with by_itself, pytest.raises(ClusterError, match=r"no Dask scheduler answers .*start one with `dask scheduler`"):
        swept(tmp_path / "out", cluster=f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    assert time.monotonic() - began < PATIENCE / 10  # the client by itself waits for all of it
    assert not (tmp_path / "out").exists()


def test_a_worker_is_no_scheduler(address, workers, tmp_path):
    with pytest.raises(ClusterError, match=r"no Dask scheduler answers \(it is a Worker\)"):
        swept(tmp_path / "out", cluster=next(iter(workers.scheduler.workers)))


def test_the_command_tells_what_is_wrong_with_the_cluster(experiment):
    address = f"127.0.0.1:{free_port()}"
    done = CliRunner().invoke(main, ["sweep", str(experiment), "--cluster", address])
    assert done.exit_code == 2
    assert done.output.startswith(f"error: --cluster {address}: no Dask scheduler answers (")


def test_a_scheduler_without_workers_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster_module, "_PATIENCE", 0.3)
    with (
        distributed.LocalCluster(**QUIET, processes=False, n_workers=0) as empty,
        pytest.raises(ClusterError, match=r"has no workers; start some: `dask worker .* --nworkers=-1 --nthreads 1`"),
    ):
        swept(tmp_path / "out", cluster=empty)
    assert not (tmp_path / "out").exists()


def test_the_extra_is_named_where_it_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'pathcontrol\[cluster\]'"):
        swept(tmp_path / "out", cluster="tcp://127.0.0.1:8786")
    assert not (tmp_path / "out").exists()


def test_other_versions_are_refused_before_work_begins(address, tmp_path, monkeypatch):
    ours = cluster_module.versions()
    monkeypatch.setattr(cluster_module, "versions", lambda: ours | {"numpy": "0.1", "pin": "0.2"})
    with pytest.raises(ClusterError) as error:
        swept(tmp_path / "out", cluster=address)
    assert "tcp://127.0.0.1:" in str(error.value)
    assert f"pin {ours['pin']} (here 0.2), numpy {ours['numpy']} (here 0.1)" in str(error.value)
    assert "3 of 3 processes of the cluster" in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_worker_that_joins_later_with_other_versions_is_refused(address, tmp_path, monkeypatch):
    monkeypatch.setattr(dispatch, "expected_versions", lambda: cluster_module.expected_versions() | {"scipy": "0.3"})
    with pytest.raises(ClusterError, match=r"tcp://.* has joined with other versions: scipy .* \(here 0.3\); finished"):
        swept(tmp_path / "out", cluster=address)


def test_a_machine_without_this_package_can_be_asked():
    question = cloudpickle.dumps(cluster_module._make_question())
    code = (
        "import sys, importlib.metadata as m; sys.modules['pathcontrol'] = None; true = m.version\n"
        "def version(name):\n  if name == 'pathcontrol': raise m.PackageNotFoundError(name)\n  return true(name)\n"
        "m.version = version\n"
        "import pickle; print(pickle.loads(sys.stdin.buffer.read())())"
    )
    done = subprocess.run([sys.executable, "-c", code], input=question, capture_output=True, check=True)
    there = eval(done.stdout)
    assert cluster_module._differences(cluster_module.expected_versions(), there) == (
        f"pathcontrol missing (here {cluster_module.versions()['pathcontrol']}), "
        "the compiled engine missing (here installed)"
    )


def test_a_piece_that_is_refused_says_the_same_as_here(address, tmp_path):
    def wrong(p, samples):
        if samples[0] == 6:
            return circle({name: values[:1] for name, values in p.items()}, samples)
        return circle(p, samples)

    told = []
    for name, cluster in (("here", None), ("there", address)):
        with pytest.raises(InputError) as error:
            swept(tmp_path / name, build=wrong, cluster=cluster)
        told.append(str(error.value))
        assert pc.SweepResult(tmp_path / name).finished >= 2
    assert told[0] == told[1] == "samples 6 to 7: build gives 1 rollouts for 2 samples; make q (k, n), one row each"


def test_what_cannot_be_sent_is_told_before_anything_is_begun(address, tmp_path):
    lock = threading.Lock()

    def locked(p, samples):
        with lock:
            return circle(p, samples)

    with pytest.raises(InputError, match=r"build cannot be sent to workers \(.*lock.*\); make what it needs inside"):
        swept(tmp_path / "out", build=locked, cluster=address)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "error",
    [
        MissingExtraError("yourdfpy", "robots", "a robot by name"),
        pc.SimulationError("it diverged"),
        pc.UnknownNameError("no robot 'a'"),
        ClusterError("it is lost"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_come_back_from_workers_as_they_are(error):
    there = pickle.loads(pickle.dumps(error))
    assert type(there) is type(error)
    assert str(there) == str(error)


def test_a_module_that_workers_lack_is_named(address, tmp_path):
    def lacking(p, samples):
        import not_installed_there

        return not_installed_there.build(p, samples)

    with pytest.raises(ClusterError, match="a worker lacks the module 'not_installed_there'; install it there"):
        swept(tmp_path, build=lacking, cluster=address)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc can be told")
def test_workers_keep_freed_memory_for_the_next_arrays():
    code = (
        "import resource, numpy as np\n"
        "from pathcontrol.sweeps.cluster.shipping import keep_freed_memory\n"
        "faults = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "for tell in (lambda: None, keep_freed_memory):\n"
        "  tell()\n"
        "  np.ones(100_000)\n"
        "  before = faults()\n"
        "  for _ in range(100): np.ones(100_000)\n"
        "  print(faults() - before)"
    )
    environment = os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}  # as Dask starts its workers
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True)
    untold, told = map(int, done.stdout.split())
    assert told < 1000 < untold
