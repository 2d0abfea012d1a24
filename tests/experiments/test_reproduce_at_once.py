"""The paper's experiments come out as published; both at once, in a process each, write the same files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import PIL.Image  # noqa: F401
import pytest
from click.testing import CliRunner
from patience import PATIENCE, wait_until

from pathcontrol.cli import main
from pathcontrol.experiments import reproduce as module

TWO_CORES = pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="there is one core only")
PROGRAM = """
import sys
from pathcontrol.cli import main
from pathcontrol.experiments import reproduce
{}
main(["reproduce", "--out", *sys.argv[1:]])
"""
SHORT, NO_WRITERS = "reproduce.DURATION = 0.2", "reproduce.load_writers = lambda: None"
#: what draws takes longer to load than all that comes before it
SHORTLY, UNDRAWN, SHORTLY_UNDRAWN = (
    [sys.executable, "-c", PROGRAM.format(change)] for change in (SHORT, NO_WRITERS, f"{SHORT}; {NO_WRITERS}")
)


@pytest.fixture(scope="module")
def thread():
    """A thread beside the main one, which a fork would lose."""
    over = threading.Event()
    waiting = threading.Thread(target=over.wait)
    waiting.start()
    yield waiting
    over.set()
    waiting.join()


@pytest.fixture(scope="module")
def results(tmp_path_factory, thread):
    """The folder that both experiments write, one after the other in this process, and what is returned of them."""
    out = tmp_path_factory.mktemp("reproduce")
    return out, module.reproduce(out)


def test_reproduce_writes_everything(results):
    out, summary = results
    figures = {f"figure_{number}.{suffix}" for number in ("07", "08", "09", "10") for suffix in ("svg", "png")}
    pages = {f"{name}{suffix}" for name in ("extended_motion_plan", "projection") for suffix in (".html", ".nc")}
    assert {p.name for p in out.iterdir()} == figures | pages | {"summary.json"}
    assert json.loads((out / "summary.json").read_text()) == summary
    assert set(summary["versions"]) >= {"pathcontrol", "pin", "numpy", "python"}
    assert summary["settings"]["projection"]["controller"]["k_p"] == 800.0
    assert summary["seconds"] > 0


@pytest.mark.parametrize("name", ["extended_motion_plan", "projection"])
def test_the_papers_peaks_come_out_within_ten_percent(results, name):
    measured = results[1][name]
    for key, paper in measured["paper"].items():
        assert measured[key] == pytest.approx(paper, rel=0.10)
        assert measured[key] != paper  # a measurement, not a copy


def test_reproduce_prints_a_table(monkeypatch, capsys, results):
    from rich.console import Console

    from pathcontrol.cli.tables import peaks_table

    console = Console(width=120, record=True)
    console.print(peaks_table(results[1]))
    text = console.export_text()
    assert "extended motion plan" in text
    assert "14.5" in text


@TWO_CORES
def test_files_are_the_same_to_the_last_bit_from_one_process_and_from_two(thread, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "DURATION", 0.2)
    module.reproduce(tmp_path / "one")
    command = [*SHORTLY, tmp_path / "two", "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == json.loads((tmp_path / "two" / "summary.json").read_text())
    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "two").iterdir())
    for name in files:
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        if name == "summary.json":
            one, two = (json.loads(text) | {"seconds": 0.0} for text in (one, two))
        assert one == two, name


@TWO_CORES
def test_errors_of_another_process_are_told_in_one_sentence(tmp_path):
    for name in ("extended_motion_plan", "projection"):  # the first file that each of the two processes writes
        (tmp_path / "out" / f"{name}.nc").mkdir(parents=True)
    done = subprocess.run([*SHORTLY_UNDRAWN, tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "extended_motion_plan.nc" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out" / "summary.json").exists()


def test_errors_of_this_process_are_told_in_one_sentence(tmp_path, thread, monkeypatch):
    monkeypatch.setattr(module, "DURATION", 0.2)
    (tmp_path / "out" / "figure_07.png").mkdir(parents=True)
    done = CliRunner().invoke(main, ["reproduce", "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert "figure_07.png" in done.stderr
    assert not (tmp_path / "out" / "summary.json").exists()


def test_a_program_with_threads_is_not_forked(thread):
    with module._open_map() as apply:
        assert apply is map


def started(out, words):
    """The command in a group of its own, and the processes that it has started, once they have their signals set."""
    command = subprocess.Popen(
        [*words, str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    wait_until(lambda: len(children(command.pid)) == 2 and all(map(leaves_at_once, children(command.pid))))
    return command, children(command.pid)


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def leaves_at_once(pid):
    """Whether a process catches the signal that ends it, which other processes here do not."""
    caught = next(line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("SigCgt"))
    return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)


@TWO_CORES
@pytest.mark.parametrize("writes", [False, True])
def test_ctrl_c_is_told_in_one_line_and_leaves_nothing(tmp_path, writes):
    """One process gets it while both simulate; all do, as from a terminal, when the first file begins to appear."""
    command, processes = started(tmp_path, SHORTLY if writes else UNDRAWN)
    if writes:
        wait_until(lambda: any(tmp_path.iterdir()))
        processes = children(command.pid)
    (os.killpg if writes else os.kill)(command.pid, signal.SIGINT)
    _, told = command.communicate(timeout=PATIENCE)
    assert (command.returncode, told) == (130, "interrupted; no half-written file is left behind\n")
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
    assert not (tmp_path / "summary.json").exists()
    assert not any(Path(f"/proc/{pid}").exists() for pid in processes)


@TWO_CORES
def test_a_process_that_is_killed_is_told_in_one_sentence(tmp_path):
    command, processes = started(tmp_path, UNDRAWN)
    os.kill(processes[0], signal.SIGKILL)
    _, told = command.communicate(timeout=PATIENCE)
    assert command.returncode == 2
    assert told.startswith("error: a process that ran an experiment has ended before it was done")
    assert told.count("\n") == 1


def test_ctrl_c_while_a_pool_starts_comes_when_it_has_started():
    """Before its thread runs it could not be shut down."""
    done = []

    class Pool:
        def map(self, function, *items):
            os.kill(os.getpid(), signal.SIGINT)
            done.append(function)

    with pytest.raises(KeyboardInterrupt):
        module._start_whole(Pool(), max, [1])
    assert done == [max]


def test_ctrl_c_while_what_draws_is_loaded_comes_when_it_is_there(monkeypatch):
    """A module that is half loaded tells of it on its own."""
    loaded = []

    def load(name):
        os.kill(os.getpid(), signal.SIGINT)
        loaded.append(name)

    monkeypatch.setattr(module, "import_module", load)
    with pytest.raises(KeyboardInterrupt):
        module.load_writers()
    assert loaded == [*module._WRITERS]
