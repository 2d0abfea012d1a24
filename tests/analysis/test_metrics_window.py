"""From when the numbers of a run are, and what they say of arms that did not go along their path."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc
from pathcontrol.analysis.coverage import distance_to_trace, even_points, measure_coverage

START = [0.7, 1.2]
LOOP = pc.SampledLoop(noise=pc.SensorNoise(position=1e-5, seed=3), velocity="difference")


def a_law(robot, tasks, kind, friction):
    task = tasks[0] if len(tasks) == 1 else pc.TaskBatch(tasks)
    if kind == "plan":
        return pc.ExtendedMotionPlan(robot, task, 800.0, [45.0, 100.0], 20.0, friction=friction)
    return pc.Projection(robot, task, 800.0, [45.0, 100.0], friction=friction)


@settings(max_examples=4, deadline=None, derandomize=True)
@given(st.data())
def test_the_numbers_of_a_rollout_are_the_same_beside_any_others(arm, data):
    """Lines of any speed and length, finished or not, and windows of any kind: to the last bit."""
    one = st.tuples(st.floats(0.2, 3.0), st.floats(0.1, 1.0))
    tasks = [
        pc.Line(START, np.multiply(START, 1 - share), speed=speed)
        for speed, share in data.draw(st.lists(one, min_size=2, max_size=4))
    ]
    kind, friction = data.draw(st.sampled_from(["plan", "projection"])), data.draw(st.sampled_from(["viscous", "full"]))
    window = data.draw(st.sampled_from([None, "all", "second half", (0.1, 0.4), (0.6, 5.0)]))
    settings_ = {"duration": 1.5, "loop": LOOP, "progress": False}
    together = pc.metrics(pc.simulate(a_law(arm, tasks, kind, friction), START, **settings_), window=window)
    for i, task in enumerate(tasks):
        run = pc.simulate(a_law(arm, [task], kind, friction), START, first_rollout=i, **settings_)
        alone = pc.metrics(run, window=window)
        for name, values in together.items():
            assert_array_equal(values[i], alone.get(name, [np.nan])[0], err_msg=name)


@settings(max_examples=4, deadline=None, derandomize=True)
@given(speeds=st.lists(st.floats(0.5, 3.0), min_size=1, max_size=3))
def test_gains_and_mates_that_go_on_change_nothing(arm, speeds):
    line = pc.Line(START, [0.0, 0.0], speed=2.0)
    alone = pc.metrics(pc.simulate(a_law(arm, [line], "plan", "full"), START, duration=3.0, progress=False))
    slower = [pc.Line(START, [0.0, 0.0], speed=0.2 * v) for v in speeds]
    run = pc.simulate(a_law(arm, [line, *slower], "plan", "full"), START, duration=3.0, progress=False)
    assert {name: values[0] for name, values in pc.metrics(run).items()} == {n: v[0] for n, v in alone.items()}
    held = pc.simulate(a_law(arm, [line], "plan", "full"), START, duration=3.0, until="duration", progress=False)
    assert pc.metrics(held) == alone  # nor does it matter that the arm is held at the end


@settings(max_examples=4, deadline=None, derandomize=True)
@given(st.floats(0.2, 1.5), st.floats(0.3, 1.5))
def test_a_perfect_run_on_an_open_path_has_the_ratio_1_and_the_distance_0(ideal_arm, length, duration):
    line = pc.Line(START, np.subtract(START, length), speed=np.sqrt(2) * length / duration)
    qd = line.at(np.array(0.0)).velocity
    law = pc.ComputedTorque(ideal_arm, line, 800.0, [45.0, 100.0])
    loop = pc.ContinuousTime(output_period=5e-3, rtol=1e-9, atol=1e-11)
    run = pc.simulate(law, START, qd=qd, duration=20.0, loop=loop, progress=False)
    for window in (None, "all"):
        numbers = pc.metrics(run, window=window)
        assert numbers["speed_ratio"][0] == pytest.approx(1.0, abs=1e-12)
        assert numbers["gamma_distance_peak"][0] < 1e-8
        assert numbers["gamma_distance_rms"][0] < 1e-9
    assert numbers["coverage"] == [1.0]
    assert numbers["progress"] == [1.0]


def test_a_push_before_the_second_half_is_seen_in_a_window(arm, circle):
    push = pc.Push([60.0, 0.0], start=1.0, duration=0.1)
    law = pc.Projection(arm, circle, 800.0, [45.0, 100.0])
    run = pc.simulate(law, circle.q_d(np.array(0.0)), duration=4.0, disturbance=push, progress=False)
    error = pc.contour_error(run)[0]
    for window, inside in (((0.9, 1.5), (run.time > 0.899) & (run.time < 1.501)), ("all", run.time >= 0)):
        assert pc.metrics(run, window=window)["contour_error_peak"][0] == error[inside].max()
    assert pc.metrics(run, window="second half") == pc.metrics(run)
    for wrong in ((2.0, 1.0), "late", 3.0, (1.0, 2.0, 3.0), (5.0, 6.0)):
        with pytest.raises(pc.InputError, match="window"):
            pc.metrics(run, window=wrong)


def test_an_arm_that_never_moved_did_not_cover_its_path(arm):
    line = pc.Line(START, [0.55, 0.96], speed=0.05)
    still = pc.simulate(pc.Projection(arm, line, 800.0, [45.0, 100.0]), line.start, duration=3.0, progress=False)
    numbers = pc.metrics(still)
    assert numbers["contour_error_peak"][0] < 1e-12
    assert numbers["progress"][0] < 1e-6
    # what lies within two degrees of where it stands
    assert numbers["coverage"][0] == pytest.approx(np.deg2rad(2) / line.s_end, abs=2e-3)
    assert numbers["path_deviation_peak"][0] == pytest.approx(line.s_end, rel=1e-9)
    moved = pc.Projection(arm, line, 800.0, [45.0, 100.0], friction="full")
    numbers = pc.metrics(pc.simulate(moved, line.start, duration=10.0, progress=False))
    assert numbers["coverage"] == numbers["progress"] == [1.0]
    assert numbers["path_deviation_peak"][0] < 0.01


def test_coverage_and_progress_of_a_part_of_a_circle(ideal_arm):
    circle = pc.Circle(1.0, 0.5)
    lap = 2 * np.pi / 0.5
    law = pc.Projection(ideal_arm, circle, 800.0, [45.0, 100.0])
    state = circle.q_d(np.array(0.0)), circle.at(np.array(0.0)).velocity
    run = pc.simulate(law, *state, duration=0.3 * lap, progress=False)
    numbers = pc.metrics(run)
    edge = 2 * np.arcsin(np.deg2rad(2.0) / 2) / (2 * np.pi)  # of the chord of two degrees, at either end
    assert numbers["coverage"][0] == pytest.approx(0.3 + 2 * edge, abs=2e-3)
    assert numbers["path_deviation_peak"][0] == pytest.approx(2 * np.sin(0.35 * np.pi), rel=1e-3)
    assert numbers["progress"] == [1.0]
    laps = pc.simulate(law, *state, duration=0.3 * lap, laps=1, progress=False)
    assert pc.metrics(laps)["progress"][0] == pytest.approx(0.3, abs=1e-3)


@given(st.integers(0, 10**6), st.floats(1e-3, 0.3))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_the_distance_to_a_trace_is_that_to_its_straight_lines(seed, resolution):
    random = np.random.default_rng(seed)
    trace, x = random.normal(size=(6, 3)), random.normal(size=(20, 3))
    line, away = np.diff(trace, axis=0), x[:, None] - trace[:-1]
    share = np.clip(np.vecdot(away, line) / np.vecdot(line, line), 0.0, 1.0)[..., None]
    expected = np.linalg.norm(away - share * line, axis=-1).min(1)
    found = distance_to_trace(x, trace, resolution)
    assert (found >= expected - 1e-12).all()
    assert_allclose(found, expected, atol=resolution**2)


def test_a_trace_covers_what_it_comes_near_to():
    edge = even_points(np.stack([np.linspace(0, 1, 2001), np.zeros(2001)], -1))
    half = measure_coverage(edge, np.array([[0.0, 0.01], [0.5, 0.01]]), 0.02)
    assert half.share == pytest.approx(0.5 + np.sqrt(3e-4), abs=1e-3)
    assert half.farthest == pytest.approx(np.hypot(0.5, 0.01))
    assert measure_coverage(edge, np.array([[0.2, 0.0]]), 0.1).share == pytest.approx(0.2, abs=1e-3)


def test_noise_without_the_jumps_of_compensated_friction(arm, ideal_arm, circle):
    """Noise of both joints through K_p and a difference of two samples, in closed form, with friction or without."""
    sigma, h, K_p, K_v = 1e-5, 2.5e-3, 800.0, np.array([45.0, 100.0])
    start = circle.q_d(np.array(0.0)), circle.at(np.array(0.0)).velocity
    for robot, friction in ((ideal_arm, "viscous"), (arm, "full")):
        law = pc.ComputedTorque(robot, circle, K_p, K_v, friction=friction)
        loop = pc.SampledLoop(noise=pc.SensorNoise(position=sigma, seed=1), velocity="difference")
        run = pc.simulate(law, *start, duration=6.0, loop=loop, progress=False)
        late = run.array("q")[0, len(run.time) // 2 :]
        # u = −(K_p n_k + K_v (n_k − n_{k−1})/h): a second difference of it has the coefficients of n below
        a, b = K_p + K_v / h, -K_v / h
        coefficients = np.stack([a, b - 2 * a, a - 2 * b, b])
        of_joint = sigma * np.sqrt((coefficients**2).sum(0) / 6)
        M = robot.mass_matrix(late)
        expected = np.sqrt(((M * of_joint) ** 2).sum(-1).mean(0)).max()
        assert pc.metrics(run)["tau_noise"][0] == pytest.approx(expected, rel=0.08)
    quiet = pc.ComputedTorque(arm, circle, K_p, K_v, friction="full")
    exact = pc.metrics(pc.simulate(quiet, *start, duration=6.0, progress=False))["tau_noise"][0]
    none = pc.ComputedTorque(ideal_arm, circle, K_p, K_v)
    without = pc.metrics(pc.simulate(none, *start, duration=6.0, progress=False))["tau_noise"][0]
    assert exact < without + 5e-3  # of jumps by 15 N m


def test_a_window_without_any_sample_has_no_errors_to_tell(arm):
    """A run that is kept from its last sample on, asked for a time before it."""
    line = pc.Line([0.0, 0.0], [0.3, 0.3], 1.0)
    run = pc.simulate(pc.ExtendedMotionPlan(arm, line, 800.0, 45.0, 20.0), [0.0, 0.0], duration=0.15, progress=False)
    late = run.with_data(run.data.isel(time=[-1]))
    found = pc.metrics(late, window=(0.01, 0.05))
    for name in ("e_p_peak", "lag_error_rms", "contour_error_peak", "gamma_distance_peak"):
        assert np.isnan(found[name]).all(), name
