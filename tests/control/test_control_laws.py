"""The theorems behind the controllers, for random tasks, states and gains; none of it looks at our own output."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import floats, gains, tasks, vectors

from pathcontrol import (
    Circle,
    ComputedTorque,
    ContinuousTime,
    ExtendedMotionPlan,
    Line,
    PathTask,
    PDPlus,
    Projection,
    SampledLoop,
    SlotineLi,
    simulate,
)
from pathcontrol.analysis.lyapunov_functions import extended_motion_plan_lyapunov, projection_lyapunov

START = np.deg2rad([40.0, 70.0])
states = st.tuples(vectors(2, 2.0), vectors(2, 4.0), floats(0, 6))


def acceleration(controller, out, q, qd):
    """q̈ of an arm whose only friction is the viscous one that the law compensates."""
    robot = controller.robot
    return robot.forward_dynamics(q, qd, out.tau - robot.friction.viscous * qd)


def error_rates(controller, out, q, qd):
    """ė_p = q_d'ṡ − q̇ and ė_v = r'ṡ − q̈ along the closed loop."""
    point = controller.task.at(out.s)
    return point.dq_d * out.sdot - qd, point.velocity_slope * out.sdot - acceleration(controller, out, q, qd)


def relative(value, reference, scale):
    return abs(value - reference) / (abs(reference) + scale)


@given(tasks(), states, gains(2, 1, 900), gains(2, 0.5, 100), floats(0, 50))
def test_vdot_of_the_extended_motion_plan(ideal_arm, task, state, K_p, K_v, k):
    q, qd, s = state
    law = ExtendedMotionPlan(ideal_arm, task, K_p, K_v, k)
    out = law.law(0.0, q, qd, np.array([s]))
    e_p_rate, e_v_rate = error_rates(law, out, q, qd)
    V, Vdot = extended_motion_plan_lyapunov(law, out.s, out.e_p, out.e_v)
    along_the_loop = out.e_p @ e_p_rate + out.e_v / law.K_p @ e_v_rate
    terms = np.abs(out.e_p * e_p_rate).sum() + np.abs(out.e_v / law.K_p * e_v_rate).sum()
    assert relative(along_the_loop, Vdot, 1e-6 * terms) < 1e-3
    assert abs(along_the_loop - Vdot) < 1e-9 * (1 + terms)
    assert Vdot <= 0
    assert V >= 0


def regular(task, q, least=0.05):
    """Whether the nearest point of the path is well inside the centre of curvature."""
    s = task.sigma_bar(q)
    d = task.dq_d(s)
    return d @ d + (task.q_d(s) - q) @ task.ddq_d(s) > least * d @ d


@given(tasks(), states, floats(1, 900), gains(2, 0.5, 100))
def test_vdot_of_the_projection_law(ideal_arm, task, state, k_p, K_v):
    q, qd, _ = state
    assume(regular(task, q))
    law = Projection(ideal_arm, task, k_p, K_v)
    out = law.law(0.0, q, qd, law.start(q, qd))
    e_p_rate, e_v_rate = error_rates(law, out, q, qd)
    V, Vdot = projection_lyapunov(law, out.e_p, out.e_v)
    along_the_loop = out.e_v @ e_v_rate + k_p * out.e_p @ e_p_rate
    terms = np.abs(out.e_v * e_v_rate).sum() + k_p * np.abs(out.e_p * e_p_rate).sum()
    assert abs(along_the_loop - Vdot) < 1e-9 * (1 + terms)
    assert Vdot <= 0
    assert V >= 0


@given(tasks(), states)
def test_the_projections_rate_is_the_derivative_of_sigma_bar(ideal_arm, task, state):
    q, qd, _ = state
    assume(regular(task, q, 0.2))
    law, h = Projection(ideal_arm, task, 10.0, 5.0), 1e-6
    out = law.law(0.0, q, qd, law.start(q, qd))
    ahead, behind = (task.sigma_bar(q + sign * h * qd, near=out.s) for sign in (1, -1))
    # central difference: rounding 1e-10/h and a third derivative that grows towards the centre of curvature
    assert (ahead - behind) / (2 * h) == pytest.approx(out.sdot, rel=1e-4, abs=1e-4)


@given(states, floats(0.2, 2), floats(0.2, 3), gains(2, 1, 900), gains(2, 0.5, 100), floats(0, 50))
def test_closed_loop_26(ideal_arm, state, r_0, v_0, K_p, K_v, k):
    """ė_p = e_v − k[e_pᵀt]t, ė_v = −K_v e_v − K_p e_p, σ̇ = v_0/r_0 − k e_pᵀt with t = r_0(−sin σ, cos σ)."""
    q, qd, s = state
    law = ExtendedMotionPlan(ideal_arm, Circle(r_0, v_0), K_p, K_v, k)
    out = law.law(0.0, q, qd, np.array([s]))
    e_p = r_0 * np.array([np.cos(s), np.sin(s)]) - q
    e_v = v_0 * np.array([-np.sin(s), np.cos(s)]) - qd
    t = r_0 * np.array([-np.sin(s), np.cos(s)])
    e_p_rate, e_v_rate = error_rates(law, out, q, qd)
    assert np.allclose(out.sdot, v_0 / r_0 - k * e_p @ t)
    assert np.allclose(e_p_rate, e_v - k * (e_p @ t) * t)
    assert np.allclose(e_v_rate, -K_v * e_v - K_p * e_p, atol=1e-7 * (1 + np.abs(K_p * e_p).max()))


@given(states, floats(0.2, 2), floats(0.2, 3), floats(1, 900), gains(2, 0.5, 100))
def test_closed_loop_41(ideal_arm, state, r_0, v_0, k_p, K_v):
    """ė_p = e_v + S r_0 q/‖q‖, ė_v = −K_v e_v − k_p e_p, S = (θ̇ − v_0/r_0) J with the signed θ̇ of the arm's angle."""
    q, qd, _ = state
    assume(np.linalg.norm(q) > 0.1)
    law = Projection(ideal_arm, Circle(r_0, v_0), k_p, K_v)
    out = law.law(0.0, q, qd, law.start(q, qd))
    J, unit = np.array([[0.0, -1.0], [1.0, 0.0]]), q / np.linalg.norm(q)
    e_p, e_v = r_0 * unit - q, v_0 * J @ unit - qd
    turning = (q[0] * qd[1] - q[1] * qd[0]) / (q @ q)
    e_p_rate, e_v_rate = error_rates(law, out, q, qd)
    assert np.allclose(out.e_p, e_p)
    assert np.allclose(out.e_v, e_v)
    assert np.allclose(e_p_rate, e_v + (turning - v_0 / r_0) * r_0 * J @ unit, atol=1e-9 * (1 + abs(turning)))
    scale = 1 + np.abs(k_p * e_p).max() + v_0 * abs(turning)
    assert np.allclose(e_v_rate, -K_v * e_v - k_p * e_p, atol=1e-8 * scale)


@given(tasks(), states, gains(2, 1, 900), gains(2, 0.5, 100))
def test_computed_torque_closes_to_17(ideal_arm, task, state, K_p, K_v):
    q, qd, s = state
    law = ComputedTorque(ideal_arm, task, K_p, K_v)
    out = law.law(0.0, q, qd, np.array([s]))
    _, e_v_rate = error_rates(law, out, q, qd)
    assert np.allclose(out.sdot, task.theta(np.array(s)))
    assert np.allclose(e_v_rate, -K_v * out.e_v - K_p * out.e_p, atol=1e-7 * (1 + np.abs(K_p * out.e_p).max()))


def mass_rate(robot, q, qd, h=1e-6):
    return (robot.mass_matrix(q + h * qd) - robot.mass_matrix(q - h * qd)) / (2 * h)


@given(tasks(), states, gains(2, 1, 90), gains(2, 0.5, 10))
def test_vdot_of_pd_plus(ideal_arm, task, state, K_p, K_v):
    """V = ½ėᵀMė + ½eᵀK_p e falls at −ėᵀK_v ė (Paden and Panja)."""
    q, qd, s = state
    law = PDPlus(ideal_arm, task, K_p, K_v)
    out = law.law(0.0, q, qd, np.array([s]))
    e, de = out.e_p, out.e_v
    _, dde = error_rates(law, out, q, qd)
    M, Mdot = ideal_arm.mass_matrix(q), mass_rate(ideal_arm, q, qd)
    rate = de @ M @ dde + 0.5 * de @ Mdot @ de + e @ (K_p * de)
    scale = 1 + abs(de @ M @ dde) + abs(de @ Mdot @ de) + abs(e @ (K_p * de))
    assert rate == pytest.approx(-de @ (K_v * de), abs=1e-7 * scale)


@given(tasks(), states, gains(2, 0.5, 20), gains(2, 0.5, 20))
def test_vdot_of_slotine_li(ideal_arm, task, state, Lambda, K_d):
    """V = ½sᵀMs falls at −sᵀK_d s with s = ė + Λe (Slotine and Li)."""
    q, qd, sigma = state
    law = SlotineLi(ideal_arm, task, Lambda, K_d)
    out = law.law(0.0, q, qd, np.array([sigma]))
    _, dde = error_rates(law, out, q, qd)
    s, ds = out.e_v + Lambda * out.e_p, dde + Lambda * out.e_v
    M, Mdot = ideal_arm.mass_matrix(q), mass_rate(ideal_arm, q, qd)
    rate = s @ M @ ds + 0.5 * s @ Mdot @ s
    scale = 1 + abs(s @ M @ ds) + abs(s @ Mdot @ s)
    assert rate == pytest.approx(-s @ (K_d * s), abs=1e-7 * scale)


@pytest.mark.parametrize(
    "make",
    [
        lambda arm, task: ComputedTorque(arm, task, 100.0, 20.0),
        lambda arm, task: PDPlus(arm, task, [200.0, 20.0], [40.0, 4.0]),
        lambda arm, task: SlotineLi(arm, task, 10.0, [40.0, 4.0]),
        lambda arm, task: ExtendedMotionPlan(arm, task, 100.0, 20.0, 5.0),
        lambda arm, task: Projection(arm, task, 100.0, 20.0),
    ],
)
def test_every_law_converges_without_unmodelled_friction(ideal_arm, circle, make):
    run = simulate(make(ideal_arm, circle), START, duration=3.2, loop=ContinuousTime(1e-2), progress=False)
    assert run.norm("e_p")[0, -1] < 1e-6
    assert run.norm("e_v")[0, -1] < 1e-5


# --- the two limits of the extended motion plan ---------------------------------------------------------------


class Uneven(Circle):
    """A circle taken at an uneven rate, so that the motion plan is not trivial."""

    at = PathTask.at

    def theta(self, s):
        return 1.5 + 0.5 * np.cos(2 * s)

    def dtheta(self, s):
        return -np.sin(2 * s)


@pytest.mark.parametrize("loop", [SampledLoop(), ContinuousTime(1e-2)])
def test_k_0_is_motion_control(ideal_arm, loop):
    task = Uneven(0.8, 1.0)
    motion = ComputedTorque(ideal_arm, task, 100.0, 20.0)
    path = ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, 0.0)
    a, b = (simulate(c, START, duration=2.0, loop=loop, progress=False) for c in (motion, path))
    assert np.abs(a.array("q") - b.array("q")).max() < 1e-9
    assert np.abs(a.array("s") - b.array("s")).max() < 1e-9


def test_the_motion_plan_solves_6(ideal_arm):
    """ṡ = ϑ(s): dt = ds/ϑ(s); the sampled plan is of second order in the period."""
    task, duration, errors = Uneven(0.8, 1.0), 2.0, []
    for period in (0.02, 0.01, 0.005):
        law = ComputedTorque(ideal_arm, task, 100.0, 20.0)
        run = simulate(law, START, duration=duration, loop=SampledLoop(period=period), progress=False)
        s = np.linspace(0, run.array("s")[0, -1], 20_001)
        errors.append(abs(np.trapezoid(1 / task.theta(s), s) - duration))
    assert 3.5 < errors[0] / errors[1] < 4.5
    assert 3.5 < errors[1] / errors[2] < 4.5


def test_k_to_infinity_is_the_projection_law(ideal_arm):
    task = Uneven(0.8, 1.0)
    limit = Projection(ideal_arm, task, 100.0, 20.0)
    reference = simulate(limit, START, duration=0.5, loop=ContinuousTime(1e-2), progress=False).array("q")
    distances = []
    for k in (1e2, 1e3, 1e4):
        law = ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, k, start="nearest")
        run = simulate(law, START, duration=0.5, loop=ContinuousTime(1e-2), progress=False)
        distances.append(np.abs(run.array("q") - reference).max())
    # σ − σ̄ is of order 1/k
    assert distances[0] / distances[1] == pytest.approx(10, rel=0.3)
    assert distances[1] / distances[2] == pytest.approx(10, rel=0.3)


@pytest.mark.parametrize("k", [1e2, 1e4, 1e8])
def test_the_sampled_plan_is_stable_for_any_k(ideal_arm, circle, k):
    """With the arm held still σ settles where ϑ = k e_pᵀq_d', near the projection, though k h is far beyond 2."""
    law = ExtendedMotionPlan(ideal_arm, circle, 100.0, 20.0, k)
    z, still = law.start(START, np.zeros(2)), np.zeros(2)
    for _ in range(400):
        z = law.advance(z, law.law(0.0, START, still, z), 2.5e-3)
    out = law.law(0.0, START, still, z)
    assert abs(out.sdot) < 1e-6 * k
    assert z[0] - circle.sigma_bar(START) == pytest.approx(circle.theta(z[0]) / (k * np.linalg.norm(START)), rel=0.05)


def test_the_sampled_plan_tends_to_the_sampled_projection_law(ideal_arm):
    """With k up to 25 times the inverse of the period, where an explicit step would be unstable from 2 on."""
    task = Uneven(0.8, 1.0)
    reference = simulate(Projection(ideal_arm, task, 100.0, 20.0), START, duration=2.0, progress=False).array("q")
    distances = []
    for k in (1e2, 1e3, 1e4):
        law = ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, k, start="nearest")
        distances.append(np.abs(simulate(law, START, duration=2.0, progress=False).array("q") - reference).max())
    assert distances[0] / distances[1] == pytest.approx(10, rel=0.3)
    # from there on the error of the sampled loop itself is larger: still less than the arm moves in one period
    assert distances[2] < 2.5e-3 * 2.0


def test_the_sampled_plan_is_second_order_along_a_moving_arm(ideal_arm, circle):
    """σ after a given motion of the arm, q(t) known, against σ̇ = ϑ − k e_pᵀq_d' integrated finely."""
    law, speed, errors = ExtendedMotionPlan(ideal_arm, circle, 100.0, 20.0, 30.0), 1.4, []

    def after(period):
        z = np.array([0.3])
        for t in np.arange(round(0.5 / period)) * period:
            angle, rate = speed * t + 0.2 * np.sin(9 * t), speed + 1.8 * np.cos(9 * t)
            q = 0.7 * np.array([np.cos(angle), np.sin(angle)])
            qd = 0.7 * rate * np.array([-np.sin(angle), np.cos(angle)])
            z = law.advance(z, law.law(t, q, qd, z), period)
        return z[0]

    exact = after(5e-4)
    errors = [abs(after(period) - exact) for period in (0.02, 0.01, 0.005)]
    assert 3.3 < errors[0] / errors[1] < 4.7
    assert 3.3 < errors[1] / errors[2] < 4.7


@given(floats(-6, 4), floats(0.2, 0.8), floats(-0.1, 0.1), floats(-0.5, 0.5), floats(1e-4, 0.1))
def test_a_step_of_the_plan_is_exact_where_its_rate_is_linear(ideal_arm, exponent, s, gap, rate, period):
    """On a line at constant speed, from (22): ė = ϑ − v − ke for the plan's lead e, for any gain and period."""
    task, k = Line([0.0, 0.0], [1.0, 0.0], 0.5), 10.0**exponent
    law, z, theta = ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, k), np.array([s]), float(task.theta(0.5))
    out = law.law(0.0, np.array([s - gap, 0.0]), np.array([rate, 0.0]), z)
    lead = gap * np.exp(-k * period) - (theta - rate) * np.expm1(-k * period) / k
    assert law.advance(z, out, period)[0] == pytest.approx(s - gap + rate * period + lead, rel=1e-12)


def test_the_plan_waits_at_the_beginning_of_an_open_path(ideal_arm):
    """An arm behind the start that comes nearer leaves σ exactly where it is until the path begins."""
    task = Line([0.0, 0.0], [1.0, 0.0], 0.5)
    law = ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, 20.0)
    q, qd, z = np.array([-0.5, 0.0]), np.array([2.0, 0.0]), np.array([0.0])
    assert law.advance(z, law.law(0.0, q, qd, z), 2.5e-3)[0] == 0.0


# --- one law for one arm and for many -----------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_many_are_as_one(arm, shape):
    rng = np.random.default_rng(0)
    task = Uneven(0.8, 1.0)
    q, qd = rng.normal(size=(2, *shape, 2))
    laws = [
        ComputedTorque(arm, task, 100.0, 20.0, friction="full"),
        PDPlus(arm, task, 100.0, 20.0),
        SlotineLi(arm, task, 10.0, 20.0, friction="none"),
        ExtendedMotionPlan(arm, task, 100.0, 20.0, 5.0),
        Projection(arm, task, 100.0, 20.0),
    ]
    for law in laws:
        z = law.start(q, qd)
        assert z.shape == (*shape, 1)
        out = law.law(0.0, q, qd, z)
        after = law.advance(z, out, 2.5e-3)
        assert after.shape == z.shape
        for index in np.ndindex(*shape):
            single = law.law(0.0, q[index], qd[index], z[index])
            assert np.array_equal(single.tau, out.tau[index])
            assert single.s == out.s[index]
            assert np.array_equal(law.advance(z[index], single, 2.5e-3), after[index])


def test_gains_may_differ_between_rollouts(ideal_arm, circle):
    K_p = np.array([[50.0, 60.0], [400.0, 500.0]])
    both = ExtendedMotionPlan(ideal_arm, circle, K_p, 20.0, [0.0, 9.0])
    run = simulate(both, [START, START], duration=0.5, progress=False)
    for i, k in enumerate((0.0, 9.0)):
        alone = simulate(ExtendedMotionPlan(ideal_arm, circle, K_p[i], 20.0, k), START, duration=0.5, progress=False)
        assert np.array_equal(alone.array("q")[0], run.array("q")[i])
