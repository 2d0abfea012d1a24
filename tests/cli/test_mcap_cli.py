"""Commands that take a run take one in MCAP too."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main

pytest.importorskip("mcap")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    robot = pc.load_robot("cicese_2dof")
    task = pc.Lissajous([0.8, 0.8], [3, 4], speed=1.3, phases=[0.2, 2.0], center=[0.2, 0.4])
    law = pc.ComputedTorque(robot, task, K_p=400.0, K_v=40.0)
    run = pc.simulate(law, task.q_d(np.array(0.0)), duration=3.0, progress=False)
    folder = tmp_path_factory.mktemp("runs")
    return run.save(folder / "a" / "run.mcap"), run.save(folder / "b" / "run.nc")


def invoke(*words):
    done = CliRunner().invoke(main, list(map(str, words)))
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.parametrize("command", [("identify",), ("export", "--limits", "warn", "--out", "motion.csv")])
def test_both_formats_give_the_same(command, files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name, *options = command
    told = [json.loads(invoke(name, file, *options, "--json")) for file in files]
    assert told[0] == told[1]


def test_pages_are_made_of_a_file_or_its_folder(files, tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])  # as those of any other run
    told = json.loads(invoke("report", files[0].parent, "--out", tmp_path / "report.html", "--json"))
    assert set(told["runs"]) == {"a/run"} or set(told["runs"]) == {"run"}
    invoke("view", *files, "--out", tmp_path / "film.html")
    assert (tmp_path / "report.html").stat().st_size > 1e5
    assert (tmp_path / "film.html").stat().st_size > 1e5


def test_a_log_is_not_taken_for_an_experiment(files):
    done = CliRunner().invoke(main, ["run", str(files[0])])
    assert done.exit_code == 2
    assert "a saved run" in done.stderr
