"""Runs from files and configurations that nobody in their senses would write: one clear error, or a page."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from test_film import made_up_run

from pathcontrol import (
    Circle,
    ExtendedMotionPlan,
    InputError,
    RobotModel,
    Run,
    SampledLoop,
    comparison_figure,
    load_robot,
    simulate,
    torque_figure,
)
from pathcontrol.cli import main
from pathcontrol.view.figures.style import save_figure
from pathcontrol.view.film.recorder import record
from pathcontrol.view.report.downloads import file_name, json_file
from pathcontrol.view.report.report import report
from pathcontrol.view.report.reproduction import script
from pathcontrol.view.report.settings import settings as groups_of

LIMITS = [30.0, 5.0]
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@pytest.fixture(scope="module")
def run() -> Run:
    arm, task = load_robot("cicese_2dof"), Circle(1.0, 2.0)
    law = ExtendedMotionPlan(arm, task, K_p=[2000.0, 2000.0], K_v=[60.0, 60.0], k=10.0)
    return simulate(law, [0.7, 1.2], duration=0.2, loop=SampledLoop(torque_limits=LIMITS))


@pytest.fixture
def file(run: Run, tmp_path: Path) -> Path:
    return run.save(tmp_path / "odd.nc")


def lines(animation: Any, title: str) -> dict[str, np.ndarray]:
    raw = gzip.decompress(animation.film.packed())
    size = int.from_bytes(raw[:4], "little")
    header = json.loads(raw[4 : 4 + size])
    [chart] = [chart for chart in header["charts"] if chart["title"] == title]
    at = {line["label"]: line["values"] for line in chart["lines"]}
    return {name: np.frombuffer(raw, np.float32, ref["count"], 4 + size + ref["at"]) for name, ref in at.items()}


def with_config(run: Run, config: Any) -> Run:
    return Run.from_arrays(
        run.time,
        {"joint_1": "rad", "joint_2": "rad"},
        {name: run.array(name) for name in run.data.data_vars},
        config,
        robot=run.robot,
        task=run.task,
    )


# --- files --------------------------------------------------------------------------------------------------


def spoilt(file: Path, spoil: Callable[[h5py.File], None]) -> None:
    """Change a file as one of an earlier version, whose numbers no checksum guards."""
    with h5py.File(file, "a") as opened:
        for group in (opened, opened["origin"]):
            del group.attrs["pathcontrol_sha256"]
        spoil(opened)


def without(name: str) -> Callable[[h5py.File], None]:
    return lambda file: file.__delitem__(name)


def configured(text: Any) -> Callable[[h5py.File], None]:
    return lambda file: file.attrs.__setitem__("pathcontrol_config", text)


def backwards(file: h5py.File) -> None:
    file["time"][:] = file["time"][:][::-1]


def lost(file: h5py.File) -> None:
    file["q"][:, 5:] = np.nan


def huge(file: h5py.File) -> None:
    file.create_dataset("more", shape=(10**13,), dtype="f8", chunks=(10**6,), compression="gzip")


def unitless(file: h5py.File) -> None:
    del file["q"].attrs["units"]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (without("q"), "it has no q"),
        (without("status"), "it has no status"),
        (unitless, "q has no unit"),
        (backwards, "do not increase"),
        (lost, "joint positions that are not finite"),
        (configured("[1, 2]"), "configuration is a list"),
        (configured("null"), "configuration is a NoneType"),
        (configured(3), "not a run saved by"),
        (configured("[" * 100_000), "not a run saved by"),
        (configured('{"a":' + "[" * 90 + "]" * 90 + "}"), "nested more than 50 deep"),
        (huge, "not a run saved by"),
    ],
)
def test_a_spoilt_file_is_named(file: Path, spoil: Callable[[h5py.File], None], said: str) -> None:
    spoilt(file, spoil)
    result = CliRunner().invoke(main, ["view", str(file)])
    assert result.exit_code == 2
    assert str(file) in result.stderr
    assert said in result.stderr
    assert not file.with_suffix(".html").exists()


def test_a_spoilt_path_is_named_with_its_file(file: Path) -> None:
    def renamed(opened: h5py.File) -> None:
        recipe = opened["origin"]["recipe"]
        recipe[:] = np.frombuffer(recipe[:].tobytes().replace(b"Circle", b"Cirkus"), dtype=np.uint8)

    spoilt(file, renamed)
    result = CliRunner().invoke(main, ["view", str(file)])
    assert result.exit_code == 2
    assert str(file) in result.stderr
    assert "Cirkus" in result.stderr


@pytest.mark.parametrize("command", ["view", "report"])
def test_a_run_is_not_written_over(file: Path, command: str) -> None:
    before = file.read_bytes()
    result = CliRunner().invoke(main, [command, str(file), "--out", str(file)])
    assert result.exit_code == 2
    assert "which would be lost" in result.stderr
    assert file.read_bytes() == before


def test_a_disk_that_takes_nothing_is_an_error_without_a_traceback(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    result = CliRunner().invoke(main, ["view", str(file)])
    assert result.exit_code == 2
    assert "No space left on device" in result.stderr
    assert sorted(path.name for path in file.parent.iterdir()) == [file.name]


# --- configurations -----------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.dictionaries(st.sampled_from(["controller", "loop", "plant", "versions", "duration", "laps"]), anything))
def test_any_configuration_makes_a_film_and_settings(config: dict[str, Any]) -> None:
    arm = load_robot("cicese_2dof")
    made = made_up_run(arm, np.zeros((3, 2)), 1.0, np.arange(3.0))
    odd = Run.from_arrays(
        made.time, {"joint_1": "rad", "joint_2": "rad"}, {n: made.array(n) for n in ("q", "s")}, config, robot=arm
    )
    assert record(odd, task=Circle(1.0, 1.0)).html()
    assert script("odd", odd) == ""
    groups_of([odd.config])
    repr(odd)


@pytest.mark.parametrize("law", [[1], None, "x", {"sequence": 5}, {"sequence": []}, {"sequence": ["a"]}])
def test_odd_laws_make_a_report(run: Run, law: Any, tmp_path: Path) -> None:
    config = run.config | {"controller": law, "versions": ["a"], "loop": {"loop": ["x"]}, "experiment": "a\ud800b"}
    assert "a\\ud800b" in report(with_config(run, config), tmp_path / "odd.html").read_text("utf-8")


@given(anything)
def test_downloads_are_json_for_any_reader(value: Any) -> None:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    text = base64.b64decode(json_file("any.json", value).href.partition(",")[2])
    json.loads(text, parse_constant=refuse)


@given(st.text(max_size=300))
def test_names_of_files_are_short_and_harmless(name: str) -> None:
    found = file_name(name)
    assert 0 < len(found) <= 100
    assert not found.startswith(".")
    assert not set(found) & set('/\\:*?"<>|\0')


# --- limits, and the same again -----------------------------------------------------------------------------


def test_page_and_figures_compare_with_the_limits_that_clamped(run: Run) -> None:
    assert (run.robot.limits.effort > LIMITS).all()
    shares = lines(record(run), "torque / limit")
    for i, joint in enumerate(("joint_1", "joint_2")):
        largest = np.abs(run.array("tau")[0, :, i]).max() / LIMITS[i]
        assert np.abs(shares[joint]).max() == pytest.approx(100 * largest, rel=1e-6)
    titles = [axes.get_title(loc="right") for axes in torque_figure(run).axes]
    assert [title.split(" of ")[1] for title in titles] == ["30 N m", "5 N m"]


@pytest.mark.parametrize("layout", ["beside", "ghosted"])
def test_loaded_twice_is_the_same_as_one_run_twice(run: Run, file: Path, layout: Any) -> None:
    once = Run.load(file)
    films = [{"a": run, "b": run}, {"a": once, "b": Run.load(file)}, {"a": run, "b": once}]
    assert len({record(runs, layout=layout).film.packed() for runs in films}) == 1


def test_ghosts_of_other_arms_keep_their_paths(run: Run, arm: RobotModel) -> None:
    """The same path in joint space is another one of another tool."""
    arms = [arm.with_frame("pen", "tool", [0.0, 0.1, z]) for z in (0.1, 0.3)]
    joints, arrays = {"joint_1": "rad", "joint_2": "rad"}, {name: run.array(name) for name in run.data.data_vars}
    near, far = (Run.from_arrays(run.time, joints, arrays, run.config, robot=one, task=run.task) for one in arms)
    lists = [record({"a": near, "b": b}, layout="ghosted", tool="pen").film for b in (near, far)]
    assert len(lists[1].header["tubes"]) == len(lists[0].header["tubes"]) + 1


def test_the_same_comparison_is_the_same_bytes(run: Run, tmp_path: Path) -> None:
    written = {
        save_figure(comparison_figure({"a": run, "b": run}), tmp_path / str(i), ("svg",))[0].read_bytes()
        for i in range(3)
    }
    assert len(written) == 1


def test_half_a_character_in_a_name_can_be_written(run: Run, tmp_path: Path) -> None:
    page = record({"a\ud800": run, "b": run}).save(tmp_path / "half.html")
    assert "a\\ud800" in page.read_text("utf-8")


def test_positions_beyond_any_arm_are_refused(arm: RobotModel) -> None:
    with pytest.raises(InputError, match=r"at 0\.5 s; to show what was before"):
        record(made_up_run(arm, np.array([[0.0, 0], [1e200, 0], [0, 0]]), 1.0))
