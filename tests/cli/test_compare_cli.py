"""``pathcontrol compare``: scenarios by name and from files, JSON, and bad input."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main

JAM = """
duration = 10.0
angle_unit = "deg"
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 57.3
speed = 114.59
[controller]
type = "{law}"
{gains}
[start]
q = [40.0, 70.0]
[loop]
torque_limits = true
[disturbance]
type = "jammed_joint"
joint = "joint_2"
start = 4.0
duration = 0.6
"""
GAINS = {
    "extended_motion_plan": "K_p = 800.0\nK_v = [45.0, 100.0]\nk = 20.0",
    "projection": "k_p = 800.0\nK_v = [45.0, 100.0]",
    "computed_torque": "K_p = 800.0\nK_v = [45.0, 100.0]",
}


def call(*arguments):
    return CliRunner().invoke(main, ["compare", *map(str, arguments)])


def done(*arguments):
    result = call(*arguments, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


@cache
def jammed():
    return done("--scenario", "jammed-joint", "--rollouts", 2)


def test_list_names_what_exists():
    assert call("--list").stdout.splitlines()[1].startswith("jammed-joint ")
    assert done("--list")["scenarios"] == pc.known_scenarios()


def test_a_scenario_by_its_name():
    said = jammed()
    assert said["event"] == [4.0, 4.6]
    numbers = said["controllers"]
    assert numbers["computed_torque"]["contour_peak"] > 2 * numbers["projection"]["contour_peak"]


@pytest.mark.parametrize(
    ("law", "option"), [("extended_motion_plan", []), ("projection", ["--scenario"]), ("computed_torque", [])]
)
def test_a_file_that_says_the_same_gives_the_same(tmp_path, law, option):
    path = tmp_path / "mine.toml"
    path.write_text(JAM.format(law=law, gains=GAINS[law]), encoding="utf-8")
    of_file = done(*option, path, "--rollouts", 2)
    assert of_file["scenario"] == "mine"
    assert of_file["event"] == pytest.approx([4.0, 4.6])
    for name, numbers in jammed()["controllers"].items():
        for key in ("contour_peak", "lag_peak", "speed_peak", "recovery_s", "time_lost_s"):
            assert of_file["controllers"][name][key] == pytest.approx(numbers[key], rel=1e-3, abs=1e-6)


def test_the_table_says_what_it_is_of_and_where_motion_control_wins():
    said = call("--scenario", "jammed-joint", "--rollouts", 2).stdout
    assert "from 4 to 10 s" in said
    assert "Motion control is the best in: " in said
    assert "time lost" in said.rpartition("best in: ")[2]


def test_the_engine_is_that_of_the_file_unless_told(tmp_path):
    path = tmp_path / "mine.toml"
    text = JAM.format(law="projection", gains=GAINS["projection"])
    text = text.replace("10.0", "0.9", 1).replace("start = 4.0", "start = 0.2")
    path.write_text('engine = "pinocchio"\n' + text, encoding="utf-8")
    scenario = pc.load_scenario(path)
    used = [pc.compare("projection", scenario, rollouts=1, engine=engine) for engine in (None, "compiled")]
    assert [one.runs["projection"].config["engine"] for one in used] == ["pinocchio", "compiled"]


def test_chosen_laws_and_seed():
    said = done("--scenario", "undisturbed", "--law", "projection", "--law", "pd_plus", "--rollouts", 1, "--seed", 3)
    assert list(said["controllers"]) == ["projection", "pd_plus"]
    assert np.isfinite(said["controllers"]["pd_plus"]["energy_j"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "--list"),
        (["--scenario", "jammed-joint", "mine.toml"], "either"),
        (["--scenario", "jammed"], "jammed-joint"),
        (["--scenario", "undisturbed", "--law", "pid"], "computed_torque"),
        (["missing.toml"], "there is no file"),
        (["--scenario", "missing.toml"], "there is no file"),
        (["--scenario", "undisturbed", "--rollouts", "0"], "rollouts"),
        (["--scenario", "undisturbed", "--engine", "fast"], "engine"),
    ],
)
def test_bad_input_is_one_message(arguments, said):
    result = call(*arguments)
    assert result.exit_code == 2
    assert said in result.stderr


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("start = 4.0", "start = 40.0", "event"),
        ('type = "circle"', 'type = "circel"', "circle"),
        ('"joint_2"', '"joint_9"', "joint_9"),
    ],
)
def test_a_file_that_is_no_scenario(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(JAM.format(law="projection", gains=GAINS["projection"]).replace(old, new, 1), encoding="utf-8")
    result = call(path)
    assert result.exit_code == 2
    assert said in result.stderr
    assert "Traceback" not in result.stderr


def test_a_law_of_ones_own_in_a_file_has_no_gains_for_others(tmp_path):
    (tmp_path / "own.py").write_text(
        "import pathcontrol as pc\nclass Still(pc.MotionController):\n"
        "    def torque(self, q, qd, ref):\n        return self.robot.gravity(q)\n",
        encoding="utf-8",
    )
    path = tmp_path / "mine.toml"
    path.write_text(JAM.format(law="own.py:Still", gains=""), encoding="utf-8")
    result = call(path)
    assert result.exit_code == 2
    assert "Still" in result.stderr
    assert "computed_torque" in result.stderr


def test_out_writes_page_figure_and_numbers(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = done("--scenario", "jammed-joint", "--law", "projection", "--rollouts", 1, "--out", "deep/here")
    assert set(said["written"]) == {"html", "figure-svg", "figure-png", "summary"}
    assert all((tmp_path / path).stat().st_size > 0 for path in said["written"].values())
    kept = json.loads((tmp_path / said["written"]["summary"]).read_text(encoding="utf-8"))
    assert kept["controllers"] == said["controllers"]
    assert done("--scenario", "jammed-joint", "--law", "projection", "--rollouts", 1)["written"] == {}
    refused = call("--scenario", "jammed-joint", "--out", "page.html")
    assert refused.exit_code == 2
    assert "page.html" in refused.stderr


@pytest.mark.parametrize("width", [40, 80, 120, 240])
def test_the_table_shows_all_laws_on_a_terminal_of_any_width(width, monkeypatch, tmp_path):
    (tmp_path / "short.toml").write_text(
        'duration = 0.2\n[robot]\nsource = "cicese_2dof"\n[task]\ntype = "circle"\nradius = 1.0\nspeed = 2.0\n'
        f'[controller]\ntype = "extended_motion_plan"\n{GAINS["extended_motion_plan"]}\n'
    )
    monkeypatch.setenv("COLUMNS", str(width))
    said = call(tmp_path / "short.toml", "--law", "all", "--rollouts", 1).stdout
    table = said.partition("The numbers of one start")[0]
    assert "…" not in table
    assert max(map(len, table.splitlines())) <= width
    for word in ("computed", "projection", "linearization", "velocity", "saturated"):
        assert word in table
