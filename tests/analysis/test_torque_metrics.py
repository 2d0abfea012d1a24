"""Torque peaks and noise against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import floats

import pathcontrol as pc
from pathcontrol.analysis.readable import unit_of
from pathcontrol.analysis.torque import noise_deviation

START = [0.7, 1.2]


@given(floats(-5, 5), floats(-5, 5), floats(-5, 5), floats(-5, 5), st.integers(3, 40))
def test_noise_of_lines_parabolas_and_alternating_signals_in_closed_form(a, b, c, d, samples):
    k = np.arange(samples)
    line, parabola, alternating = a + b * k, c * k**2, d * (-1.0) ** k
    found = noise_deviation(np.stack([line, line + parabola, line + alternating], -1)[None])
    np.testing.assert_allclose(found[0], np.abs([0, 2 * c, 4 * d]) / np.sqrt(6), atol=1e-11)


@given(st.integers(0, 10**6))
def test_noise_on_a_smooth_signal_is_found_again(seed):
    deviation, n = np.array([0.3, 2.0]), 4000
    smooth = 50 * np.sin(np.linspace(0, 12, n))[:, None]
    noise = np.random.default_rng(seed).normal(scale=deviation, size=(1, n, 2))
    # the estimate of σ has the relative deviation √(35/18/4/n); seven of them
    np.testing.assert_allclose(noise_deviation(smooth + noise)[0], deviation, rtol=7 * np.sqrt(35 / 72 / n))
    difference = np.diff(noise, axis=1)
    coloured = noise_deviation(difference) / difference.std(1)
    np.testing.assert_allclose(coloured, np.sqrt(5 / 3), rtol=0.06)


def test_what_one_task_of_a_batch_lacks_is_nan_for_its_rollouts():
    tasks = [pc.Circle(1.0, 2.0), pc.Circle(0.5, 2.0)]
    law = pc.ExtendedMotionPlan(pc.load_robot("cicese_2dof"), pc.TaskBatch(tasks), 800.0, [45.0, 100.0], 20.0)
    run = pc.simulate(law, [START] * 2, duration=0.05, loop=pc.SampledLoop(encoders=True), progress=False)
    exact = run.data["q_measured"].where(run.data["rollout"] != 1, run.data["q"])
    found = pc.metrics(run.with_data(run.data.assign(q_measured=exact)))["noise_amplification"]
    assert found[0] == pc.metrics(run)["noise_amplification"][0] > 0
    assert np.isnan(found[1])


def test_too_few_samples_say_nothing():
    assert np.isnan(noise_deviation(np.zeros((2, 2, 3)))).all()


def standing(arm, loop, K_p=400.0, duration=4.0):
    """Computed torque that holds a posture, as a path so slow that it does not matter."""
    line = pc.Line(START, np.add(START, 0.01), 1e-3)
    law = pc.ComputedTorque(arm, line, K_p=K_p, K_v=40.0, friction="none")
    return pc.simulate(law, START, duration=duration, loop=loop, progress=False)


def test_noise_is_amplified_by_the_stiffness(ideal_arm):
    """τ = M(q) K_p (q_d − q_m) + …: white noise of q_m is in joint i √Σ_j (M_ij K_p σ_j)² in the torque."""
    sigma = np.array([2e-4, 1e-4])
    loop = pc.SampledLoop(noise=pc.SensorNoise(position=sigma, seed=1))
    run = standing(ideal_arm, loop)
    M = ideal_arm.mass_matrix(np.array(START))
    expected = np.sqrt(((M * 400.0 * sigma) ** 2).sum(-1))
    numbers = pc.metrics(run)
    assert numbers["tau_noise"][0] == pytest.approx(expected.max(), rel=0.1)
    assert numbers["noise_amplification"][0] == pytest.approx((expected / sigma).max(), rel=0.1)
    twice = pc.metrics(standing(ideal_arm, loop, K_p=800.0))
    assert twice["noise_amplification"][0] == pytest.approx(2 * numbers["noise_amplification"][0], rel=0.1)


def test_without_an_error_of_the_sensors_there_is_no_amplification(ideal_arm):
    numbers = pc.metrics(standing(ideal_arm, pc.SampledLoop(), duration=0.5))
    assert "noise_amplification" not in numbers
    assert numbers["tau_noise"][0] < 1e-3


@pytest.mark.parametrize("what", ["ticks", "measurements"])
def test_frozen_measurements_are_no_noise(ideal_arm, circle, what):
    law = pc.ExtendedMotionPlan(ideal_arm, circle, 800.0, [45.0, 100.0], 20.0)
    gap = pc.Dropout(0.6, 0.01, what)

    def numbers(disturbance, **loop):
        run = pc.simulate(
            law, START, duration=1.0, loop=pc.SampledLoop(**loop), disturbance=disturbance, progress=False
        )
        return pc.metrics(run, window=(0.5, 1.0), only=["tau_noise", "noise_amplification"])

    exact = numbers(gap)
    assert "noise_amplification" not in exact
    # what is left are second derivatives of smooth torques; with the jump after the gap it was 1.6 and 2.2
    assert exact["tau_noise"][0] < 0.1
    noisy = {"noise": pc.SensorNoise(position=1e-4, seed=1)}
    calm, lossy = numbers(None, **noisy), numbers(gap, **noisy)
    for name in calm:  # 180 samples and not 200 tell it: 0.25 are three of its deviations
        assert lossy[name] == pytest.approx(calm[name], rel=0.25)


def test_a_rollout_without_any_measurement_has_no_noise(ideal_arm, circle):
    law = pc.ExtendedMotionPlan(ideal_arm, circle, 800.0, [45.0, 100.0], 20.0)
    loop = pc.SampledLoop(noise=pc.SensorNoise(position=1e-4, seed=1))
    lost = pc.Dropout([0.0, 0.4], [np.inf, 0.02], "measurements")
    run = pc.simulate(law, [START] * 2, duration=0.5, loop=loop, disturbance=lost, progress=False)
    numbers = pc.metrics(run)
    for name in ("tau_noise", "noise_amplification"):
        assert np.isnan(numbers[name][0])
        assert numbers[name][1] > 0
        assert pc.metrics(run.rollout(1))[name][0] == numbers[name][1]


def test_peaks_and_their_share_of_the_limits(arm, circle):
    law = pc.ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    run = pc.simulate(law, START, duration=0.5, loop=pc.SampledLoop(torque_limits=True), progress=False)
    numbers, demand = pc.metrics(run), np.abs(run.array("tau_demand")[0])
    limits = arm.limits.effort
    assert numbers["tau_demand_ratio"][0] == pytest.approx((demand / limits).max())
    assert numbers["tau_demand_ratio"][0] > 1
    assert numbers["tau_peak"][0] == np.abs(run.array("tau")).max() == limits.max()
    given = pc.simulate(law, START, duration=0.1, loop=pc.SampledLoop(torque_limits=[50.0, 15.0]), progress=False)
    demand = np.abs(given.array("tau_demand")[0])
    assert pc.metrics(given)["tau_demand_ratio"][0] == pytest.approx((demand / [50.0, 15.0]).max())
    free = pc.Run(run.data, {}, None)
    assert "tau_demand_ratio" not in pc.metrics(free, circle)


def test_each_rollout_has_the_limits_of_its_own_arm(arm, circle):
    urdf = (Path(__file__).parents[2] / "urdf" / "cicese_2dof.urdf").read_text()
    weak = pc.load_robot(urdf.replace('effort="150', 'effort="75').replace('effort="15"', 'effort="7.5"'))
    law = pc.ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    run = pc.simulate(law, START, duration=0.1, plant=[arm, weak], progress=False)
    first, second = pc.metrics(run)["tau_demand_ratio"]
    assert second == pytest.approx(2 * first)  # whose demand is the law's, which knows one arm
    for i in range(2):
        assert pc.metrics(run)["tau_demand_ratio"][i] == pc.metrics(run.rollout(i))["tau_demand_ratio"][0]


@pytest.mark.parametrize("delay", [0.0, 2.5e-3, 4e-3])
@pytest.mark.parametrize("rollouts", [3, 40])  # of 40 the configuration keeps a summary only
def test_shares_are_of_the_limits_that_act(arm, circle, tmp_path, rollouts, delay):
    limits = np.array([60.0, 12.0]) * np.linspace(0.5, 1.0, rollouts)[:, None]
    left, begin = np.linspace(0.1, 0.9, rollouts), np.linspace(0.0, 0.1, rollouts)
    drop = pc.TorqueLimitDrop(left[:, None], begin, 0.1)
    law = pc.ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    loop = pc.SampledLoop(torque_limits=limits, delay=delay)
    run = pc.simulate(law, START, duration=0.25, loop=loop, disturbance=drop, progress=False)
    middle = run.time + 0.5 * loop.period - begin[:, None]
    share = np.where((middle >= 0) & (middle < 0.1), left[:, None], 1.0)[..., None]
    acting, demand = share * limits[:, None], np.abs(run.array("tau_demand"))
    periods = {0.0: [0], 2.5e-3: [1], 4e-3: [1, 2]}[delay]  # in which a demand acts
    asked = [(demand[:, : len(run.time) - later] / acting[:, later:]).max((1, 2)) for later in periods]
    acted = (np.abs(run.array("tau")) / acting).max((1, 2))
    run.save(tmp_path / "run.nc")
    for one in (run, pc.Run.load(tmp_path / "run.nc")):
        numbers = pc.metrics(one, only=("torque_limit_ratio", "tau_demand_ratio"))
        np.testing.assert_allclose(numbers["torque_limit_ratio"], acted, rtol=1e-12)
        np.testing.assert_allclose(numbers["tau_demand_ratio"], np.max(asked, axis=0), rtol=1e-12)
        for name, value in numbers.items():
            assert pc.metrics(one.rollout(1))[name] == [value[1]]


def test_a_motor_without_any_torque_is_asked_for_infinitely_more(arm, circle):
    law = pc.ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    dead = pc.TorqueLimitDrop([1.0, 0.0], 0.05)
    free = pc.SampledLoop(torque_limits=[np.inf, 15.0])  # and of no limit no drop leaves one
    for loop in (pc.SampledLoop(torque_limits=True), free):
        run = pc.simulate(law, START, duration=0.1, loop=loop, disturbance=dead, progress=False)
        numbers = pc.metrics(run)
        assert numbers["tau_demand_ratio"] == [np.inf]
        assert 0 < numbers["torque_limit_ratio"][0] <= 1


def test_the_unit_of_the_amplification_follows_the_joints(arm, circle):
    law = pc.ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    run = pc.simulate(law, START, duration=0.1, progress=False)
    for kinds, unit in ((("rad", "rad"), "N m/rad"), (("m", "m"), "N/m"), (("rad", "m"), "N m/rad or N/m")):
        arrays = {name: run.array(name) for name in ("q", "tau_demand")}
        other = pc.Run.from_arrays(run.time, dict(zip("ab", kinds, strict=True)), arrays, {})
        assert unit_of("noise_amplification", other) == unit
