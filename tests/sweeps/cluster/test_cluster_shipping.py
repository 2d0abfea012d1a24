"""What a sweep needs reaches the workers: arrays, modules, and the files of an experiment, wherever they are."""

from __future__ import annotations

import contextlib
import gc
import pickle
import shutil
import socket
import textwrap
import threading
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from cluster_sweeps import circle, content, swept, swept_experiment
from patience import wait_until

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import PathControlError
from pathcontrol.experiments.sweep_runner import run_sweep
from pathcontrol.sweeps.chunk import Job
from pathcontrol.sweeps.cluster import dispatch

distributed = pytest.importorskip("workers").distributed
cloudpickle = pytest.importorskip("cloudpickle")
pytest.importorskip("pyarrow")
ShippedJob = pytest.importorskip("pathcontrol.sweeps.cluster.shipping").ShippedJob


class Counting:
    """A port that hands everything on to the scheduler and back, and counts the bytes."""

    def __init__(self, address):
        self._to = distributed.comm.get_address_host_port(address)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address, self.bytes = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}", 0
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                one, other = self._listener.accept()[0], socket.create_connection(self._to)
                for ends in ((one, other), (other, one)):
                    threading.Thread(target=self._hand_on, args=ends, daemon=True).start()

    def _hand_on(self, source, sink):
        with contextlib.suppress(OSError):
            while some := source.recv(1 << 16):
                self.bytes += len(some)
                sink.sendall(some)
            sink.shutdown(socket.SHUT_WR)


def test_large_arrays_do_not_go_through_the_scheduler(address, tmp_path, monkeypatch):
    large = np.random.default_rng(0).normal(size=500_000)

    def with_it(p, samples):
        return circle(p, samples) | {"duration": 2.0 + 0.0 * large[0]}

    passed = {}
    for direct in (True, False):
        if not direct:  # as on a machine that cannot reach the workers
            monkeypatch.setattr(dispatch, "_can_reach_workers", lambda client: False)
        counting = Counting(address)
        swept(tmp_path / str(direct), build=with_it, keep=pc.Keep(random=5), cluster=counting.address)
        passed[direct] = counting.bytes
    histories = sum(run.data.nbytes for run in map(pc.Run.load, (tmp_path / "True").glob("runs/*")))
    assert histories > 300_000
    assert passed[False] > large.nbytes + histories
    assert passed[True] < 150_000


def test_workers_out_of_reach_are_told(address, tmp_path, here, monkeypatch):
    monkeypatch.setattr(dispatch, "_PATIENCE", 0.0)
    with pytest.warns(UserWarning, match="cannot reach all workers .* all results go through the scheduler"):
        swept(tmp_path, cluster=address)
    assert content(tmp_path) == here


def test_modules_that_workers_lack_reach_them(address, tmp_path, monkeypatch):
    (tmp_path / "lawful.py").write_text(
        textwrap.dedent("""
        import pathcontrol as pc

        class Mine(pc.Circle):
            def theta(self, s):
                return 0.5 * super().theta(s)

        def law(robot, p):
            return pc.ExtendedMotionPlan(robot, Mine(1.0, 2.0), p["K_p"][:, None], K_v=[45.0, 100.0], k=2.0)
        """)
    )
    (tmp_path / "builder.py").write_text(
        textwrap.dedent("""
        import lawful
        import pathcontrol as pc

        ROBOT = pc.load_robot("cicese_2dof")

        def build(p, samples):
            return {"controller": lawful.law(ROBOT, p), "q": p["q"], "duration": 0.1}

        def tallest(run):
            return {"tallest": abs(run.array("q")).max((1, 2))}
        """)
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    import builder

    choice = {"build": builder.build, "metrics": builder.tallest, "keep": pc.Keep(worst=2, by="tallest")}
    swept(tmp_path / "here", **choice)
    swept(tmp_path / "there", **choice, cluster=address)
    assert content(tmp_path / "here") == content(tmp_path / "there")
    assert cloudpickle.list_registry_pickle_by_value() == set()


# --- files -------------------------------------------------------------------------------------------------------


def test_the_files_of_an_experiment_reach_the_workers(experiment, address, tmp_path):
    run_sweep(experiment, tmp_path / "here", chunk=1, progress=False)
    with distributed.Client(address, set_as_default=False) as client:
        command = ["sweep", str(experiment), "--out", str(tmp_path / "there"), "--chunk", "1", "--cluster", address]
        done = CliRunner().invoke(main, command)
        assert done.exit_code == 0, done.output
        assert content(tmp_path / "there") == content(tmp_path / "here")
        wait_until(lambda: not any(left(client)), pause=0.05)


def left(client):
    """The folders with files of users, of each worker."""
    found = client.run(lambda dask_worker: [str(f) for f in Path(dask_worker.local_directory).glob("pathcontrol-*")])
    return found.values()


def test_a_parcel_needs_nothing_of_where_it_comes_from(experiment, tmp_path):
    """And it tells errors, and keeps histories, as if it were there."""
    build = swept_experiment(experiment)
    job = Job(build, pc.metrics, pc.Keep(random=2), np.arange(2))
    parameters = {"controller.k_p": np.array([500.0, 700.0]), "task.parameters.table": np.array(["more.txt"] * 2)}
    piece = (parameters, np.arange(2))
    here = job(*piece)
    parcel = pickle.loads(pickle.dumps(ShippedJob.of(job, {})))
    shutil.move(tmp_path / "home", tmp_path / "away")
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    there = parcel.compute(piece, str(scratch))
    for name, values in here.columns.items():
        np.testing.assert_array_equal(there.columns[name], values)
    for sample, run in here.runs.items():
        assert there.runs[sample].robot.source == run.robot.source
        assert there.runs[sample].data.identical(run.data)
    parameters["task.parameters.table"][:] = "none.txt"
    with pytest.raises(PathControlError) as error:
        parcel.compute(piece, str(scratch))
    assert str(tmp_path / "home") in str(error.value)
    assert str(scratch) not in str(error.value)
    del parcel, error
    gc.collect()
    assert not list(scratch.iterdir())


def test_whole_paths_are_found_too(experiment, tmp_path):
    text = experiment.read_text().replace("../robots/arm.urdf", str(tmp_path / "home/robots/arm.urdf"))
    text = text.replace('"even_more.txt"', f'"{experiment.parent}/even_more.txt"')
    experiment.write_text(text.replace('"mine.py', f'"{experiment.parent}/mine.py'))
    build = swept_experiment(experiment)
    pack = build.pack()
    assert pack.home == tmp_path / "home"
    assert {"experiments/mine.py", "experiments/tables/numbers.csv", "robots/arm.urdf"} < set(pack.files)
    assert set(build.describe()["files_sha256"]) >= {f"{experiment.parent}/mine.py:Mine", "more.txt"}
    copy = tmp_path / "copy"
    for place, inside in pack.files.items():
        (copy / place).parent.mkdir(parents=True, exist_ok=True)
        (copy / place).write_bytes(inside)
    shutil.move(tmp_path / "home", tmp_path / "away")
    unpacked = pack.unpack(copy)
    varied = {"controller.k_p": [500.0], "task.parameters.table": [f"{experiment.parent}/even_more.txt"]}
    [(_, arguments)] = unpacked({name: np.array(values) for name, values in varied.items()}, np.array([0]))
    assert arguments["controller"].task.radius == 1.2
    assert arguments["controller"].robot.source.base_dir == copy / "robots"
