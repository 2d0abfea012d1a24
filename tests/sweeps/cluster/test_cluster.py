"""Sweeps on a cluster: what comes out is what comes out here, whoever dies on the way."""

from __future__ import annotations

import json
import os
import signal
import threading
import time

import pytest
from cluster_sweeps import QUIET, circle, content, numbers, swept, when_chunks_are_there
from patience import wait_until
from scipy import stats

import pathcontrol as pc
from pathcontrol.errors import ClusterError
from pathcontrol.sweeps.cluster import dispatch

distributed = pytest.importorskip("workers").distributed
pytest.importorskip("cloudpickle")
pytest.importorskip("pyarrow")


def test_all_files_are_those_of_a_sweep_in_one_process(address, here, tmp_path):
    swept(tmp_path, cluster=address)
    assert content(tmp_path) == here
    assert sum(name.startswith("runs") for name in here) == 3


@pytest.mark.parametrize("first", ["here", "there"])
def test_what_was_begun_here_goes_on_there_and_the_other_way_round(first, address, here, tmp_path):
    swept(tmp_path, cluster=address if first == "there" else None)
    for file in sorted(tmp_path.glob("chunks/*"))[1::2]:
        file.unlink()
    swept(tmp_path, resume=True, cluster=address if first == "here" else None)
    assert content(tmp_path) == here


def test_a_client_is_a_cluster_and_stays_open(address, here, tmp_path):
    with distributed.Client(address, set_as_default=False) as client:
        swept(tmp_path, cluster=client)
        assert content(tmp_path) == here
        assert client.status == "running"


def test_a_scheduler_file_is_a_cluster(workers, here, tmp_path):
    (tmp_path / "scheduler.json").write_text(json.dumps({"type": "Scheduler", "address": workers.scheduler_address}))
    swept(tmp_path / "out", cluster=tmp_path / "scheduler.json")
    assert content(tmp_path / "out") == here


def test_threads_of_one_process_take_turns(here, tmp_path):
    entered = str(tmp_path / "entered")

    def alone(p, samples):
        os.close(os.open(entered, os.O_CREAT | os.O_EXCL))  # fails where another thread is inside
        time.sleep(0.01)
        os.unlink(entered)
        return circle(p, samples)

    threads = distributed.LocalCluster(**QUIET, processes=False, n_workers=1, threads_per_worker=3)
    with threads, pytest.warns(UserWarning, match="--nthreads 1"):
        result = swept(tmp_path / "out", build=alone, cluster=threads)
    assert numbers(content(result.folder)) == numbers(here)


@pytest.mark.parametrize("victims", [1, 2], ids=["one", "all"])
def test_killed_workers_lose_nothing(victims, workers, here, tmp_path, monkeypatch):
    monkeypatch.setattr(dispatch, "_LOOK", 1.0)  # two such times pass where all that was known of the job has died,
    monkeypatch.setattr(dispatch, "_SILENCE", 5.0)  # or this one, where a chunk was on its way
    killed = []

    def kill():
        for nanny in list(workers.workers.values())[:victims]:
            killed.append(nanny.process.process.pid)
            os.kill(killed[-1], signal.SIGKILL)

    def slowly(p, samples):
        time.sleep(0.1)
        return circle(p, samples)

    when_chunks_are_there(tmp_path, 2, kill)
    result = swept(tmp_path, build=slowly, cluster=workers.scheduler_address)
    assert len(killed) == victims
    assert numbers(content(result.folder)) == numbers(here)


def test_a_chunk_that_kills_its_worker_is_told_and_what_is_there_stays(tmp_path, monkeypatch):
    """There is one worker more than the chunk kills, so that nobody waits for one to be started again."""
    monkeypatch.setattr(dispatch, "_KILLS", 2)

    def deadly(p, samples):
        if samples[0] == 6:
            time.sleep(0.5)
            os.kill(os.getpid(), signal.SIGKILL)
        return circle(p, samples)

    with distributed.LocalCluster(**QUIET, n_workers=dispatch._KILLS + 1, threads_per_worker=1) as many:
        many.scheduler.allowed_failures = 0  # else Dask itself would have four of them die each time
        with pytest.raises(ClusterError, match=r"samples \d+ to \d+: every worker .* died, .*; finished"):
            swept(tmp_path, build=deadly, cluster=many.scheduler_address)
    assert pc.SweepResult(tmp_path).finished >= 2


def test_ctrl_c_cancels_what_is_out_and_keeps_what_is_in(workers, tmp_path):
    folder = tmp_path / "out"

    def endless(p, samples):
        time.sleep(0.05)
        return circle(p, samples)

    main = threading.get_ident()
    when_chunks_are_there(folder, 2, lambda: signal.pthread_kill(main, signal.SIGINT))
    many = pc.Space.random({"K_p": stats.loguniform(100.0, 1e4), "k": [2.0], "q": [[0.7, 1.2]]}, 1000)
    with distributed.Client(workers, set_as_default=False) as client:
        with pytest.raises(KeyboardInterrupt):
            swept(folder, space=many, build=endless, cluster=client)
        wait_until(lambda: not workers.scheduler.tasks)
    # two files are there: the first of them is noted, the other may not be yet, and then does not count
    assert 2 <= pc.SweepResult(folder).finished < 100
    assert not list(folder.rglob("*/.*"))
