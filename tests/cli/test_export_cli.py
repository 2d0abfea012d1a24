"""The command export: a run or an experiment becomes a trajectory for an arm."""

import csv
import json

import numpy as np
import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main

FILE = """
duration = 2.0
[robot]
source = "cicese_2dof"
[task]
type = "line"
start = [0.0, 0.0]
end = [0.6, 0.4]
speed = 0.5
[controller]
type = "computed_torque"
K_p = 800.0
K_v = 100.0
"""


def export(*words):
    return CliRunner().invoke(main, ["export", *map(str, words)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A saved run, and an experiment of the same."""
    folder = tmp_path_factory.mktemp("export")
    (folder / "line.toml").write_text(FILE)
    robot = pc.load_robot("cicese_2dof")
    law = pc.ComputedTorque(robot, pc.Line([0.0, 0.0], [0.6, 0.4], speed=0.5), K_p=800.0, K_v=100.0)
    pc.simulate(law, [0.0, 0.0], duration=2.0, progress=False).save(folder / "line.nc")
    return folder


@pytest.mark.parametrize(("name", "suffix"), [("csv", ".csv"), ("ros", ".json")])
@pytest.mark.parametrize("source", ["line.nc", "line.toml"])
def test_a_run_and_an_experiment_are_written(folder, tmp_path, source, name, suffix):
    done = export(folder / source, "--format", name, "--rate", 50, "--out", tmp_path / "here", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["written"] == str(tmp_path / f"here{suffix}")
    assert told["format"] == name
    assert (told["samples"] - 1) / 50 == pytest.approx(told["duration"])
    text = (tmp_path / f"here{suffix}").read_text()
    count = len(text.splitlines()) - 1 if name == "csv" else len(json.loads(text)["points"])
    assert count == told["samples"]


def test_the_plan_of_an_experiment_is_that_of_its_task(folder, tmp_path):
    done = export(folder / "line.toml", "--rate", 20, "--duration", 1.0, "--out", tmp_path / "plan.csv")
    assert done.exit_code == 0, done.output
    assert "warning: the trajectory begins at" in done.stderr
    with (tmp_path / "plan.csv").open() as stream:
        _, *rows = csv.reader(stream)
    table = np.array(rows, float)
    expected = np.outer(0.5 * table[:, 0], np.array([0.6, 0.4]) / np.hypot(0.6, 0.4))
    assert table[:, 1:3] == pytest.approx(expected, abs=1e-6)


def test_the_name_of_the_file_is_taken_without_out(folder):
    assert export(folder / "line.nc", "--format", "ros").exit_code == 0
    assert (folder / "line.json").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["absent.nc"], "there is no file"),
        (["line.nc", "--rate", "-3"], "--rate -3"),
        (["line.nc", "--duration", "1"], "--duration is for an experiment"),
        (["line.nc", "--rollout", "3"], "--rollout 3"),
        (["line.nc", "--format", "rapid"], "'rapid' is not one of"),
        (["line.nc", "--format", "urscript"], "six joints"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(folder, words, said):
    done = export(folder / words[0], *words[1:])
    assert done.exit_code == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
