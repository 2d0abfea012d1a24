"""The command stability."""

import json

import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.experiments.runner import load_setup

FILE = """
duration = 6.0
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 0.25
speed = 2.0
[controller]
type = "extended_motion_plan"
K_p = 400.0
K_v = 40.0
k = 20.0
[loop]
period = 0.02
torque_limits = true
encoders = true
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "experiment.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


def stability(*words):
    return CliRunner().invoke(main, ["stability", *map(str, words)])


def test_numbers_are_those_of_the_library(file):
    done = stability(file, "--gain", "K_p", 100, 2000, "--points", 3, "--largest", "K_v", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["left_out"] == ["dry friction", "encoders", "torque limits"]
    law = load_setup(file).controller
    arm = law.robot.with_friction(pc.Viscous(law.robot.friction.viscous))
    smooth, loop = pc.ExtendedMotionPlan(arm, law.task, 400.0, 40.0, 20.0), pc.SampledLoop(period=0.02)
    assert told["decay_rate"] == pytest.approx(pc.floquet(smooth, loop, settle=1).decay_rate, rel=1e-6)
    assert told["stable"] is True
    assert told["largest"]["K_v"] == pytest.approx(pc.largest_gain(smooth, "K_v", loop, settle=1), rel=1e-5)
    assert told["map"]["gains"]["K_p"] == pytest.approx([100.0, 2000**0.5 * 10.0, 2000.0])
    assert len(told["map"]["decay_rate"]) == 3


def test_the_figure_is_written(file, tmp_path):
    done = stability(file, "--gain", "k", 1, 1e6, "--gain", "K_p", 100, 500, "--points", 2, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "the slowest deviation decays at" in done.stdout
    assert "boundary at k = " in done.stdout
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"stability.svg", "stability.png"}


def test_parameters_that_do_not_show_are_not_said_to_grow(tmp_path):
    path = tmp_path / "adaptive.toml"
    gains = 'type = "adaptive_slotine_li"\nLambda = 20.0\nK_d = [100.0, 10.0]\nadaptation = 0.001\n'
    begin, end = FILE.split('type = "extended_motion_plan"')
    end = end.replace("K_p = 400.0\nK_v = 40.0\n", "").replace("period = 0.02", "period = 0.005")
    path.write_text(begin + gains + end)
    done = stability(path)
    assert done.exit_code == 0, done.output
    assert "neither decays nor grows" in done.stdout
    assert "left out, for want of a derivative: " in done.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--gain", "kp", 1, 2], "did you mean 'K_p'"),
        (["--gain", "k", 5, 2], "--gain k 5 2"),
        (["--out", "folder"], "--gain NAME FROM TO"),
    ],
)
def test_what_is_wrong_is_told(file, words, said):
    done = stability(file, *words)
    assert done.exit_code == 2
    assert said in done.stderr
