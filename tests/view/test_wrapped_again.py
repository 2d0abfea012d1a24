"""The script of a report makes runs of wrapped laws again, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.view.report.reproduction import recipe
from pathcontrol.view.report.settings_table import settings

GAINS = (800.0, [45.0, 100.0])
STEPS = [[0.02, 0.3], [0.05, -0.5]]
WRAPPED = {
    "number": lambda law: pc.SpeedOverride(law, 0.5, acceleration=3.0),
    "rows": lambda law: pc.SpeedOverride(law, [0.5, 1.5]),
    "steps": lambda law: pc.SpeedOverride(law, STEPS),
    "paced": lambda law: pc.Paced(law, 0.2),
    "limits": lambda law: pc.Paced(law, torque_limits=[100.0, np.inf]),
    "event": lambda law: pc.EventPlan(law, [9.0, 1.0], acceleration=7.0, observer_hz=[33.3, 7.0]),
    "learned": lambda law: pc.Learned(law, learning_gain=0.7, nodes=32),
    "nested": lambda law: pc.Paced(pc.EventPlan(pc.SpeedOverride(law, STEPS, acceleration=3.0), 5.0), 0.05),
    "other way round": lambda law: pc.SpeedOverride(pc.EventPlan(pc.Learned(pc.Paced(law)), acceleration=4.0), 0.9),
}
LOOP = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True)
NO_SCRIPT = {
    "function": lambda law: pc.SpeedOverride(law, lambda t: 0.5),
    "function inside": lambda law: pc.Paced(pc.SpeedOverride(law, np.cos)),
    "long steps": lambda law: pc.SpeedOverride(law, np.stack([np.arange(40.0), np.full(40, 0.5)], axis=1)),
}


def plan(arm, circle, friction="viscous", **options):
    return pc.ExtendedMotionPlan(arm, circle, *GAINS, k=20.0, friction=friction, **options)


def made_again(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run.save("mine.nc")
    found = recipe("mine", run)
    assert found.kind == "python"
    namespace = {}
    exec(found.text, namespace)
    return namespace["run"]


def simulated(law):
    return pc.simulate(law, [[0.7, 1.2], [1.0, 0.1]], [0.1, 0.2], duration=0.1, loop=LOOP, progress=False)


def assert_same(run, again):
    assert again.config == run.config
    for name in run.data.data_vars:
        np.testing.assert_array_equal(again.array(name), run.array(name), err_msg=name)


@pytest.mark.parametrize("name", WRAPPED)
def test_the_script_gives_the_same_bits(name, arm, circle, tmp_path, monkeypatch):
    run = simulated(WRAPPED[name](plan(arm, circle)))
    assert_same(run, made_again(run, tmp_path, monkeypatch))


def test_a_law_with_an_observer_of_its_own_keeps_it(arm, circle, tmp_path, monkeypatch):
    run = simulated(pc.EventPlan(plan(arm, circle, "observed", observer_hz=17.0), observer_hz=40.0))
    assert run.config["controller"]["observer_hz"] == 17.0
    assert_same(run, made_again(run, tmp_path, monkeypatch))


def test_the_script_of_a_sequence_of_wrapped_laws(arm, tmp_path, monkeypatch):
    lines = [pc.Line([0.0, 0.0], [0.05, 0.1], 1.0), pc.Line([0.05, 0.1], [0.1, 0.0], 1.0)]
    laws = [pc.Paced(pc.SpeedOverride(plan(arm, line, "full"), 0.8)) for line in lines]
    run = pc.simulate_sequence(laws, [0.0, 0.0], duration=1.0, progress=False)
    assert_same(run, made_again(run, tmp_path, monkeypatch))


@pytest.mark.parametrize("name", NO_SCRIPT)
def test_what_the_record_does_not_hold_is_in_no_script(name, arm, circle):
    assert recipe("mine", simulated(NO_SCRIPT[name](plan(arm, circle)))).kind == "none"


@pytest.mark.parametrize("press", ["hold", "reverse", "slow"])
def test_a_plan_whose_buttons_were_pressed_has_no_script(press, arm, circle):
    law = pc.Paced(plan(arm, circle))
    {"hold": law.hold, "reverse": law.reverse, "slow": lambda: law.override(0.5)}[press]()
    run = pc.simulate(law, [1.0, 0.0], duration=0.02, loop=LOOP, progress=False)
    assert recipe("mine", run).kind == "none"


def test_a_law_of_ones_own_in_a_wrapper_has_no_script(arm, circle):
    class Mine(pc.Projection):
        pass

    assert recipe("mine", simulated(pc.Paced(Mine(arm, circle, *GAINS)))).kind == "none"


def test_settings_of_wrappers_that_are_called_the_same_are_both_told(arm, circle):
    (controller,) = (one for one in settings([simulated(WRAPPED["nested"](plan(arm, circle))).config])[:1])
    said = {setting.name: setting.values[0] for setting in controller.settings}
    assert said["controller"] == "Paced(EventPlan(SpeedOverride(ExtendedMotionPlan)))"
    assert said["wrappers · SpeedOverride · acceleration"] == "3"
    assert said["wrappers · EventPlan · acceleration"] == "10"
    assert said["k"] == "20"
