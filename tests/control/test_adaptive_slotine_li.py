"""Adaptive control on a path parameter: V with the parameters' error in it never grows, and a payload is learnt."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from random_arms import random_arm
from scipy.integrate import solve_ivp
from strategies import floats, gains, tasks, vectors

import pathcontrol as pc
from pathcontrol.errors import InputError
from pathcontrol.simulation.continuous import ClosedLoop

GAINS = {"Lambda": 10.0, "K_d": [40.0, 4.0]}


@pytest.fixture(scope="module")
def heavy(ideal_arm):
    """The arm with half as much again in link 2, and a payload, of which the laws know nothing."""
    return ideal_arm.with_masses({ideal_arm.joint_names[1]: 1.5 * 3.88}).with_payload(0.5, "tool")


def state_function(law, plant):
    """V = ½xᵀMx + ½θ̃ᵀΓ⁻¹θ̃ and V̇ = −xᵀK_d x, written down from the theorem, of a flat state (q, q̇, σ, θ̂ − θ_model)."""
    n, wrong = law.robot.n, plant.inertial_parameters - law.robot.inertial_parameters

    def evaluate(y):
        q, qd, s = y[:n], y[n : 2 * n], y[2 * n]
        point = law.task.at(np.array(s))
        x = point.dq_d * point.theta + law.Lambda * (point.q_d - q) - qd
        left = wrong - y[2 * n + 1 :]
        V = 0.5 * x @ plant.mass_matrix(q) @ x + 0.5 * (left**2 / law.adaptation_matrix).sum()
        return V, -(law.K_d * x**2).sum()

    return evaluate


# --- the regressor ------------------------------------------------------------------------------------------------


@settings(max_examples=12)
@given(st.integers(0, 5), st.integers(1, 5))
def test_torques_are_linear_in_the_parameters_of_any_arm(seed, joints):
    arm, rng = random_arm(seed, joints), np.random.default_rng(seed)
    q, qd, qdd, v = rng.normal(size=(4, 3, joints))
    loaded = arm.with_payload(1.3, arm.frame_names[-1], com=[0.1, -0.2, 0.05])
    for one in (arm, loaded):  # the same regressor, which knows nothing of the masses
        theta = one.inertial_parameters
        assert_allclose(arm.torque_regressor(q, qd, qdd) @ theta, one.inverse_dynamics(q, qd, qdd), atol=1e-10)
        both = arm.torque_regressor(q, qd, qdd, velocity=v) @ theta
        assert_allclose(both, one.inverse_dynamics(q, qd, qdd, velocity=v), atol=1e-10)


# --- the theorem --------------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(tasks(), vectors(2, 2), vectors(2, 4), floats(0, 6), gains(2, 1, 30), gains(2, 1, 50), floats(0, 30))
def test_the_rate_of_V_is_that_of_the_theorem(ideal_arm, heavy, task, q, qd, s, Lambda, K_d, k):
    law = pc.AdaptiveSlotineLi(ideal_arm, task, Lambda, K_d, adaptation=0.3, k=k)
    learnt = 0.2 * np.random.default_rng(0).normal(size=20)
    y = np.concatenate([q, qd, [s], learnt])
    rate = ClosedLoop(law, heavy, pc.ContinuousTime()).rate(0.0, y[None])[0]
    evaluate, h = state_function(law, heavy), 1e-6 / (1 + np.abs(rate).max())
    (ahead, _), (behind, _), (_, Vdot) = evaluate(y + h * rate), evaluate(y - h * rate), evaluate(y)
    assert (ahead - behind) / (2 * h) == pytest.approx(Vdot, rel=1e-4, abs=1e-9 * (1 + ahead) / h)
    assert Vdot <= 0


def test_the_error_of_the_parameters_never_grows_along_a_run(ideal_arm, heavy, circle):
    law = pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=0.1, k=20.0, start="nearest")
    loop, q = ClosedLoop(law, heavy, pc.ContinuousTime()), np.array([0.9, 0.1])
    y = np.concatenate([q, np.zeros(2), law.start(q, np.zeros(2))])
    evaluate = state_function(law, heavy)

    def rate(t, y):  # with the dissipated part of V beside it
        return np.append(loop.rate(t, y[None, :-1])[0], evaluate(y[:-1])[1])

    found = solve_ivp(rate, (0, 0.7), np.append(y, 0.0), method="DOP853", rtol=1e-9, atol=1e-12).y
    V = np.array([evaluate(column[:-1])[0] for column in found.T])
    assert np.diff(V).max() < 1e-9 * V[0]
    assert_allclose(V - V[0], found[-1], atol=1e-7 * V[0])  # what is gone is what was dissipated
    assert V[-1] < 0.99 * V[0]


# --- limits and cases ---------------------------------------------------------------------------------------------


def test_without_adaptation_it_is_slotine_and_lis_law(ideal_arm, circle):
    q, qd = np.random.default_rng(1).normal(size=(2, 5, 2))
    known = pc.SlotineLi(ideal_arm, circle, **GAINS)
    law = pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=0.0)
    out = known.law(0.0, q, qd, known.start(q, qd))
    assert_allclose(law.law(0.0, q, qd, law.start(q, qd)).tau, out.tau, atol=1e-12)


def test_an_unknown_payload_is_learnt_where_the_known_law_keeps_its_error(ideal_arm, heavy, circle):
    laws = (
        pc.SlotineLi(ideal_arm, circle, **GAINS, start="nearest"),
        pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=0.1, start="nearest"),
    )
    laps = []
    for law in laws:
        run = pc.simulate(law, [0.95, 0.0], duration=4.8, loop=pc.SampledLoop(4e-3), plant=heavy, progress=False)
        error = run.norm("e_p")[0]
        laps.append([error[(run.time >= t) & (run.time < t + 1.4)].max() for t in (0.0, 1.6, 3.4)])
    known, learning = np.array(laps)
    assert known[-1] > np.deg2rad(5)
    assert learning[-1] < 0.05 * known[-1]
    assert learning[-1] < 0.1 * learning[0]


def test_rotor_inertia_is_known_and_not_learnt(ideal_arm, circle):
    geared = ideal_arm.with_armature(np.array([0.4, 0.1]))
    law = pc.AdaptiveSlotineLi(geared, circle, **GAINS, adaptation=1.0)
    point = circle.at(np.array([0.0]))
    out = law.law(0.0, point.q_d, point.velocity, law.start(point.q_d, point.velocity))
    wanted = geared.inverse_dynamics(point.q_d, point.velocity, point.velocity_slope * point.theta)
    assert_allclose(out.tau - geared.friction.viscous * point.velocity, wanted, atol=1e-12)
    assert_allclose(law.learnt(out.zdot), 0.0, atol=1e-12)


def test_a_negative_adaptation_is_refused(ideal_arm, circle):
    with pytest.raises(InputError, match=r"adaptation = -1.*0 or more"):
        pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=-1.0)
    with pytest.raises(InputError, match="adaptation has shape"):
        pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=[[1.0, 2.0]])


def test_an_adaptation_that_is_too_fast_for_the_period_is_told(ideal_arm, heavy, circle):
    law = pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=30.0)
    with (
        pytest.warns(pc.PathControlWarning, match=r"adaptation = 30 learns at .* take adaptation below") as told,
        pytest.raises(pc.SimulationError),
    ):
        pc.simulate(law, [0.95, 0.0], duration=1.0, plant=heavy, progress=False)
    most = float(str(told[0].message).split("below ")[1].split(",")[0])
    law = pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=0.9 * most)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = pc.simulate(law, [0.95, 0.0], duration=1.0, plant=heavy, progress=False)
    assert run.norm("e_p")[0, -1] < 0.05


def test_the_learning_rate_is_that_of_the_torque_that_is_learnt(ideal_arm, circle):
    """θ̂ that grows at ΓYᵀx changes the torque by YΓYᵀx; the largest share of K_d x is the rate."""
    law, rng = pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=0.3, k=5.0), np.random.default_rng(2)
    q, qd = rng.normal(size=(2, 1, 2))
    z, columns = law.start(q, qd), []
    for learnt in np.eye(20):
        z[0, 1:] = learnt
        columns.append(law.law(0.0, q, qd, z).tau[0])
    z[0, 1:] = 0.0
    Y = (np.array(columns) - law.law(0.0, q, qd, z).tau[0]).T
    matrix = np.diag(1 / law.K_d) @ Y @ np.diag(law.adaptation_matrix) @ Y.T
    assert_allclose(law.learning_rate(q, qd, z), np.linalg.eigvals(matrix).real.max(), rtol=1e-9)


def test_each_rollout_may_have_its_own_gain_of_the_plan(ideal_arm, circle):
    starts, k = [[1.0, 0.05], [0.95, 0.0], [0.9, 0.1]], [0.0, 20.0, 300.0]
    law = pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=0.01, k=k)
    several = pc.simulate(law, starts, duration=0.02, progress=False)
    for i, one in enumerate(k):
        law = pc.AdaptiveSlotineLi(ideal_arm, circle, **GAINS, adaptation=0.01, k=one)
        alone = pc.simulate(law, starts[i], duration=0.02, progress=False)
        assert_allclose(several.array("q")[i], alone.array("q")[0], rtol=0, atol=1e-12)
