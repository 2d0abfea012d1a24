"""``pathcontrol tune``: a candidate is the experiment with its values; what is wrong is told by key."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner
from test_sweep_file import BASE, alone

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.errors import ExperimentError
from pathcontrol.experiments.tune_runner import run_tune

pytest.importorskip("pymoo")
pytest.importorskip("pyarrow")

TUNE = """
[tune]
objectives = "e_p_rms"
population = 5
generations = 2
[tune.limits]
tau_noise = 1e6
speed_ratio = [0.0, inf]
[tune.scenarios]
"plant.payload.mass" = [0.0, 1.0]
[tune.parameters]
"controller.K_p" = { log_uniform = [100.0, 1e4] }
"controller.K_v" = { uniform = [[30.0, 80.0], [50.0, 120.0]] }
"""


@pytest.fixture
def experiment(tmp_path):
    def write(text):
        file = tmp_path / "tune.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


def test_a_candidate_is_the_experiment_with_its_values_in_each_scenario(experiment, tmp_path):
    found = run_tune(experiment(BASE + TUNE), tmp_path / "out", progress=False)
    assert found.table().sizes["sample"] == 10
    for number in (0, 9):
        one = found.candidate(number)
        values = {name: np.asarray(value).tolist() for name, value in one.parameters.items()}
        alike = [pc.metrics(alone(values | {"plant.payload.mass": mass})) for mass in (0.0, 1.0)]
        for name in ("e_p_rms", "tau_noise"):
            assert one.metrics[name] == max(numbers[name][0] for numbers in alike)
        assert one.metrics["speed_ratio"] == min(numbers["speed_ratio"][0] for numbers in alike)


def test_the_command_tells_what_it_found_and_draws_it(experiment, tmp_path):
    file, out = experiment(BASE + TUNE), tmp_path / "out"
    done = CliRunner().invoke(main, ["tune", str(file), "--out", str(out), "--json"])
    assert done.exit_code == 0, done.stderr
    told, found = json.loads(done.stdout), run_tune(file, out, resume=True, progress=False)
    assert told["candidates"] == 10
    assert told["best"]["e_p_rms"]["number"] == found.best().number
    assert told["best"]["e_p_rms"]["metrics"] == found.best().metrics
    assert all((out / name).stat().st_size for name in ("front.svg", "front.png"))
    again = CliRunner().invoke(main, ["tune", str(file), "--out", str(out), "--resume"])
    assert str(found) in again.stdout
    assert pc.SweepResult(out).finished == 20


def test_a_front_that_is_not_there_is_not_drawn(experiment, tmp_path):
    file = experiment(BASE + TUNE.replace('"e_p_rms"', '["e_p_rms", "settling_time"]'))
    done = CliRunner().invoke(main, ["tune", str(file), "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert "settling time of ‖e_p‖ is not finite" in done.stdout
    assert "figure" not in done.stdout


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("", r"tune: missing; add a section \[tune\]"),
        (TUNE.replace('objectives = "e_p_rms"\n', ""), "tune.objectives: missing"),
        (TUNE.replace('"e_p_rms"', "5"), "tune.objectives = 5, expected the name of a metric, a list of them, or"),
        (TUNE.replace("log_uniform = [100.0, 1e4]", "normal = [100.0, 1.0]"), "normal has no ends to search between"),
        (
            TUNE.replace("[100.0, 1e4]", "[1e4, 100.0]"),
            r"tune.parameters.controller.K_p: log_uniform = .*, expected 0",
        ),
        (
            TUNE.replace("controller.K_p", "controller.K_q"),
            "tune.parameters: in sample 0: controller.*K_q: unknown",
        ),
        (TUNE.replace("uniform = [[30.0, 80.0]", "uniform = [[-30.0, 80.0]"), "expected gains greater than 0"),
        (TUNE.replace("= [0.0, 1.0]", "= []"), "expected a list of numbers"),
        (TUNE.replace("e_p_rms", "e_p_rsm"), "tune.objectives: metrics = .*; did you mean 'e_p_rms'"),
        (TUNE.replace("tau_noise", "tau_noize"), "tune.limits: .*; did you mean 'tau_noise'"),
    ],
)
def test_what_is_wrong_is_told_by_key(section, message, experiment, tmp_path):
    with pytest.raises(ExperimentError, match=message):
        run_tune(experiment(BASE + section), tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()


def test_a_file_may_be_run_swept_and_tuned(experiment, tmp_path):
    from pathcontrol.experiments.runner import run_experiment
    from pathcontrol.experiments.sweep_runner import run_sweep

    sweep = '[sweep]\n[sweep.parameters]\n"controller.k" = { grid = [5.0, 20.0] }\n'
    file = experiment(BASE + TUNE + sweep)
    assert run_experiment(file, tmp_path / "run", progress=False).run.rollouts == 1
    assert run_sweep(file, tmp_path / "sweep", progress=False).finished == 2
