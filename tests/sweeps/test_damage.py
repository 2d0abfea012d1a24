"""What is damaged, missing or held by another process is named, and nothing is read as if it were whole."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from patience import PATIENCE
from scipy import stats

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import InputError, PathControlWarning
from pathcontrol.experiments.sweep_runner import run_sweep
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
