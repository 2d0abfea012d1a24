"""What an experiment file says of its law beside the gains, in a comparison of laws on it."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.comparison.family import FAMILY
from pathcontrol.comparison.laws import KNOWN_LAWS, make_laws
from pathcontrol.control.reference_law import ReferenceLaw
from pathcontrol.control.wrappers.wrapper import unwrap

ALL = [*KNOWN_LAWS, *FAMILY, "event_plan", "paced_projection"]
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
    assert scenario.calm.override is None
    assert scenario.calm.disturbance is None
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


# --- what all laws have from the law of the file ----------------------------------------------------------------


def law_of(text, **changes):
    """The line of a table of TOML that is ``[controller]``, of projection unless told otherwise."""
    table = text or {"type": "projection", "k_p": 800.0, "K_v": [45.0, 100.0]} | changes
    return "controller = { " + ", ".join(f"{key} = {value!r}" for key, value in table.items()) + " }"


def load_law(tmp_path, task='{ type = "circle", radius = 1.0, speed = 2.0 }', more="", text=None, **changes):
    path = tmp_path / "mine.toml"
    lines = ["duration = 1.6", 'robot.source = "cicese_2dof"', f"task = {task}", more, law_of(text, **changes)]
    path.write_text("\n".join(lines), encoding="utf-8")
    return pc.load_scenario(path)


def laws_of(scenario, laws):
    arguments = (scenario.robot, scenario.task, scenario.gains, scenario.laws, scenario.pattern)
    return make_laws(laws, *arguments)


@pytest.mark.parametrize("friction", ["none", "viscous", "full", "observed"])
def test_all_laws_compensate_the_friction_that_the_law_of_the_file_does(tmp_path, friction):
    more = {"observer_hz": [20.0, 30.0]} if friction == "observed" else {}
    scenario = load_law(tmp_path, friction=friction, **more)
    for law in laws_of(scenario, ALL).values():
        assert law.friction == friction
        np.testing.assert_array_equal(law.observer_hz, more.get("observer_hz"))
    assert (f"friction = {friction!r}" in scenario.sentence) == (friction != "viscous")


def test_a_comparison_of_the_law_of_a_file_is_its_run(tmp_path):
    scenario = load_law(tmp_path, more="start.q = [0.9, 0.1]", friction="full", branch="local", start="nearest")
    compared = pc.compare("projection", scenario, rollouts=1, progress=False)
    run, _, _ = pc.run_experiment(tmp_path / "mine.toml", tmp_path / "out", progress=False)
    np.testing.assert_array_equal(run.array("q"), compared.runs["projection"].array("q"))


@pytest.mark.parametrize(
    "text",
    [
        {"type": "projection", "k_p": 800.0, "K_v": 57.0, "branch": "local", "capture": 0.3},
        {"type": "slotine_li", "Lambda": 40.0, "K_d": [9.0, 1.0]},  # Λ is the larger root
        {"type": "adaptive_slotine_li", "Lambda": 20.0, "K_d": 9.0, "adaptation": 0.02, "k": 3.0},
        {"type": "passive_velocity_field", "Lambda": 20.0, "K_v": 40.0, "recharge": 3.0, "energy": 40.0},
        {"type": "transverse_linearization", "k_p": 800.0, "k_v": 57.0, "k_s": 9.0},
    ],
)
def test_the_law_of_the_file_is_compared_as_it_is_beside_the_known_ones(tmp_path, text):
    scenario = load_law(tmp_path, text=text)
    for laws in (None, "all"):
        made = laws_of(scenario, laws)
        assert {*KNOWN_LAWS, text["type"]} <= set(made)
        kept = scenario.pattern.describe() | {"start": "nearest"}
        assert made[text["type"]].describe() == kept


def test_laws_that_are_named_with_a_wrapper_of_the_file_have_its_settings(tmp_path):
    for wrapper, name in (("paced", "paced_extended_motion_plan"), ("event_plan", "event_plan")):
        setting = "torque_margin = 0.3" if wrapper == "paced" else "pause = 0.7"
        with pytest.warns(pc.PathControlWarning, match="no part"):
            scenario = load(tmp_path, f'type = "{wrapper}"\n{setting}')
        law = laws_of(scenario, name)[name]
        assert law.arguments() == scenario.pattern.arguments()
        assert isinstance(law.inner, pc.ExtendedMotionPlan)


def test_on_an_open_path_all_laws_begin_where_the_law_of_the_file_does(tmp_path):
    line = '{ type = "line", start = [0.2, 0.0], end = [1.2, 0.5], speed = 1.0 }'
    for start in ("s0", "nearest"):
        scenario = load_law(tmp_path, task=line, start=start)
        q = scenario.task.q_d(np.array(0.4 * scenario.task.s_end))
        for law in laws_of(scenario, ALL).values():
            s = law.start(q, np.zeros(2))[0]
            assert law.start_at == start
            if not isinstance(unwrap(law), ReferenceLaw):  # their s is a function of the posture, whatever the start
                assert s == pytest.approx(0.0 if start == "s0" else 0.4 * scenario.task.s_end, abs=1e-6)


def test_a_start_that_the_laws_of_a_comparison_do_not_have_is_told(tmp_path, recwarn):
    for said in ({}, {"start": "nearest"}):
        load_law(tmp_path, **said)
    assert not recwarn.list
    with pytest.warns(pc.PathControlWarning, match="all begin at the point nearest"):
        scenario = load_law(tmp_path, start="s0")
    assert {law.start_at for law in laws_of(scenario, ALL).values()} == {"nearest"}
    with pytest.warns(pc.PathControlWarning, match="begin at rest"):
        load_law(tmp_path, more="start.qd = [0.0, 1.0]")
