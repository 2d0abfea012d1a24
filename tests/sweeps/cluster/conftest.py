"""Shared by the tests of clusters: two workers, the sweep in one process, and an experiment with files beside it."""

from __future__ import annotations

import os
import shutil

import pytest
from cluster_sweeps import FILE, QUIET, TASK, content, swept
from patience import PATIENCE, wait_until

import pathcontrol as pc
from pathcontrol.sweeps.cluster import connection as cluster_module


@pytest.fixture(scope="module")
def workers():
    """Two processes with one thread each, started anew when they are killed."""
    distributed = pytest.importorskip("workers").distributed
    with distributed.LocalCluster(**QUIET, n_workers=2, threads_per_worker=1) as started:
        yield started


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """What is there may take its time on a busy machine."""
    monkeypatch.setattr(cluster_module, "_PATIENCE", PATIENCE)


@pytest.fixture
def address(workers):
    wait_until(lambda: len(workers.scheduler.workers) >= 2)  # one that was killed before is on its way
    return workers.scheduler_address


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """What the sweep gives in one process."""
    folder = tmp_path_factory.mktemp("here")
    swept(folder)
    assert {"diverged", "running"} == set(pc.SweepResult(folder).table()["status"].to_numpy())
    return content(folder)


@pytest.fixture
def experiment(tmp_path):
    folder = tmp_path / "home" / "experiments"
    for inner in (folder / "tables", folder.parent / "robots"):
        inner.mkdir(parents=True)
    shutil.copy(pc.load_robot("cicese_2dof").source.base_dir / "cicese_2dof.urdf", folder.parent / "robots/arm.urdf")
    too_long_for_a_file = f"{'text' * 100!r}\n"
    (folder / "mine.py").write_text(too_long_for_a_file + TASK.format(pid=os.getpid(), home=tmp_path))
    (folder / "tables" / "numbers.csv").write_text("1.0,2.0\n")
    (folder / "more.txt").write_text("0.1")
    (folder / "even_more.txt").write_text("0.2")
    (folder / "sweep.toml").write_text(FILE)
    return folder / "sweep.toml"
