"""Scenarios of one's own: what they mean where little is said, and what they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from sliding_arm import sliding_arm

import pathcontrol as pc
from pathcontrol.comparison.comparison_table import tabulate

PUSH = pc.Push([0.0, 30.0], start=0.5, duration=0.2)


def scenario(**changes):
    arm = pc.load_robot("cicese_2dof")
    given = {"name": "mine", "sentence": "A push.", "robot": arm, "task": pc.Circle(1.0, 2.0), "q": [1.0, 0.0]}
    return pc.Scenario(**given | {"duration": 0.9} | changes)


def test_a_disturbance_or_an_operator_is_the_event_and_is_not_in_the_undisturbed_run():
    pushed, held = scenario(disturbance=PUSH), scenario(override=[[0.5, 0.0], [0.7, 1.0]])
    for one in (pushed, held):
        assert one.event == pytest.approx((0.5, 0.7))
        assert (one.calm.disturbance, one.calm.override) == (None, None)
    said = scenario(disturbance=PUSH, event=one.event, undisturbed=scenario())
    short, long = (pc.compare("projection", one, rollouts=2, progress=False) for one in (pushed, said))
    for name, values in short.measures["projection"].items():
        assert_array_equal(values, long.measures["projection"][name])
    assert abs(short.mean("projection", "time_lost_s")) > 1e-4
    assert scenario().event is None
    assert scenario(override=[[0.5, 1.0]]).event is None  # as fast as without it
    assert scenario(disturbance=pc.Harmonic([1.0, 0.0], 1.0)).event is None


def test_an_event_that_was_not_given_is_found_anew_where_a_scenario_is_changed():
    earlier = pc.Push([0.0, 30.0], start=0.2, duration=0.1)
    pushed = scenario(disturbance=PUSH)
    assert replace(pushed, disturbance=earlier).event == pytest.approx((0.2, 0.3))
    assert replace(pushed, disturbance=None).event is None
    assert replace(scenario(disturbance=PUSH, event=(0.4, 0.8)), disturbance=earlier).event == (0.4, 0.8)
    jammed = replace(pc.make_scenario("jammed-joint"), task=pc.Circle(0.8, 2.0))
    assert jammed.calm.task is jammed.task


def test_gains_are_a_table_or_one_after_another():
    one = scenario(gains={"K_p": 100.0, "K_v": [20.0, 30.0]})
    assert one.gains == scenario(gains=(100.0, [20.0, 30.0])).gains == scenario(gains=one.gains).gains
    made = pc.compare("computed_torque", replace(one, duration=0.1), rollouts=1, progress=False)
    assert_array_equal(np.broadcast_to(made.laws["computed_torque"].K_p, 2), 100.0)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("robot", "ur5", r"load_robot\('ur5'\) gives one"),
        ("task", 3, "expected a PathTask"),
        ("q", [1.0, 0.0, 0.0], r"shape \(3,\)"),
        ("q", [1.0, np.nan], "finite"),
        ("duration", -1.0, "greater than 0"),
        ("loop", "sampled", "SampledLoop"),
        ("disturbance", "jam", "expected a Disturbance"),
        ("event", 5, "begin and end"),
        ("event", (1,), "begin and end"),
        ("event", (np.nan, 1.0), "begin and end"),
        (
            "disturbance",
            pc.Push([0.0, 30.0], start=1.0, duration=0.5),
            r"event = \(1\.0, 1\.5\).* in the run of 0\.9 s",
        ),
        ("gains", 800.0, "K_p, K_v"),
        ("gains", {"Kp": 800.0}, "K_p, K_v"),
        ("engine", "fast", "compiled"),
        ("undisturbed", "calm", "load_scenario"),
        ("laws", ["projection"], "Mapping"),
        ("pattern", 3, "expected a Controller"),
    ],
)
def test_what_is_no_part_of_a_scenario_is_refused_by_its_name(name, value, said):
    with pytest.raises(pc.PathControlError, match=said) as raised:
        scenario(**{name: value})
    assert name in str(raised.value)


def test_what_is_no_scenario_no_plant_and_no_measure_is_told(tmp_path):
    with pytest.raises(pc.InputError, match=r"load_scenario\('.*mine.toml'\)"):
        pc.compare(None, tmp_path / "mine.toml")
    with pytest.raises(pc.UnknownNameError, match="expected one of undisturbed"):
        pc.make_scenario(None)
    with pytest.raises(pc.InputError, match="plant = 3"):
        pc.compare("projection", scenario(plant=3))
    compared = pc.compare("projection", scenario(duration=0.05), rollouts=1, progress=False)
    for law, measure in (("plan", "contour_peak"), ("projection", "contour")):
        for ask in (compared.mean, compared.spread):
            with pytest.raises(pc.UnknownNameError, match="expected one of"):
                ask(law, measure)


def test_units_are_those_of_the_joints():
    """Joints that slide have metres, which are read in millimetres, and forces."""
    arm = sliding_arm()
    slides = scenario(robot=arm, task=pc.Circle(0.3, 0.6), q=[0.35, 0.0], duration=0.2, gains=(400.0, 40.0))
    compared = pc.compare("computed_torque", slides, rollouts=1, progress=False)
    assert compared.units == compared.to_dict()["units"]
    assert [compared.units[name] for name in ("contour_rms", "lag_peak", "speed_peak", "torque_peak", "energy_j")] == [
        *("m", "m", "m/s", "N", "J")
    ]
    rows = {row[0]: float(row[1]) for row in tabulate(compared)[1:] if row[1] != "–"}
    assert rows["contour peak [mm]"] == pytest.approx(1e3 * compared.mean("computed_torque", "contour_peak"), rel=0.01)
    assert rows["speed peak [mm/s]"] == pytest.approx(1e3 * compared.mean("computed_torque", "speed_peak"), rel=0.01)
    assert "torque peak [N]" in rows
    turning = pc.compare("projection", scenario(duration=0.1), rollouts=1, progress=False)
    assert turning.units["contour_peak"] == "rad"
