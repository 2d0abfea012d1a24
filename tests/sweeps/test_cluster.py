"""Sweeps on a cluster: what comes out is what comes out here, whoever dies on the way, and wherever the files are."""

from __future__ import annotations

import contextlib
import gc
import json
import os
import pickle
import platform
import shutil
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from patience import PATIENCE, wait_until
from scipy import stats

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import ClusterError, InputError, MissingExtraError, PathControlError
from pathcontrol.experiments.load import read_toml
from pathcontrol.experiments.samples.swept_experiment import SweptExperiment
from pathcontrol.experiments.sweep_runner import run_sweep
from pathcontrol.sweeps.chunk import Job
from pathcontrol.sweeps.cluster import connection as cluster_module
from pathcontrol.sweeps.cluster import dispatch

dask = pytest.importorskip("workers").dask
distributed = pytest.importorskip("distributed")
cloudpickle = pytest.importorskip("cloudpickle")
pytest.importorskip("pyarrow")
ShippedJob = pytest.importorskip("pathcontrol.sweeps.cluster.shipping").ShippedJob

ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
LOOP = pc.SampledLoop(encoders=True, velocity="difference")
# gains of 3e5 and more diverge with this period
SPACE = pc.Space.sobol(
    {"K_p": stats.loguniform(100.0, 3e6), "k": stats.uniform(1.0, 50.0), "q": stats.norm([0.7, 1.2], [0.3, 0.3])}, 16
)
PEAKS = ["e_p_peak", "tau_demand_peak"]
QUIET = {"dashboard_address": "127.0.0.1:0", "silence_logs": 50}
KEEP = pc.Keep(worst=1, by="e_p_peak", random=1, diverged=1)


def circle(p, samples):
    law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, p["K_p"][:, None], K_v=[45.0, 100.0], k=p["k"])
    return {"controller": law, "q": p["q"], "duration": 0.2, "loop": LOOP}


def swept(out, **changes):
    usual = {"build": circle, "space": SPACE, "metrics": PEAKS, "chunk": 2, "keep": KEEP, "progress": False}
    return pc.sweep(**usual | changes, out=out)


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def numbers(files):
    """Those files of a sweep that do not say which function built it."""
    return {name: value for name, value in files.items() if name != "manifest.json"}


@pytest.fixture(scope="module")
def workers():
    """Two processes with one thread each, started anew when they are killed."""
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


# --- the same ----------------------------------------------------------------------------------------------------


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


# --- killed ------------------------------------------------------------------------------------------------------


def when_chunks_are_there(folder, count, action):
    def watch():
        while len(list(folder.glob("chunks/0*"))) < count:
            time.sleep(0.01)
        action()

    threading.Thread(target=watch, daemon=True).start()


@pytest.mark.parametrize("victims", [1, 2], ids=["one", "all"])
def test_killed_workers_lose_nothing(victims, workers, here, tmp_path):
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


# --- what goes where ---------------------------------------------------------------------------------------------


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

TASK = """
import os
from pathlib import Path
import numpy as np
from pathcontrol import Circle

assert os.getpid() == {pid} or "{home}" not in __file__, "read where the user has it"
radius, rate = np.loadtxt(Path(__file__).parent / "tables/numbers.csv", delimiter=",")

class Mine(Circle):
    def __init__(self, table):
        more = float((Path(__file__).parent / table).read_text())
        super().__init__(radius + more, rate)
"""
FILE = """
duration = 0.1
[robot]
source = "../robots/arm.urdf"
[task]
type = "mine.py:Mine"
parameters = { table = "more.txt" }
[controller]
type = "projection"
K_v = [45.0, 100.0]
k_p = 800.0
[sweep]
keep = { worst = 1, by = "e_p_peak" }
[sweep.parameters]
"controller.k_p" = { grid = [500.0, 700.0, 900.0] }
"task.parameters.table" = { grid = ["more.txt", "even_more.txt"] }
"""


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


def swept_experiment(file):
    data = read_toml(file)
    return SweptExperiment(data, file.parent, data.pop("sweep")["parameters"])


# --- refusals ----------------------------------------------------------------------------------------------------


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as unused:
        return unused.getsockname()[1]


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
        "{told}\n"
        "faults = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "np.ones(100_000)\n"
        "before = faults()\n"
        "for _ in range(100):\n    np.ones(100_000)\n"
        "print(faults() - before)"
    )
    pages = []
    for told in ("keep_freed_memory()", ""):
        environment = os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}  # as Dask starts its workers
        command = [sys.executable, "-c", code.format(told=told)]
        pages.append(int(subprocess.run(command, env=environment, capture_output=True, check=True).stdout))
    assert pages[0] < 1000 < pages[1]
