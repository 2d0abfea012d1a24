"""Folders of sweeps and tunings whose checksums are right and whose contents are not: refused in plain words."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import warnings

import numpy as np
import pytest
from scipy import stats

import pathcontrol as pc
from pathcontrol.errors import InputError, ToolpathError, UrdfError
from pathcontrol.robot.urdf.xml.parse import parse_urdf
from pathcontrol.sweeps.manifest import Manifest, _digest
from pathcontrol.toolpaths.svg.reader import read_svg

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

ROBOT = pc.load_robot("cicese_2dof")
SPACE = pc.Space.random({"K_p": stats.loguniform(100.0, 1e4)}, 4)


def circle(p, samples):
    law = pc.ComputedTorque(ROBOT, pc.Circle(1.0, 2.0), p["K_p"][:, None], [45.0, 100.0])
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.01}


def sweep(folder, **options):
    return pc.sweep(
        circle, SPACE, folder, metrics=["e_p_peak"], keep=pc.Keep(worst=1, by="e_p_peak"), progress=False, **options
    )


def tune(folder, **options):
    pytest.importorskip("pymoo")
    limits = {"tau_demand_peak": 900.0}
    size = {"population": 5, "generations": 1}
    return pc.tune(circle, SPACE, ["e_p_peak"], limits=limits, out=folder, progress=False, **size, **options)


def forge(folder, name, values=None):
    """Change a column of all chunks, or take it away, and note the right checksums."""
    manifest = json.loads((folder / "manifest.json").read_text())
    for place in [place for place in manifest["files"] if place.startswith("chunks")]:
        table = pq.read_table(folder / place)
        column = table.column_names.index(name)
        table = table.remove_column(column)
        if values is not None:
            table = table.append_column(name, pa.array([values] * table.num_rows))
        memory = io.BytesIO()
        pq.write_table(table, memory)
        (folder / place).write_bytes(memory.getvalue())
        manifest["files"][place] = hashlib.sha256(memory.getvalue()).hexdigest()
    rewrite(folder, manifest)


def rewrite(folder, manifest):
    manifest["sha256"] = _digest(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest))


def test_words_are_no_metric_by_which_histories_are_kept(tmp_path):
    sweep(tmp_path / "sweep")
    forge(tmp_path / "sweep", "e_p_peak", "large")
    with pytest.raises(InputError, match="e_p_peak, by which histories are kept, is <U5, expected numbers"):
        pc.SweepResult(tmp_path / "sweep").histories()
    with pytest.raises(InputError, match="e_p_peak, by which histories are kept, is <U5, expected numbers"):
        sweep(tmp_path / "sweep", resume=True)


@pytest.mark.parametrize("samples", [1, 3, 5, 1000])
def test_a_sweep_of_another_number_of_samples_is_not_resumed(samples, tmp_path):
    sweep(tmp_path / "sweep")
    manifest = json.loads((tmp_path / "sweep" / "manifest.json").read_text())
    rewrite(tmp_path / "sweep", manifest | {"samples": samples})
    with pytest.raises(InputError, match=rf"samples was {samples}, is now 4|has samples 0 to|is damaged"):
        sweep(tmp_path / "sweep", resume=True)


def test_a_manifest_that_lost_its_files_is_not_one_of_an_earlier_version(tmp_path):
    sweep(tmp_path / "sweep")
    manifest = json.loads((tmp_path / "sweep" / "manifest.json").read_text())
    del manifest["files"]
    rewrite(tmp_path / "sweep", manifest)
    for use in (pc.SweepResult, lambda folder: sweep(folder, resume=True)):
        with pytest.raises(InputError, match="files = None, expected a table"):
            use(tmp_path / "sweep")


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [("tau_demand_peak", "large", "is <U5"), ("status", None, "has no status"), ("e_p_peak", [1.0, 2.0], "InputError")],
)
def test_a_tuning_of_other_columns_is_refused(name, values, said, tmp_path):
    tune(tmp_path / "tune")
    forge(tmp_path / "tune", name, values)
    with pytest.raises(InputError) as caught:
        tune(tmp_path / "tune", resume=True)
    assert said == "InputError" or said in str(caught.value)


# --- what a parser says of a file --------------------------------------------------------------------------------


def test_messages_do_not_repeat_a_whole_file(tmp_path):
    name = "a" * 30_000
    (tmp_path / "a.svg").write_text(f"<svg xmlns='http://www.w3.org/2000/svg'><{name}></svg>")
    with pytest.raises(ToolpathError, match=r"no well-formed SVG drawing: .* … .*line 1") as caught:
        read_svg(tmp_path / "a.svg")
    assert len(str(caught.value)) < 400 + len(str(tmp_path))
    with pytest.raises(UrdfError, match="line 1: not XML") as caught:
        parse_urdf(f"<robot name='a'><{name}></robot>")
    assert len(str(caught.value)) < 400


def test_a_clip_path_of_huge_numbers_is_no_convex_one(tmp_path):
    clip = '<clipPath id="c"><path d="M0 0H1e200V1e200H0z"/></clipPath>'
    shape = '<path clip-path="url(#c)" fill="none" stroke="black" d="M0 0H9"/>'
    (tmp_path / "a.svg").write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm" viewBox="0 0 9 9">{clip}{shape}</svg>'
    )
    with contextlib.suppress(ToolpathError):
        assert np.isfinite(read_svg(tmp_path / "a.svg").contours[0].length)


# --- lines of the log ---------------------------------------------------------------------------------------------


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


FORGED = {
    "goes": lambda files: {place: None for place in files if place.startswith("runs")},
    "chunk goes": lambda files: {place: None for place in files if place.startswith("chunks")},
    "another digest": lambda files: dict.fromkeys(files, "0" * 64),
    "an old line": lambda files: files,
    "a false checksum": lambda files: {"files": {next(iter(files)): None}, "sha256": "0" * 64},
    "no table": lambda files: [1, 2],
    "more": lambda files: {"files": {}, "sha256": "0" * 64, "and": 1},
    "deep": lambda files: {"files": {"runs/../../x.nc": None}, "sha256": "0" * 64},
}


@pytest.mark.parametrize("line", FORGED.values(), ids=FORGED)
def test_a_forged_line_of_the_log_is_named_and_not_believed(line, tmp_path):
    """It is refused where a sweep is read, and named and left out where it is resumed."""
    folder = tmp_path / "sweep"
    sweep(folder)
    before = content(folder)
    files = json.loads((folder / "manifest.json").read_text())["files"]
    (folder / "files.log").write_text(json.dumps(line(files)) + "\n")
    with pytest.raises(InputError, match=r"files\.log' is damaged: line 1: .*; resume the sweep"):
        pc.SweepResult(folder)
    with pytest.warns(pc.PathControlWarning, match=r"is damaged, and is made again there: files\.log \(line 1: "):
        sweep(folder, resume=True)
    assert content(folder) == before


@pytest.mark.parametrize("keep_going", [sweep, tune])
def test_a_bit_that_flips_in_the_log_costs_a_chunk_and_no_more(keep_going, tmp_path):
    """As where a process was killed: what the damaged line noted is made again."""
    rng = np.random.default_rng(3)
    folder = tmp_path / "folder"
    keep_going(folder)
    before = content(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    for _ in range(5):
        log = Manifest.begin(folder, manifest["samples"], manifest["definition"])
        for place, digest in manifest["files"].items():
            log.note({place: digest})
        text = bytearray((folder / "files.log").read_bytes())
        place = int(rng.integers(8 * len(text)))
        text[place // 8] ^= 1 << place % 8
        (folder / "files.log").write_bytes(bytes(text))
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            keep_going(folder, resume=True)
        assert content(folder) == before
        if text[-1:] != b"\n":
            continue  # the last line lost its end, as if it had not been written
        assert any("files.log (line" in str(one.message) for one in told)
