"""Laws in one scenario: gains that mean the same, the same starts and seeds, and what is known of jams."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc
from pathcontrol.comparison.family import FAMILY
from pathcontrol.comparison.laws import KNOWN_LAWS, Gains, make_laws, recover_gains, split_damping
from pathcontrol.comparison.measures import MEASURES

MOTION, PATH = KNOWN_LAWS[:3], KNOWN_LAWS[3:]


class Mine(pc.ComputedTorque):
    """Computed torque under another name."""


class Near(pc.ComputedTorque):
    """Computed torque that begins near the arm by itself."""

    def start(self, q, qd):
        return self.task.sigma_bar(q)[..., None]


@pytest.fixture(scope="module")
def jam():
    return pc.compare(None, "jammed-joint", progress=False)


def compared(*names, scenario="jammed-joint", **options):
    return pc.compare(list(names), scenario, progress=False, **options)


def shortened(name):
    """A scenario of the library until half a second after its event, and of one without any for 0.7 s."""
    whole = pc.make_scenario(name)
    duration = 0.7 if whole.event is None else whole.event[1] + 0.5
    calm = whole.undisturbed
    return replace(whole, duration=duration, undisturbed=None if calm is None else replace(calm, duration=duration))


# --- gains that mean the same -----------------------------------------------------------------------------------


@given(st.floats(1.0, 1e4), st.floats(1.0, 1e3))
def test_slotine_and_li_have_the_same_stiffness_and_the_same_damping_where_they_can(K_p, K_v):
    Lambda, D = split_damping(np.array([K_p]), np.array([K_v]))
    assert_allclose(Lambda * D, K_p, rtol=1e-9)
    assert_allclose(Lambda + D, max(K_v, 2 * np.sqrt(K_p)), rtol=1e-7)


def test_tracking_laws_are_one_law_on_an_arm_of_one_joint(arm):
    """Its M is constant and its C is zero, so that equal gains must give equal motions."""
    one = arm.reduced({arm.joint_names[1]: 0.3})
    task = pc.Line([0.2], [1.2], 1.0)
    start = task.q_d(np.array(0.0)) + 0.1
    laws = make_laws(MOTION, one, task, Gains(100.0, 25.0))
    runs = [pc.simulate(law, start, duration=1.0, progress=False).array("q") for law in laws.values()]
    assert np.abs(runs[0] - task.q_d(runs[0][..., 0])).max() > 0.01
    for other in runs[1:]:
        assert_allclose(other, runs[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", [*KNOWN_LAWS, *FAMILY])
def test_gains_come_back_from_a_law(arm, circle, name):
    law = make_laws(name, arm, circle, Gains(300.0, [45.0, 100.0], 7.0))[name]
    gains = recover_gains(law)
    assert_allclose(np.broadcast_to(gains.K_p, 2), 300.0)
    of_each = np.size(gains.K_v) > 1
    assert_allclose(gains.K_v, [45.0, 100.0] if of_each else 72.5)  # the mean, for a law with one gain for all joints


def test_the_plan_has_the_rate_of_the_papers_on_any_path(arm):
    for radius in (0.1, 1.0):
        task = pc.Circle(radius, 0.5)
        law = make_laws("extended_motion_plan", arm, task, Gains())["extended_motion_plan"]
        assert_allclose(law.k * radius**2, 20.0)


# --- the same for all -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scenario", ["jammed-joint", "noisy-loop"])
def test_a_rollout_has_the_same_numbers_alone_and_among_others(scenario):
    few, many = (compared("projection", "pd_plus", scenario=scenario, rollouts=n) for n in (2, 5))
    for law in few.measures:
        for name in MEASURES:
            assert_array_equal(few.measures[law][name], many.measures[law][name][:2])


def test_the_same_seed_gives_the_same_numbers_and_another_one_others():
    one, again, other = (compared("projection", rollouts=3, seed=seed) for seed in (4, 4, 5))
    peaks = [run.measures["projection"]["contour_peak"] for run in (one, again, other)]
    assert_array_equal(peaks[0], peaks[1])
    assert peaks[0][0] == peaks[2][0]  # the start of the scenario
    assert (peaks[0][1:] != peaks[2][1:]).all()


def test_all_laws_begin_at_the_same_postures_near_the_path(jam):
    starts = [run.array("q")[:, 0] for run in jam.runs.values()]
    for other in starts[1:]:
        assert_array_equal(starts[0], other)
    distance = np.abs(np.linalg.norm(starts[0][1:], axis=-1) - 1.0)
    assert distance.max() < 0.25
    around = np.sort(np.arctan2(starts[0][1:, 1], starts[0][1:, 0]))
    assert np.diff(around, append=around[0] + 2 * np.pi).max() < 1.0  # all around


# --- what is known ----------------------------------------------------------------------------------------------


def test_in_a_jam_motion_control_cuts_the_corner_and_path_control_loses_time(jam):
    mean = {law: {name: jam.mean(law, name) for name in MEASURES} for law in jam.measures}
    for path in PATH:
        assert mean["computed_torque"]["contour_peak"] > 2.5 * mean[path]["contour_peak"]
        assert mean["computed_torque"]["speed_peak"] > 2.2 * mean[path]["speed_peak"]
        assert mean["computed_torque"]["recovery_s"] > 2.5 * mean[path]["recovery_s"]
        assert 0.2 < mean[path]["time_lost_s"] < 0.7  # of the 0.6 s in which the joint was held
    for motion in MOTION:
        assert mean[motion]["time_lost_s"] == pytest.approx(0.0, abs=1e-9)
    assert mean["projection"]["lag_peak"] < 1e-12


def test_without_a_disturbance_motion_control_is_as_good(arm):
    calm = compared("pd_plus", "extended_motion_plan", scenario="undisturbed", rollouts=2)
    assert calm.best("contour_peak") == ["pd_plus"]
    assert calm.runs == calm.undisturbed
    assert np.isnan(calm.mean("pd_plus", "recovery_s"))


def test_motors_that_lose_torque_are_at_the_limits_that_are_left(arm):
    """A tenth of its limit does not carry the arm: some joint is at it for nearly all of the drop."""
    calm = replace(pc.make_scenario("undisturbed"), duration=0.8)
    drop = pc.TorqueLimitDrop(0.1, start=0.4, duration=0.3)
    scenario = replace(calm, disturbance=drop, event=(0.4, 0.7), undisturbed=calm)
    weak = compared("projection", scenario=scenario, rollouts=2)
    tau, time = weak.runs["projection"].array("tau"), weak.runs["projection"].time
    share = np.where((time >= 0.4 - 1e-9) & (time < 0.7 - 1e-9), 0.1, 1.0)[:, None]
    counted = (np.abs(tau) >= (1 - 1e-9) * share * arm.limits.effort).any(-1)[:, time >= 0.4 - 1e-9]
    assert_allclose(weak.measures["projection"]["saturated_s"], 2.5e-3 * counted[:, :-1].sum(-1), atol=1e-9)
    assert weak.mean("projection", "saturated_s") > 0.2


def test_motors_that_are_too_weak_saturate_and_the_same_ones_without_limits_do_not(arm):
    weak = compared("computed_torque", "projection", scenario="weak-motors", rollouts=1)
    assert weak.mean("computed_torque", "torque_peak") == pytest.approx(arm.limits.effort.max())
    assert weak.mean("projection", "time_lost_s") > 1.0
    assert weak.mean("computed_torque", "contour_peak") > 3 * weak.mean("projection", "contour_peak")


def test_at_a_wall_a_plan_with_a_small_k_is_no_better_than_computed_torque():
    wall = pc.compare(None, "wall", rollouts=4, progress=False)
    contour = {law: wall.mean(law, "contour_peak") for law in wall.measures}
    assert set(contour) == {*KNOWN_LAWS, "plan_small_k"}
    assert contour["plan_small_k"] == pytest.approx(contour["computed_torque"], rel=0.1)
    assert contour["extended_motion_plan"] < 0.4 * contour["computed_torque"]
    assert contour["projection"] < 0.3 * contour["computed_torque"]
    run = wall.runs["projection"]
    tool = wall.scenario.robot.frame_pose(run.array("q"), "tool")[..., 0, 3]
    stands = (run.time >= 4.0) & (run.time <= 7.2)
    outside = tool[:, stands][:, 0] <= 0.7  # one that the wall comes around can only go out
    assert outside.sum() >= 2
    assert tool[outside][:, stands].max() < 0.7 + 1e-4
    assert list(pc.compare("plan_small_k", "wall", rollouts=1, progress=False).measures) == ["plan_small_k"]
    with pytest.raises(pc.UnknownNameError, match="plan_small_k"):
        pc.compare("plan_smal_k", "wall")
    with pytest.raises(pc.UnknownNameError):
        pc.compare("plan_small_k", "undisturbed")


def test_without_measurements_path_laws_wait_or_stay_and_motion_control_is_carried_away():
    lost = pc.compare(None, "dropout", rollouts=4, progress=False)
    contour = {law: lost.mean(law, "contour_peak") for law in lost.measures}
    assert contour["computed_torque"] > 2 * contour["extended_motion_plan"]
    assert contour["extended_motion_plan"] > contour["projection"]
    assert lost.mean("projection", "speed_peak") < 0.5 * lost.mean("extended_motion_plan", "speed_peak")


def test_all_laws_are_compared_where_all_are_asked_for():
    every = pc.compare("all", shortened("undisturbed"), rollouts=1, progress=False)
    assert list(every.measures) == [*KNOWN_LAWS, *FAMILY]
    for law in every.measures:
        assert every.mean(law, "contour_peak") < np.deg2rad(3)


def test_all_laws_may_be_named_beside_others(arm, circle):
    made = make_laws(["event_plan", "all", "projection"], arm, circle, Gains(), {"mine": "projection"})
    assert sorted(made) == sorted({"event_plan", *KNOWN_LAWS, *FAMILY, "mine"})


# --- laws and scenarios of one's own ------------------------------------------------------------------------------


def test_laws_of_ones_own_are_objects_or_functions():
    scenario = shortened("undisturbed")
    law = Mine(scenario.robot, scenario.task, 800.0, [45.0, 100.0], start="nearest")
    both = pc.compare({"a": law, "b": lambda *of: Mine(*of, 800.0, 50.0, start="nearest")}, scenario, rollouts=1)
    theirs = compared("computed_torque", scenario=scenario, rollouts=1)
    assert both.mean("a", "contour_peak") == pytest.approx(theirs.mean("computed_torque", "contour_peak"))
    assert list(pc.compare(law, scenario, rollouts=1).measures) == ["Mine"]
    assert both.mean("b", "contour_peak") != both.mean("a", "contour_peak")


def test_a_law_that_begins_elsewhere_than_the_known_ones_is_told(arm, recwarn):
    scenario = replace(shortened("undisturbed"), duration=0.05)
    there, here = (
        Mine(scenario.robot, scenario.task, 800.0, [45.0, 100.0], start=start) for start in ("s0", "nearest")
    )
    follows = pc.Projection(scenario.robot, scenario.task, 800.0, [45.0, 100.0])
    line = pc.Line([0.2, 0.1], [1.0, 1.2], 0.8)
    opened = pc.Scenario("line", "A line.", arm, line, [0.2, 0.1], 0.05)
    near = Near(scenario.robot, scenario.task, 800.0, [45.0, 100.0])
    pc.compare({"here": here, "mine": follows, "known": "pd_plus", "near": near}, scenario, rollouts=1, progress=False)
    pc.compare({"open": Mine(arm, line, 800.0, 50.0)}, opened, rollouts=1, progress=False)
    pc.compare(there, replace(scenario, q=scenario.task.q_d(np.array(0.0))), rollouts=1, progress=False)
    assert not recwarn.list
    with pytest.warns(pc.PathControlWarning, match=r"'there', 'paced' of .* start='nearest'"):
        pc.compare({"there": there, "paced": pc.Paced(there), "here": here}, scenario, rollouts=1, progress=False)


def test_the_undisturbed_run_lasts_as_long_whatever_its_scenario_says():
    scenario = shortened("jammed-joint")
    longer = replace(scenario, undisturbed=pc.make_scenario("undisturbed"))
    same, other = (compared("projection", scenario=one, rollouts=1) for one in (scenario, longer))
    assert same.measures["projection"] == other.measures["projection"]
    assert len(other.undisturbed["projection"].time) == len(other.runs["projection"].time)


def test_an_open_path_in_a_scenario_of_ones_own(arm):
    line = pc.Line([0.2, 0.1], [1.0, 1.2], 0.8)
    push = pc.Push([0.0, 10.0], start=0.5, duration=0.3)
    calm = pc.Scenario("line", "A line.", arm, line, line.q_d(np.array(0.0)), 4.0)
    pushed = pc.Scenario(
        "line", "A push.", arm, line, calm.q, 4.0, disturbance=push, event=(0.5, 0.8), undisturbed=calm
    )
    result = pc.compare(None, pushed, rollouts=3, progress=False)
    assert (result.runs["projection"].status == "finished").all()
    for law in result.measures:
        assert np.isfinite(result.measures[law]["time_lost_s"]).all()
    assert calm.window == (0.0, 4.0)


@pytest.mark.parametrize(
    ("laws", "said"),
    [
        (["projection", "projection"], "two laws are called 'projection'; name it once"),
        (["all", "projektion"], "did you mean 'projection'"),
        ([], "no law to compare"),
        ("projektion", "did you mean 'projection'"),
        (3, "laws = 3"),
        ([None], "expected a Controller"),
        (pc.Projection, r"Projection\(robot, task\) makes no law: .*k_p.*; give a law, or a function"),
        (lambda robot, task: pc.Projection, "laws is the class Projection"),
    ],
)
def test_laws_that_are_none(laws, said):
    with pytest.raises((pc.InputError, pc.UnknownNameError), match=said):
        pc.compare(laws, "undisturbed")


def test_what_does_not_fit_is_refused(arm, circle):
    with pytest.raises(pc.UnknownNameError, match="jammed-joint"):
        pc.compare(None, "jammed")
    with pytest.raises(pc.UnknownNameError, match="load_scenario"):
        pc.compare(None, "mine.toml")
    with pytest.raises(pc.InputError, match="another task"):
        pc.compare(pc.Projection(arm, pc.Circle(1.0, 1.0), 800.0, 45.0), "undisturbed")
    with pytest.raises(pc.InputError, match="rollouts"):
        pc.compare(None, "undisturbed", rollouts=0)
    with pytest.raises(pc.InputError, match="event"):
        pc.Scenario("late", "Too late.", arm, circle, np.zeros(2), 1.0, event=(2.0, 3.0))
    with pytest.raises(pc.InputError, match=r"samples each 0\.0025 s and loop each 0\.001 s"):
        replace(pc.make_scenario("payload"), loop=pc.SampledLoop(1e-3))
    with pytest.raises(pc.InputError, match="expected a Scenario"):
        pc.compare(None, 7)


def test_a_law_that_diverges_before_the_event_has_no_numbers_beside_one_that_has():
    unlimited = replace(pc.make_scenario("undisturbed"), duration=0.6, event=(0.5, 0.6), loop=pc.SampledLoop(0.01))
    laws = {"wild": lambda arm, task: pc.Projection(arm, task, 1e6, 2e3), "mine": "projection"}
    with pytest.warns(pc.PathControlWarning, match="unstable"):
        numbers = pc.compare(laws, unlimited, rollouts=1, progress=False).to_dict()["controllers"]
    assert numbers["wild"]["diverged"] == 1
    assert all(numbers["wild"][name] is None for name in MEASURES)
    assert numbers["mine"]["contour_peak"] > 0


def test_json_has_the_keys_in_si_units_for_every_scenario():
    for name in pc.known_scenarios():
        result = compared("computed_torque", "projection", scenario=shortened(name), rollouts=1)
        said = json.loads(json.dumps(result.to_dict(), allow_nan=False))
        assert list(said["controllers"]) == ["computed_torque", "projection"]
        for numbers in said["controllers"].values():
            assert set(MEASURES) <= set(numbers)
            assert all(numbers[key] is None or isinstance(numbers[key], float) for key in MEASURES)
            assert set(numbers["spread"]) == set(numbers["rollouts"]) == set(MEASURES)


def test_an_event_plan_is_compared_where_it_is_named():
    scenario = shortened("jammed-joint")
    said = compared("extended_motion_plan", "event_plan", scenario=scenario, rollouts=1).to_dict()["controllers"]
    assert list(said) == ["extended_motion_plan", "event_plan"]
    assert said["event_plan"]["contour_peak"] < 0.5 * said["extended_motion_plan"]["contour_peak"]
    assert "event_plan" not in KNOWN_LAWS


def test_a_law_for_an_equal_task_is_one_for_the_scenario(arm, circle):
    """Two circles are the same where their paths, profiles and ends are."""
    scenario = shortened("undisturbed")
    equal = pc.Circle(scenario.task.radius, scenario.task.speed)
    again = pc.compare([pc.Projection(arm, equal, 800.0, 45.0)], scenario, rollouts=1, progress=False)
    assert again.laws["Projection"].task is not scenario.task
    for other in (pc.Circle(1.0, 2.1), pc.Circle(1.1, 2.0), pc.Line([1.0, 0.0], [0.0, 1.0], 2.0)):
        with pytest.raises(pc.InputError, match="another task"):
            pc.compare([pc.Projection(arm, other, 800.0, 45.0)], scenario, rollouts=1, progress=False)


# --- an operator, and weak motors -------------------------------------------------------------------------------


def test_in_the_scenario_of_a_hold_the_plans_stand_still_in_it_and_go_on():
    run = compared("extended_motion_plan", scenario="hold", rollouts=1).runs["extended_motion_plan"]
    w, (begin, end) = pc.speed_factor(run)[0], pc.make_scenario("hold").event
    assert np.abs(w[(run.time > begin + 1.0) & (run.time < end)]).max() < 1e-6
    assert w[run.time < begin] == pytest.approx(1.0)
    assert w[-1] == pytest.approx(1.0)


def test_a_held_plan_loses_the_time_it_is_held_and_stays_on_the_path():
    early = {"override": [[1.0, 0.0], [3.0, 1.0]], "event": (1.0, 3.0), "duration": 3.5}
    held = compared("computed_torque", "projection", scenario=replace(pc.make_scenario("hold"), **early), rollouts=1)
    for law in held.measures:
        assert 1.7 < held.mean(law, "time_lost_s") < 2.1  # of the 2 s
        calm = pc.contour_error(held.undisturbed[law]).max()
        assert held.measures[law]["contour_peak"].max() < 1.1 * calm


def test_paced_laws_stay_on_the_path_that_weak_motors_leave():
    scenario = replace(pc.make_scenario("weak-motors"), duration=3.0)
    weak = compared("projection", "paced_projection", scenario=scenario, rollouts=1)
    assert weak.mean("paced_projection", "contour_peak") < 0.25 * weak.mean("projection", "contour_peak")
    assert weak.mean("paced_projection", "time_lost_s") < 1.2 * weak.mean("projection", "time_lost_s")
    assert {"paced_projection", "paced_extended_motion_plan"} <= set(pc.make_scenario("weak-motors").laws)
