"""What a report says about making a run again: it does make it again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import html

import pathcontrol as pc
from pathcontrol import Circle, RobotModel, Run
from pathcontrol.simulation.context import RunContext
from pathcontrol.view.report.code import call
from pathcontrol.view.report.report import report
from pathcontrol.view.report.reproduction import recipe

LAWS = {
    "plan": lambda robot, task: pc.ExtendedMotionPlan(robot, task, K_p=[800.0, 600.0], K_v=45.0, k=20.0),
    "projection": lambda robot, task: pc.Projection(robot, task, k_p=800.0, K_v=[45.0, 100.0], friction="none"),
    "computed torque": lambda robot, task: pc.ComputedTorque(robot, task, K_p=800.0, K_v=45.0, friction="full"),
    "pd": lambda robot, task: pc.PDPlus(robot, task, K_p=300.0, K_v=45.0),
    "slotine": lambda robot, task: pc.SlotineLi(robot, task, Lambda=10.0, K_d=[45.0, 10.0]),
}
LOOP = pc.SampledLoop(period=4e-3, encoders=[1e6, 1e5], velocity="difference", torque_limits=[150.0, np.inf])


def made_again(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.chdir(tmp_path)
    run.save("mine.nc")
    found = recipe("mine", run)
    assert found.kind == "python"
    namespace = {}
    exec(found.text, namespace)
    return namespace["run"]


def assert_same(run: Run, again: Run) -> None:
    assert set(again.data.data_vars) == set(run.data.data_vars)
    for name in run.data.data_vars:
        np.testing.assert_allclose(again.array(name), run.array(name), rtol=1e-6, atol=1e-9, err_msg=name)
    assert again.config == run.config


@pytest.mark.parametrize("law", LAWS)
def test_the_script_makes_the_run_again(law, arm, circle, tmp_path, monkeypatch):
    run = pc.simulate(LAWS[law](arm, circle), [[0.7, 1.2], [1.0, 0.1]], [0.1, 0.2], duration=0.2, loop=LOOP)
    assert_same(run, made_again(run, tmp_path, monkeypatch))


def test_the_script_in_continuous_time(arm, circle, tmp_path, monkeypatch):
    loop = pc.ContinuousTime(output_period=0.01, rtol=1e-5)
    run = pc.simulate(LAWS["plan"](arm, circle), [0.9, 0.1], duration=0.05, laps=3, loop=loop)
    assert_same(run, made_again(run, tmp_path, monkeypatch))


def test_the_script_of_a_noisy_part_of_a_batch(arm, circle, tmp_path, monkeypatch):
    loop = pc.SampledLoop(noise=pc.SensorNoise(1e-4, [1e-3, 2e-3], seed=5), velocity="exact")
    q = [[0.9, 0.1], [0.8, 0.2]]
    run = pc.simulate(LAWS["plan"](arm, circle), q, duration=0.05, loop=loop, first_rollout=3, progress=False)
    assert_same(run, made_again(run, tmp_path, monkeypatch))


def test_what_the_record_has_in_short_is_in_no_script(arm, circle):
    law = pc.ExtendedMotionPlan(arm, circle, np.full((70, 1), 800.0), 45.0, 20.0)
    run = pc.simulate(law, np.full((70, 2), 0.5), duration=0.01, progress=False)
    assert recipe("mine", run).kind == "none"
    plants = pc.simulate(LAWS["plan"](arm, circle), [0.9, 0.1], plant=[arm, arm], duration=0.01, progress=False)
    assert recipe("mine", plants).kind == "none"


def test_the_script_of_a_sequence(arm, tmp_path, monkeypatch):
    lines = [pc.Line([0.0, 0.0], [0.1, 0.2], 1.0), pc.Line([0.1, 0.2], [0.3, 0.0], 1.0)]
    laws = [pc.ExtendedMotionPlan(arm, line, K_p=800.0, K_v=45.0, k=2.0, friction="full") for line in lines]
    run = pc.simulate_sequence(laws, [0.0, 0.0], duration=[1.0, 2.0])
    again = made_again(run, tmp_path, monkeypatch)
    assert_same(run, again)
    np.testing.assert_array_equal(again["path_index"], run["path_index"])


def test_names_that_are_no_arguments_get_into_no_script(arm, circle):
    run = pc.simulate(LAWS["plan"](arm, circle), [0.9, 0.1], duration=0.01)
    for part in ("controller", "loop"):
        config = run.config | {part: run.config[part] | {"k=print('!')": 1}}
        assert recipe("mine", Run(run.data, config, RunContext.of(arm, circle))).kind == "none"


@given(st.text(), st.lists(st.one_of(st.floats(allow_nan=False), st.none(), st.text(), st.booleans()), max_size=3))
def test_values_in_a_script_stay_values(text, values):
    namespace = {"inf": np.inf}
    exec(f"made = {call('dict', [], {'text': text, 'values': values})}", namespace)
    assert namespace["made"] == {"text": text, "values": values}


def test_a_law_of_ones_own_has_no_script(arm, circle):
    class Mine(pc.Projection):
        pass

    run = pc.simulate(Mine(arm, circle, k_p=800.0, K_v=45.0), [0.9, 0.1], duration=0.01)
    assert recipe("mine", run).kind == "none"


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take most of the time, and nothing here is about them."""
    monkeypatch.setattr("pathcontrol.view.report.sections.pictures", lambda runs: [])


@pytest.mark.usefixtures("no_figures")
def test_an_experiment_shows_its_file(arm: RobotModel, circle: Circle, tmp_path: Path):
    text = 'duration = 1.0  # "<&>\n[robot]\nsource = "cicese_2dof"\n'
    run = pc.simulate(LAWS["plan"](arm, circle), [0.9, 0.1], duration=0.05)
    run.config["experiment"] = text
    page = html.document_fromstring(report({"a b": run}, tmp_path / "r.html").read_text(encoding="utf-8"))
    shown = [pre.text for pre in page.xpath("//pre")]
    assert text in shown
    assert "pathcontrol run a_b.toml" in shown
    assert page.xpath("//a[@download='a_b.toml']")


@pytest.mark.usefixtures("no_figures")
def test_versions_and_the_command_are_said(arm, circle, tmp_path):
    run = pc.simulate(LAWS["plan"](arm, circle), [0.9, 0.1], duration=0.05)
    page = html.document_fromstring(report(run, tmp_path / "r.html", command="make <it>").read_text(encoding="utf-8"))
    said = {row.find("th").text.strip(): row.find("td").text for row in page.xpath("//table[@id='versions']//tr")}
    assert said == run.config["versions"]
    assert page.xpath("//pre[@id='made-by']")[0].text == "make <it>"
