"""Saved runs that are damaged, cut off or forged are refused, and full disks are told."""

from __future__ import annotations

import json
import multiprocessing
import resource
import signal
import tempfile
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from patience import PATIENCE
from test_damage import circle, flipped, swept

import pathcontrol as pc
from pathcontrol._files import hold_lock, scratch_folder, whole_file
from pathcontrol.cli import main
from pathcontrol.errors import InputError, PathControlError, PathControlWarning
from pathcontrol.simulation.storage.netcdf import read_run, write_run


@pytest.fixture(scope="module")
def run():
    one = {"K_p": np.array([800.0]), "k": np.array([20.0])}
    return pc.simulate(**circle(one, np.arange(1)), progress=False)


def test_a_run_with_a_flipped_bit_is_never_another_run(run, tmp_path):
    file, rng = run.save(tmp_path / "run.nc"), np.random.default_rng(7)
    before = file.read_bytes()
    for _ in range(60):
        flipped(file, int(rng.integers(8 * len(before))))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises((InputError, PathControlWarning), match=r"run\.nc"):
                pc.Run.load(file)
        file.write_bytes(before)


def test_a_run_that_is_cut_off_is_told(run, tmp_path):
    file = run.save(tmp_path / "run.nc")
    before = file.read_bytes()
    for length in (0, 1, 100, len(before) // 2, len(before) - 200):
        file.write_bytes(before[:length])
        with pytest.raises(InputError, match=r"run\.nc"):
            pc.Run.load(file)


@pytest.mark.parametrize("name", ["q", "tau", "origin/recipe", "status"])
def test_a_run_that_another_program_changed_is_told(name, run, tmp_path):
    file = run.save(tmp_path / "run.nc")
    with h5py.File(file, "a") as opened:
        values = opened[name][...]
        values.flat[0] = "finished" if name == "status" else values.flat[0] + 1
        opened[name][...] = values
    with pytest.raises(InputError, match="checksum is another one"):
        pc.Run.load(file)


@pytest.mark.parametrize("name", ["q", "time", "more"])
def test_what_a_file_cannot_hold_is_refused_before_memory_is_taken(name, run, tmp_path):
    file = run.save(tmp_path / "run.nc")
    shape = {"q": (1, 10**8, 2), "time": (10**8,), "more": (10**13,)}[name]
    with h5py.File(file, "a") as opened:
        attributes = {}
        if name in opened:
            attributes = dict(opened[name].attrs)
            del opened[name]
        made = opened.create_dataset(name, shape, "f8", chunks=tuple(min(n, 10**4) for n in shape), compression="gzip")
        if "units" in attributes:
            made.attrs["units"] = attributes["units"]
    limits = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + (1 << 29), limits[1]))
    try:
        with pytest.raises(InputError, match=f"it says that {name} has the shape"):
            pc.Run.load(file)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)


def nested(depth):
    parts = [{"class": "Line", "start": {"values": [0.0, 0.0]}, "end": {"values": [1.0, 1.0]}, "speed": 1.0}]
    parts += [{"class": "PathSequence", "paths": [{"part": i}] * 2, "gaps": True} for i in range(depth)]
    return {"class": "TaskBatch", "parts": parts, "tasks": [{"part": depth}]}


def chained(depth):
    recipe = {"class": "Line", "start": {"values": [0.0, 0.0]}, "end": {"values": [1.0, 1.0]}, "speed": 1.0}
    for _ in range(depth):
        recipe = {"class": "ReversedPath", "path": recipe}
    return recipe


@pytest.fixture(scope="module")
def content(run, tmp_path_factory):
    """What the file of the run has."""
    return read_run(run.save(tmp_path_factory.mktemp("content") / "run.nc"))


@pytest.mark.parametrize(
    "task",
    [
        nested(40),
        chained(400),
        {"class": "Line", "start": {"shape": [2.5], "at": 0}, "end": {"values": [1.0, 1.0]}, "speed": 1.0},
        {"class": "Line", "start": {"shape": [10**9, 10**9, 10**9], "at": 0}, "end": {"values": [1.0]}, "speed": 1.0},
        {"class": "Line", "start": {"values": [0.0, float("nan")]}, "end": {"values": [1.0, 1.0]}, "speed": 1.0},
        {"class": "Line", "start": {"values": ["a", "b"]}, "end": {"values": [1.0, 1.0]}, "speed": 1.0},
        {"class": "Line", "start": {"values": [0.0, 0.0]}, "end": {"values": [1.0, 1.0]}, "speed": float("nan")},
        {"class": "Line", "start": {"values": [0.0, 0.0]}, "end": {"values": [1.0, 1.0]}, "speed": 10**400},
        {"class": "TaskBatch", "parts": [{"part": 0}], "tasks": [{"part": 0}]},
        {"class": "TaskBatch", "parts": [], "tasks": [{"part": -1}]},
        {"class": "TaskBatch", "parts": {}, "tasks": 3},
        {"class": ["Line"]},
        [1, 2],
    ],
    ids=lambda task: json.dumps(task)[:60],
)
def test_what_no_task_is_made_of_is_refused(task, content, tmp_path):
    file, (data, config, stored) = tmp_path / "run.nc", content
    recipes = json.loads(stored.text) | {"task": task, "first_rollout": 0}
    write_run(file, data, config, stored._replace(text=json.dumps(recipes)))
    with pytest.raises(PathControlError):
        _ = pc.Run.load(file).task


@pytest.mark.parametrize("act", ["save", "sweep", "page"])
def test_a_full_disk_is_an_error_and_no_crash(act, run, tmp_path):
    """A limit on the size of files stands for the disk; what was there before stays."""

    def limited():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        acts = {
            "save": lambda: run.save(tmp_path / "run.nc"),
            "sweep": lambda: swept(tmp_path / "sweep"),
            "page": lambda: pc.record(run).save(tmp_path / "run.html"),
        }
        try:
            acts[act]()
        except OSError as error:
            raise SystemExit(0 if error.errno else 3) from None
        raise SystemExit(4)

    (tmp_path / "run.nc").write_bytes(b"before")
    process = multiprocessing.get_context("fork").Process(target=limited)
    process.start()
    process.join(PATIENCE)
    assert process.exitcode == 0
    assert (tmp_path / "run.nc").read_bytes() == b"before"
    assert [file.name for file in tmp_path.iterdir()] == ["run.nc"]


def test_what_killed_writers_left_is_removed_and_what_a_living_one_writes_stays(tmp_path):
    file = tmp_path / "run[1].nc"
    left, other = tmp_path / ".run[1]-0123abcd.nc", tmp_path / ".run-0123abcd.nc"
    for one in (left, other):
        one.write_bytes(b"half")
    with whole_file(file) as living:
        assert not left.exists()
        with whole_file(file) as second:
            assert living.exists()
            second.write_bytes(b"second")
        living.write_bytes(b"first")
    assert file.read_bytes() == b"first"
    assert sorted(tmp_path.iterdir()) == sorted([file, other])
    with hold_lock(file) as one, hold_lock(file) as two:
        assert (one, two) == (True, False)


def test_scratch_that_a_killed_process_left_is_removed_and_that_of_a_living_one_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "film-left").mkdir()
    (tmp_path / "film-left" / "film.html").write_text("half")
    (tmp_path / "other").mkdir()
    with scratch_folder("film-") as living:
        assert sorted(path.name for path in tmp_path.iterdir()) == sorted([living.name, "other"])
        with scratch_folder("film-") as second:
            assert living.exists()
            assert second != living
    assert [path.name for path in tmp_path.iterdir()] == ["other"]


@pytest.mark.parametrize(
    ("write", "name", "said"),
    [
        (lambda run, path: run.save(path), "a.csv", "to_csv"),
        (lambda run, path: run.save(path), "a.html", r"record\(run\)\.save\(path\)"),
        (lambda run, path: run.save(path), "a.png", "save_figure"),
        (lambda run, path: run.save(path), "a", "ends with .nc"),
        (lambda run, path: pc.record(run).save(path), "a.mp4", r"save_video\(record\(run\)"),
        (lambda run, path: pc.record(run).save(path), "a.nc", r"run\.save\(path\)"),
        (lambda run, path: pc.report(run, path), "a.pdf", "ends with .html"),
        (lambda run, path: pc.save_video(pc.record(run), path), "a.html", r"record\(run\)\.save"),
        (lambda run, path: pc.save_figure(pc.error_figure(run), path), "a.html", r"record\(run\)\.save"),
        (lambda run, path: pc.save_figure(pc.error_figure(run), path), "a.jpg", "without .jpg"),
        (lambda run, path: swept(path), "a.csv", "folder of a sweep"),
    ],
)
def test_a_name_that_promises_another_format_is_refused(write, name, said, run, tmp_path):
    with pytest.raises(InputError, match=said):
        write(run, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["view", "RUN", "--out", "a.mp4"], "--mp4 FILE.mp4"),
        (["view", "RUN", "--mp4", "a.gif"], "ends with .mp4"),
        (["report", "RUN", "--out", "a.pdf"], "ends with .html"),
    ],
)
def test_the_command_line_refuses_it_too(words, said, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run.save("run.nc")
    result = CliRunner().invoke(main, ["run.nc" if word == "RUN" else word for word in words])
    assert result.exit_code == 2
    assert said in result.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["run.nc"]


def test_upper_case_is_the_same(run, tmp_path):
    assert pc.Run.load(run.save(tmp_path / "A.NC")).data.identical(run.data)
    assert [file.name for file in pc.save_figure(Figure(), tmp_path / "B.PDF", ["svg"])] == ["B.svg", "B.pdf"]
