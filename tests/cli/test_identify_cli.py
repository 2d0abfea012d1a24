"""The command identify."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    robot = pc.load_robot("cicese_2dof")
    task = pc.Lissajous([0.8, 0.8], [3, 4], 1.3, phases=[0.2, 2.0], center=[0.2, 0.4])
    law = pc.ComputedTorque(robot, task, K_p=400.0, K_v=40.0)
    path = tmp_path_factory.mktemp("identify") / "run.nc"
    pc.simulate(law, task.q_d(np.array(0.0)), duration=6.0, progress=False).save(path)
    return path


def identify(*words):
    return CliRunner().invoke(main, ["identify", *map(str, words)])


def test_numbers_are_those_of_the_library(saved):
    done = identify(saved, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    found = pc.identify_friction(pc.Run.load(saved))
    assert told["form"] == "coulomb"
    for i, joint in enumerate(found.joints):
        assert told["joints"][joint]["excited"] is True
        for name, values in found.coefficients.items():
            assert told["joints"][joint][name] == pytest.approx(values[i])
            assert told["joints"][joint]["standard_errors"][name] == pytest.approx(found.errors[name][i])


def test_a_table_the_figure_and_numbers_are_written(saved, tmp_path):
    done = identify(saved, "--form", "stribeck", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "windows" in done.stdout
    assert "±" in done.stdout
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"friction.svg", "friction.png", "friction.json"}
    assert json.loads((tmp_path / "out" / "friction.json").read_text())["form"] == "stribeck"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--window", "0"], "--window 0"),
        (["--min-speed", "-1"], "--min-speed -1"),
        (["--form", "dahl"], "'dahl' is not"),
    ],
)
def test_what_is_wrong_is_told(saved, words, said):
    done = identify(saved, *words)
    assert done.exit_code == 2
    assert said in done.stderr


def test_a_file_that_is_no_run_is_told(tmp_path):
    (tmp_path / "mine.toml").write_text("duration = 1.0\n")
    assert "is an experiment, expected a saved run" in identify(tmp_path / "mine.toml").stderr
    assert "there is no file" in identify(tmp_path / "absent.nc").stderr
