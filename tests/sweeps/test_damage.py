"""What is damaged, missing or held by another process is named, and nothing is read as if it were whole."""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import shutil
import signal
import tempfile
import time
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from patience import PATIENCE
from scipy import stats

import pathcontrol as pc
from pathcontrol._files import hold_lock, scratch_folder, whole_file
from pathcontrol.cli import main
from pathcontrol.errors import InputError, PathControlError, PathControlWarning
from pathcontrol.experiments.sweep_runner import run_sweep
from pathcontrol.simulation.storage.netcdf import read_run, write_run
from pathcontrol.sweeps.manifest import Manifest

pytest.importorskip("pyarrow")

ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
SPACE = pc.Space.random({"K_p": stats.loguniform(100.0, 1e4), "k": stats.uniform(1.0, 50.0)}, 6)
KEEP = pc.Keep(worst=2, by="e_p_peak")


def circle(p, samples):
    law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, p["K_p"][:, None], K_v=[45.0, 100.0], k=p["k"])
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.02}


def swept(folder, **options):
    usual = {"metrics": ["e_p_peak"], "keep": KEEP, "chunk": 2, "progress": False}
    return pc.sweep(circle, SPACE, folder, **usual | options)


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def flipped(file, place):
    content = bytearray(file.read_bytes())
    content[place // 8 % len(content)] ^= 1 << place % 8
    file.write_bytes(bytes(content))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return swept(tmp_path_factory.mktemp("whole") / "sweep").folder


@pytest.fixture
def copy(whole, tmp_path):
    return Path(shutil.copytree(whole, tmp_path / "sweep"))


@pytest.fixture(scope="module")
def run():
    one = {"K_p": np.array([800.0]), "k": np.array([20.0])}
    return pc.simulate(**circle(one, np.arange(1)), progress=False)


# --- sweeps ------------------------------------------------------------------------------------------------------


def test_every_file_has_its_digest_in_the_manifest(whole):
    import hashlib

    files = json.loads((whole / "manifest.json").read_text())["files"]
    there = {name: hashlib.sha256(text).hexdigest() for name, text in content(whole).items() if name != "manifest.json"}
    assert files == there
    assert len(files) == 5


def test_a_flipped_bit_is_found_wherever_it_is_and_mended(whole, copy):
    rng, before = np.random.default_rng(5), content(whole)
    for _ in range(8):
        file = rng.choice(sorted(copy.glob("chunks/*")))
        flipped(file, int(rng.integers(8 * file.stat().st_size)))
        with pytest.raises(InputError, match=rf"is damaged: chunks/{file.name} \(damaged\); resume"):
            pc.SweepResult(copy)
        with pytest.warns(PathControlWarning, match=file.name):
            swept(copy, resume=True)
        assert content(copy) == before


def test_what_is_missing_is_named_and_mended(whole, copy):
    gone = sorted(copy.glob("chunks/*"))[1]
    gone.unlink()
    with pytest.raises(InputError, match=rf"{gone.name} \(missing\)"):
        pc.SweepResult(copy)
    result = CliRunner().invoke(main, ["report", str(copy), "--out", str(copy / "r.html")])
    assert result.exit_code == 2
    assert gone.name in result.stderr
    with pytest.warns(PathControlWarning, match=gone.name):
        swept(copy, resume=True)
    assert content(copy) == content(whole)


@pytest.mark.parametrize("damage", ["cut", "flipped", "missing"])
def test_a_damaged_history_leaves_the_others(damage, whole, copy):
    result = pc.SweepResult(copy)
    lost, other = result.kept
    file = result.history(lost)
    if damage == "cut":
        file.write_bytes(file.read_bytes()[:5000])
    elif damage == "flipped":
        flipped(file, 30_000)
    else:
        file.unlink()
    with pytest.raises(InputError, match=file.name):
        result.run(lost)
    with pytest.warns(PathControlWarning, match=f"left out: .*{file.name}"):
        assert [run.config["sweep"]["sample"] for run in result.histories().values()] == [other]
    with pytest.warns(PathControlWarning, match=rf"runs/{file.name}"):
        swept(copy, resume=True)
    assert content(copy) == content(whole)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: "[]",
        lambda text: "null",
        lambda text: '"' + "x" * 100,
        lambda text: "[" * 100_000,
        lambda text: text.replace('"samples": 6', '"samples": "6"', 1),
        lambda text: text.replace('"samples": 6', '"samples": true', 1),
        lambda text: text.replace('"samples": 6', '"samples": 7', 1),
        lambda text: text.replace('"samples": 6', '"samples": 1' + "0" * 20, 1),
        lambda text: text.replace('"samples": 6', '"samples": 1' + "0" * 5000, 1),
        lambda text: text.replace('"definition": {', '"definition": [], "other": {', 1),
        lambda text: text.replace('"parameters": {', '"parameters": 3, "other": {', 1),
        lambda text: text.replace('"versions": [', '"versions": [], "other": [', 1),
        lambda text: text.replace('"files": {', '"files": [], "other": {', 1),
        lambda text: text.replace("chunks/000000000", "../chunks/000000000", 1),
        lambda text: text.replace("e_p_peak", "e_v_peak", 1),
    ],
)
@pytest.mark.parametrize("act", [pc.SweepResult, lambda folder: swept(folder, resume=True)], ids=["read", "resume"])
def test_a_damaged_manifest_is_told(change, act, copy):
    file = copy / "manifest.json"
    file.write_text(change(file.read_text()))
    with pytest.raises(InputError, match=r"manifest\.json"):
        act(copy)


def test_a_sweep_of_an_earlier_version_is_read_and_gets_its_digests(whole, copy):
    file = copy / "manifest.json"
    manifest = json.loads(file.read_text())
    for name in ("files", "sha256"):
        del manifest[name]
    file.write_text(json.dumps(manifest))
    with pytest.warns(PathControlWarning, match="has no checksums, as it was begun by an earlier version"):
        assert pc.SweepResult(copy).table().identical(pc.SweepResult(whole).table())
    with pytest.warns(PathControlWarning, match="no checksums, .* its 5 files are taken as they are"):
        swept(copy, resume=True)
    assert content(copy) == content(whole)


def test_files_that_are_not_noted_do_not_count(whole, copy):
    """As those of a process that was killed before it noted them."""
    for place in ("chunks/000000004-000000005.parquet", "runs/000000009.nc"):
        (copy / place).write_bytes(b"half")
    Manifest.begin(copy, 6, json.loads((copy / "manifest.json").read_text())["definition"]).note(
        {
            file: digest
            for file, digest in json.loads((whole / "manifest.json").read_text())["files"].items()
            if "000000004" not in file
        }
    )
    with (copy / "files.log").open("a") as log:
        log.write('{"chunks/00')
    assert pc.SweepResult(copy).finished == 4
    swept(copy, resume=True)
    assert content(copy) == content(whole)


def test_a_second_process_is_refused_and_a_killed_one_leaves_no_lock(tmp_path):
    folder, inside = tmp_path / "sweep", tmp_path / "inside"
    parent = os.getpid()

    def waiting(p, samples):
        if os.getpid() != parent:
            inside.touch()
            time.sleep(PATIENCE)
        return circle(p, samples)

    process = multiprocessing.get_context("fork").Process(
        target=lambda: pc.sweep(waiting, SPACE, folder, progress=False)
    )
    process.start()
    while not inside.exists():
        assert process.is_alive()
        time.sleep(0.01)
    for resume in (False, True):
        with pytest.raises(InputError, match=r"another process is writing to .*; wait for it, or name another folder"):
            pc.sweep(waiting, SPACE, folder, resume=resume, progress=False)
    space = {"K_p": stats.loguniform(100.0, 1e4), "k": [20.0]}
    options = {"out": folder, "resume": True, "population": 5, "generations": 1, "progress": False}
    with pytest.raises(InputError, match="another process is writing to"):
        pc.tune(circle, space, "e_p_peak", **options)
    process.kill()
    process.join()
    assert pc.sweep(waiting, SPACE, folder, resume=True, progress=False).finished == 6
    assert not [file for file in folder.rglob("*") if "lock" in file.name]


def test_a_tuning_mends_its_notes(tmp_path):
    pytest.importorskip("pymoo")
    space = {"K_p": stats.loguniform(100.0, 1e4), "k": stats.uniform(1.0, 50.0)}
    options = {"population": 6, "generations": 2, "chunk": 3, "progress": False}
    noted = pc.tune(circle, space, "e_p_peak", out=tmp_path / "a", **options)
    before = content(tmp_path / "a")
    files = sorted((tmp_path / "a/chunks").iterdir())
    flipped(files[0], 12_345)
    files[2].unlink()
    with pytest.raises(InputError, match=rf"{files[0].name} \(damaged\), .*{files[2].name} \(missing\)"):
        pc.SweepResult(tmp_path / "a")
    with pytest.warns(PathControlWarning, match=rf"{files[0].name} \(damaged\), .*{files[2].name} \(missing\)"):
        again = pc.tune(circle, space, "e_p_peak", out=tmp_path / "a", resume=True, **options)
    assert again.table().identical(noted.table())
    assert content(tmp_path / "a") == before


# --- saved runs --------------------------------------------------------------------------------------------------


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
def test_what_no_task_is_made_of_is_refused(task, run, tmp_path):
    file = run.save(tmp_path / "run.nc")
    data, config, stored = read_run(file)
    recipes = json.loads(stored.text) | {"task": task, "first_rollout": 0}
    write_run(file, data, config, stored._replace(text=json.dumps(recipes)))
    with pytest.raises(PathControlError):
        _ = pc.Run.load(file).task


# --- disks -------------------------------------------------------------------------------------------------------


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


# --- bounds ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "space",
    [
        lambda: pc.Space.sobol({"k": stats.uniform(1.0, 2.0)}, 10**10),
        lambda: pc.Space.random({"k": stats.uniform(np.zeros(100), 2.0)}, 2 * 10**6),
        lambda: pc.Space.grid({f"k{i}": list(range(1000)) for i in range(7)}),
        lambda: pc.Space.latin_hypercube({"k": stats.uniform(1.0, 2.0)}, 10**300),
    ],
)
def test_more_samples_than_memory_holds_are_refused_at_once(space):
    with pytest.raises(InputError, match=r"samples = 1?2?0+.*, expected at most \d+, which are in memory together"):
        space()


def test_a_file_names_the_key(tmp_path):
    (tmp_path / "s.toml").write_text(FILE)
    with pytest.raises(pc.ExperimentError, match=r"sweep.samples = 10000000000, expected at most 10000000"):
        run_sweep(tmp_path / "s.toml", tmp_path / "out")
    assert not (tmp_path / "out").exists()


FILE = """
duration = 1.0
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 1.0
speed = 2.0
[controller]
type = "projection"
k_p = 800.0
K_v = [45.0, 100.0]
[sweep]
method = "sobol"
samples = 10000000000
[sweep.parameters]
"controller.k_p" = { uniform = [1.0, 2.0] }
"""


# --- names -------------------------------------------------------------------------------------------------------


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
        (["view", "RUN", "--out", "a.mp4"], "save_video"),
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
    assert [file.name for file in pc.save_figure(pc.error_figure(run), tmp_path / "B.PDF", ["svg"])] == [
        "B.svg",
        "B.pdf",
    ]
