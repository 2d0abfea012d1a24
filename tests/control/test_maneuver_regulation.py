"""Maneuver regulation: the nearest reference in (q, q̇), and states that come to the maneuver exponentially."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_lyapunov
from strategies import floats, gains, tasks, vectors

import pathcontrol as pc
from pathcontrol.simulation.continuous import ClosedLoop


def matrices(law, joint):
    """A_c, Q and P of one joint, P by SciPy."""
    k_p, k_v = (np.broadcast_to(gain, law.robot.n)[joint] for gain in (law.K_p, law.K_v))
    A, Q = np.array([[0.0, 1.0], [-k_p, -k_v]]), np.diag([1.0, 1.0 / k_p])
    return A, Q, solve_continuous_lyapunov(A.T, -Q)


def value(law, s, q, qd):
    """V = eᵀPe at states (k, n), with P by SciPy."""
    point = law.task.at(s)
    errors = np.stack([point.q_d - q, point.dq_d * point.theta[..., None] - qd], axis=-1)
    return sum(
        np.einsum("...i,ij,...j->...", errors[..., j, :], matrices(law, j)[2], errors[..., j, :])
        for j in range(law.robot.n)
    )


def near(task, s, offsets):
    """A state beside the maneuver at s, and what is added to it."""
    point = task.at(np.array([s]))
    return point.q_d[0] + offsets[:2], point.velocity[0] + offsets[2:]


@given(gains(2, 1, 900), gains(2, 0.5, 100))
def test_the_metric_solves_lyapunovs_equation_and_gives_the_rate(ideal_arm, circle, K_p, K_v):
    law, rates = pc.ManeuverRegulation(ideal_arm, circle, K_p, K_v), []
    for j in range(2):
        _, Q, P = matrices(law, j)
        found = [[law.metric.a[j], law.metric.b[j]], [law.metric.b[j], law.metric.c[j]]]
        assert_allclose(found, P, rtol=1e-9)
        rates.append(np.linalg.eigvals(np.linalg.solve(P, Q)).real.min())
    assert_allclose(law.decay_rate, min(rates), rtol=1e-6)
    x = np.array([[0.3, -0.2, 1.0, 0.7]])
    lifted = law.metric.lift(x[:, :2], x[:, 2:])
    norm = sum(x[0, j::2] @ matrices(law, j)[2] @ x[0, j::2] for j in range(2))
    assert_allclose((lifted**2).sum(), norm, rtol=1e-9)


@settings(max_examples=15)
@given(tasks(), floats(0, 6), vectors(4, 0.1), gains(2, 20, 400), gains(2, 10, 60))
def test_the_rate_of_V_is_that_of_the_theorem(ideal_arm, task, s, offsets, K_p, K_v):
    law = pc.ManeuverRegulation(ideal_arm, task, K_p, K_v)
    q, qd = near(task, s, offsets)
    found = law.project(q, qd, np.array(s))
    assume(found.regular)
    out, point = law.law(0.0, q, qd, np.array([s])), task.at(found.s[None])
    Pe_q, Pe_qd = law.metric.apply(out.e_p, out.e_v)
    slope_q, slope_qd = point.dq_d[0], point.velocity_slope[0]
    size = np.sqrt(value(law, found.s[None], q, qd)[0] * np.sum(slope_q**2 * law.metric.a + slope_qd**2 * law.metric.c))
    assert abs(Pe_q @ slope_q + Pe_qd @ slope_qd) <= 1e-8 * size + 1e-12  # x_d'ᵀPe = 0
    qdd = ideal_arm.forward_dynamics(q, qd, out.tau - ideal_arm.friction.viscous * qd)
    e_p_rate, e_v_rate = slope_q * out.sdot - qd, slope_qd * out.sdot - qdd
    Vdot = 2 * (Pe_q @ e_p_rate + Pe_qd @ e_v_rate)
    expected = -(out.e_p**2).sum() - (out.e_v**2 / K_p).sum()
    terms = np.abs(Pe_q * e_p_rate).sum() + np.abs(Pe_qd * e_v_rate).sum()
    assert abs(Vdot - expected) < 1e-7 * (1e-6 + terms)


@settings(max_examples=15)
@given(tasks(), floats(0, 6), vectors(4, 0.1), vectors(2, 20))
def test_its_sdot_is_the_rate_of_the_nearest_reference(ideal_arm, task, s, offsets, push):
    law, h = pc.ManeuverRegulation(ideal_arm, task, 100.0, 20.0), 1e-5
    q, qd = near(task, s, offsets)
    found = law.project(q, qd, np.array(s))
    assume(found.regular and np.linalg.norm(found.position_gradient) < 20)
    out = law.law(0.0, q, qd, np.array([s]))
    qdd = ideal_arm.forward_dynamics(q, qd, out.tau - ideal_arm.friction.viscous * qd)
    ahead, behind = (law.project(q + x * h * qd, qd + x * h * qdd, out.s).s for x in (1, -1))
    assert (ahead - behind) / (2 * h) == pytest.approx(out.sdot, rel=1e-3, abs=1e-3)


def test_states_come_to_the_maneuver_exponentially(ideal_arm):
    task = pc.Ellipse((1.0, 0.6), 1.5)
    law = pc.ManeuverRegulation(ideal_arm, task, K_p=[100.0, 60.0], K_v=[20.0, 12.0])
    q, qd = near(task, 0.5, np.array([0.1, -0.05, 0.5, -0.8]))
    loop = ClosedLoop(law, ideal_arm, pc.ContinuousTime())
    start = np.concatenate([q, qd, law.start(q, qd)])
    found = solve_ivp(lambda t, y: loop.rate(t, y[None])[0], (0, 0.3), start, rtol=1e-9, atol=1e-11)
    q, qd, z = loop.split(found.y.T)
    V = value(law, law.project(q, qd, z[:, 0]).s, q, qd)
    assert (V * np.exp(law.decay_rate * found.t)).max() <= V[0] * (1 + 1e-6)
    assert V[-1] < 0.3 * V[0]
    assert np.diff(V).max() < 1e-9 * V[0]


def test_an_arm_on_the_maneuver_stays_on_it(ideal_arm):
    task = pc.Lissajous([0.8, 0.5], [1, 2], 1.2, phases=[0.3, 0.1])
    law, point = pc.ManeuverRegulation(ideal_arm, task, 100.0, 20.0), task.at(np.array([0.4]))
    loop = pc.ContinuousTime(rtol=1e-11, atol=1e-11)
    run = pc.simulate(law, point.q_d, point.velocity, duration=0.2, loop=loop, progress=False)
    assert np.abs(run.array("e_p")).max() < 1e-8
    assert_allclose(run.array("sdot"), task.theta(run.array("s")), rtol=1e-6)
