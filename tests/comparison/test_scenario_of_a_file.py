"""What wraps the law of an experiment file, in a comparison of laws on it."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc

FILE = """
duration = 1.6
robot.source = "cicese_2dof"
task = {{ type = "circle", radius = 1.0, speed = 2.0 }}
loop = {{ torque_limits = true }}
start.q = [1.0, 0.0]
{more}
[controller]
{wrapper}
[controller.law]
type = "projection"
k_p = 800.0
K_v = [45.0, 100.0]
"""
STEPS = 'type = "speed_override"\noverride = [[0.2, 0.0], [0.8, 1.0]]\nacceleration = 5.0'
PUSH = 'disturbance = { type = "push", magnitude = [1.0, 0.0], start = 0.6, duration = 0.6 }'
HARMONIC = 'disturbance = { type = "harmonic", amplitude = [1.0, 0.0], frequency = 1.0 }'


def load(tmp_path, wrapper=STEPS, more=""):
    path = tmp_path / "mine.toml"
    path.write_text(FILE.format(wrapper=wrapper, more=more), encoding="utf-8")
    return pc.load_scenario(path)


def test_all_laws_are_overridden_as_the_law_of_the_file(tmp_path):
    scenario = load(tmp_path)
    assert scenario.event == (0.2, 0.8)
    assert "SpeedOverride" in scenario.sentence
    compared = pc.compare(["computed_torque", "projection"], scenario, rollouts=1, progress=False)
    for law in compared.measures:
        assert 0.3 < compared.mean(law, "time_lost_s") < 0.65
        described = compared.runs[law].config["controller"]
        assert (described["override"], described["acceleration"]) == ([[0.2, 0.0], [0.8, 1.0]], 5.0)
    run, _, _ = pc.run_experiment(tmp_path / "mine.toml", tmp_path / "out", progress=False)
    by_file = pc.speed_factor(run)
    np.testing.assert_array_equal(pc.speed_factor(compared.runs["projection"])[:, : by_file.shape[1]], by_file)


@pytest.mark.parametrize(
    ("override", "more", "event"),
    [
        ("0.5", "", None),
        ("[0.5]", "", None),
        ("0.5", PUSH, (0.6, 1.6)),
        ("[[0.2, 0.0], [0.8, 1.0]]", PUSH, (0.2, 1.2)),
        ("[[0.2, 0.0], [0.8, 1.0]]", HARMONIC, (0.2, 1.6)),
        ("[[0.1, 1.0], [0.3, 0.5]]", "", (0.3, 1.6)),
    ],
)
def test_an_event_lasts_as_long_as_override_and_disturbances_act(tmp_path, override, more, event):
    scenario = load(tmp_path, f'type = "speed_override"\noverride = {override}', more)
    assert scenario.event == (None if event is None else pytest.approx(event))
    assert scenario.undisturbed.override is None
    assert scenario.undisturbed.disturbance is None
    assert scenario.override is not None


@pytest.mark.parametrize("override", ["1.0", "[[0.5, 1.0]]"])
def test_an_override_that_changes_nothing_is_none(tmp_path, override):
    scenario = load(tmp_path, f'type = "speed_override"\noverride = {override}')
    assert (scenario.override, scenario.event, scenario.undisturbed) == (None, None, None)


@pytest.mark.parametrize(
    ("wrapper", "name"),
    [('type = "paced"', "Paced"), ('type = "event_plan"', "EventPlan"), ('type = "learned"', "Learned")],
)
def test_wrappers_that_the_laws_do_not_have_are_told(tmp_path, wrapper, name):
    with pytest.warns(pc.PathControlWarning, match=f"is {name}, which is no part"):
        assert load(tmp_path, wrapper).override is None
    inside = f"{wrapper}\n[controller.law]\n{STEPS}\n[controller.law.law]\n#"
    text = FILE.format(wrapper=inside, more="").replace("#\n[controller.law]\n", "")
    (tmp_path / "inside.toml").write_text(text, encoding="utf-8")
    with pytest.warns(pc.PathControlWarning, match=f"is {name}, which is no part"):
        assert pc.load_scenario(tmp_path / "inside.toml").override == [[0.2, 0.0], [0.8, 1.0]]


def test_two_overrides_are_refused(tmp_path):
    text = FILE.format(wrapper=f"{STEPS}\n[controller.law]\n{STEPS}\n[controller.law.law]\n#", more="")
    path = tmp_path / "twice.toml"
    path.write_text(text.replace("#\n[controller.law]\n", ""), encoding="utf-8")
    with pytest.raises(pc.ExperimentError, match="two speed overrides"):
        pc.load_scenario(path)
