"""Metrics against what they mean."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats, tasks, vectors

from pathcontrol import (
    Circle,
    ComputedTorque,
    ContinuousTime,
    ExtendedMotionPlan,
    InputError,
    PathTask,
    Projection,
    SampledLoop,
    contour_error,
    distance_to_gamma,
    lag_error,
    lyapunov,
    metrics,
    settling_time,
    simulate,
    steady_state,
)
from pathcontrol.analysis.run_metrics import UNITS, peak, rms
from pathcontrol.errors import PathControlWarning, UnknownNameError

START = np.deg2rad([40.0, 70.0])


@settings(max_examples=10)
@given(tasks(), vectors(2, 2.0), vectors(2, 3.0), floats(0, 2))
def test_the_distance_to_gamma_is_a_global_minimum(task, q, qd, weight):
    s = np.linspace(0, task.period, 20_001)
    point = task.at(s)
    dense = np.sqrt(((point.q_d - q) ** 2).sum(-1) + weight**2 * ((point.velocity - qd) ** 2).sum(-1))
    distance, where = distance_to_gamma(task, q, qd, weight, return_s=True)
    assert distance <= dense.min() * (1 + 1e-12) + 1e-12
    at = task.at(where)
    assert distance == pytest.approx(np.hypot(*(np.linalg.norm(v) for v in (at.q_d - q, weight * (at.velocity - qd)))))


@given(tasks(), floats(0, 6), floats(0, 2))
def test_points_of_gamma_are_at_distance_0(task, s, weight):
    point = task.at(np.array(s))
    assert distance_to_gamma(task, point.q_d, point.velocity, weight) < 1e-9


@given(tasks(), vectors(2, 2.0), vectors(2, 3.0))
def test_weight_0_is_the_distance_to_the_path(task, q, qd):
    nearest = np.linalg.norm(task.q_d(task.sigma_bar(q)) - q)
    assert distance_to_gamma(task, q, qd, 0.0) == pytest.approx(nearest, abs=1e-9)


def test_distance_of_the_circle_in_closed_form():
    """q on the circle and the right speed, but turned by an angle a: both parts are chords of a circle."""
    task = Circle(1.0, 2.0)
    for a in (0.1, 1.0, 2.0):
        q, qd = task.q_d(0.7), 2.0 * task.dq_d(0.7 + a)
        # the nearest s minimises |chord(s)|² + 4|chord(a − s)|²
        s = np.arctan2(4 * np.sin(a), 1 + 4 * np.cos(a))
        expected = np.sqrt((2 * np.sin(s / 2)) ** 2 + 4 * (2 * np.sin((a - s) / 2)) ** 2)
        assert distance_to_gamma(task, q, qd) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("kind", [ExtendedMotionPlan, Projection])
def test_v_and_vdot_belong_together_along_a_run(ideal_arm, circle, kind):
    gain = {"k": 20.0} if kind is ExtendedMotionPlan else {}
    law = kind(ideal_arm, circle, 100.0, [10.0, 20.0], **gain)
    run = simulate(law, START, duration=1.0, loop=ContinuousTime(output_period=1e-3), progress=False)
    V, Vdot = (v[0] for v in lyapunov(law, run))
    difference = (V[2:] - V[:-2]) / (2 * 1e-3)
    # central differences: h²/6 of a third derivative
    assert np.abs(difference - Vdot[1:-1]).max() < 1e-3 * np.abs(Vdot).max()
    assert (np.diff(V) < 0).all()


@pytest.mark.parametrize("loop", [SampledLoop(), ContinuousTime()])
def test_v_of_rollouts_with_gains_of_their_own(ideal_arm, circle, loop):
    K_p, k = np.array([[50.0, 60.0], [400.0, 500.0]]), np.array([1.0, 9.0])
    both = ExtendedMotionPlan(ideal_arm, circle, K_p, 20.0, k)
    together = lyapunov(both, simulate(both, [START, START], duration=0.1, loop=loop, progress=False))
    for i in range(2):
        law = ExtendedMotionPlan(ideal_arm, circle, K_p[i], 20.0, k[i])
        alone = lyapunov(law, simulate(law, START, duration=0.1, loop=loop, progress=False))
        # two rollouts share the steps of the integrator: equal within its tolerance
        assert np.allclose(together.V[i], alone.V[0], rtol=1e-5, atol=1e-9)
        assert np.allclose(together.Vdot[i], alone.Vdot[0], rtol=1e-5, atol=1e-7)


def test_no_lyapunov_function_of_a_law_for_other_rollouts_or_along_another_path(ideal_arm, circle):
    several = ExtendedMotionPlan(ideal_arm, circle, [[50.0], [400.0]], 20.0, 1.0)
    run = simulate(several, [START, START], duration=0.1, progress=False)
    with pytest.raises(InputError, match="K_p of the law has 2 rows, the run 1"):
        lyapunov(several, run.rollout(1))
    with pytest.raises(InputError, match="another path"):
        lyapunov(ExtendedMotionPlan(ideal_arm, Circle(0.5, 2.0), 50.0, 20.0, 1.0), run)


def test_no_lyapunov_function_for_other_laws(ideal_arm, circle):
    law = ComputedTorque(ideal_arm, circle, 100.0, 20.0)
    run = simulate(law, START, duration=0.1, progress=False)
    with pytest.raises(InputError, match="k = 0"):
        lyapunov(law, run)


def test_contour_and_lag_error(arm, circle):
    """On a circle the contour error is | ‖q‖ − r_0 |; motion control lags, which is no contour error."""
    law = ComputedTorque(arm, circle, 100.0, 20.0)
    run = simulate(law, START, duration=2.0, progress=False)
    radius = np.linalg.norm(run.array("q"), axis=-1)
    assert np.allclose(contour_error(run, circle), np.abs(radius - circle.radius), atol=1e-12)
    lag, e_p = lag_error(run, circle), run.norm("e_p")
    assert (np.abs(lag) <= e_p + 1e-12).all()
    assert (contour_error(run, circle) <= e_p + 1e-12).all()
    projection = simulate(Projection(arm, circle, 100.0, 20.0), START, duration=2.0, progress=False)
    assert np.abs(lag_error(projection, circle)).max() < 1e-12


@given(st.integers(0, 20), floats(0.1, 2.0))
def test_settling_time(ticks, band):
    time = np.arange(21) * 0.1
    values = np.where(np.arange(21) < ticks, 2 * band, 0.5 * band)[None]
    assert settling_time(values, time, band)[0] == pytest.approx(time[ticks])
    values[0, -1] = 3 * band
    assert settling_time(values, time, band)[0] == np.inf


def test_series_of_one_rollout_and_lists_are_reduced_too():
    assert settling_time([3.0, 2.0, 1.0, 0.5], [0.0, 0.1, 0.2, 0.3], 1.5) == pytest.approx(0.2)
    assert settling_time([[3.0, 1.0], [1.0, 1.0]], [0.0, 0.1], 1.5).tolist() == [0.1, 0.0]
    assert peak([[1.0, 3.0]]).tolist() == [3.0]
    assert rms([3.0, 3.0]) == 3.0
    with pytest.raises(InputError, match=r"\(2,\) and time \(3,\)"):
        settling_time([1.0, 2.0], [0.0, 0.1, 0.2], 1.5)


def test_names_of_metrics_and_bands_in_degrees_are_told(arm, circle):
    run = simulate(ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0), START, duration=0.1, progress=False)
    with pytest.raises(UnknownNameError, match=r"did you mean 'e_p_peak'\?"):
        metrics(run, only=["e_v_peak", "e_p_peek"])
    with pytest.raises(UnknownNameError, match="brackets"):
        metrics(run, only="e_p_peak")
    with pytest.warns(PathControlWarning, match="did you mean 2 deg"):
        metrics(run, band=2.0, only=["settling_time"])


def test_metrics_of_a_run(arm, circle):
    law = ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)
    run = simulate(law, [START, START + 0.2], duration=2.0, progress=False)
    values, late = metrics(run, circle), run.time >= 1.0
    assert values["e_p_peak"] == pytest.approx(run.norm("e_p")[:, late].max(-1))
    rate = (run.array("s")[:, -1] - run.array("s")[:, late][:, 0]) / 1.0
    assert values["speed_ratio"] == pytest.approx(rate / circle.theta(np.zeros(2)), rel=1e-3)
    assert set(values) <= set(UNITS)
    assert not {"path_time", "end_error"} & set(values)  # which are those of an open path
    assert values["e_v_rms"] == pytest.approx(np.sqrt((run.norm("e_v")[:, late] ** 2).mean(-1)))
    assert all(len(v) == 2 for v in values.values())
    assert steady_state(run, 0.25).time[0] == pytest.approx(1.5)
    assert steady_state(steady_state(run)).time[0] == pytest.approx(1.5)
    with pytest.raises(InputError, match="fraction = 2"):
        steady_state(run, 2.0)


def test_metrics_without_a_nearest_point(ideal_arm):
    class Spiral(PathTask):
        def q_d(self, s):
            return np.stack([np.cos(s), np.sin(s)], -1) * (0.2 + 0.05 * s[..., None] if np.ndim(s) else 0.2 + 0.05 * s)

        def theta(self, s):
            return 1.0

    task = Spiral()
    run = simulate(ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, 5.0), [0.2, 0.0], duration=1.0, progress=False)
    values = metrics(run, task)
    assert "contour_error_peak" not in values
    assert values["e_p_peak"][0] < 0.1
