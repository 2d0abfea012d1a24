"""Where the paper is loose: one test for each line of docs/errata.md. What is printed fails, what we use holds."""

from __future__ import annotations

import numpy as np
import pytest

from pathcontrol import Circle, ExtendedMotionPlan, Projection, SampledLoop, distance_to_gamma, simulate

J = np.array([[0.0, -1.0], [1.0, 0.0]])
R_0, V_0, K_P, K_V = 1.0, 2.0, 800.0, np.array([45.0, 100.0])


def printed_turning_rate(q, qd):
    """√(‖q‖²‖q̇‖² − (qᵀq̇)²)/‖q‖², as printed below (39) and in S."""
    return np.sqrt((q @ q) * (qd @ qd) - (q @ qd) ** 2) / (q @ q)


def signed_turning_rate(q, qd):
    """θ̇ = (q1 q̇2 − q2 q̇1)/‖q‖²."""
    return (q[0] * qd[1] - q[1] * qd[0]) / (q @ q)


def vdot_error(turning, q, qd):
    """V̇ along the closed loop minus −e_vᵀK_v e_v, when the law feeds forward with the given turning rate."""
    unit = q / np.linalg.norm(q)
    e_p, e_v = R_0 * unit - q, V_0 * J @ unit - qd
    qdd = -V_0 * unit * turning + K_V * e_v + K_P * e_p
    true = signed_turning_rate(q, qd)
    e_p_rate, e_v_rate = R_0 * true * J @ unit - qd, -V_0 * unit * true - qdd
    return e_v @ e_v_rate + K_P * e_p @ e_p_rate + e_v @ (K_V * e_v)


@pytest.mark.parametrize("seed", range(20))
def test_the_printed_square_root_loses_the_sign_of_the_turning_rate(seed):
    q, qd = np.random.default_rng(seed).normal(size=(2, 2))
    printed, signed = printed_turning_rate(q, qd), signed_turning_rate(q, qd)
    assert printed == pytest.approx(abs(signed))
    assert abs(vdot_error(signed, q, qd)) < 1e-9 * K_P
    if signed < 0:  # clockwise: V̇ is wrong by −e_vᵀq/‖q‖ v_0 · 2|θ̇|
        unit = q / np.linalg.norm(q)
        excess = 2 * V_0 * printed * (V_0 * J @ unit - qd) @ unit
        assert vdot_error(printed, q, qd) == pytest.approx(excess, rel=1e-6, abs=1e-9 * K_P)
        assert abs(excess) > 1e-3
    else:
        assert abs(vdot_error(printed, q, qd)) < 1e-9 * K_P


class PrintedProjection(Projection):
    """The law with |θ̇| in place of θ̇."""

    def project(self, q, qd, near):
        found = super().project(q, qd, near)
        turning = (q[..., 0] * qd[..., 1] - q[..., 1] * qd[..., 0])[..., None]
        return found._replace(position_gradient=found.position_gradient * np.where(turning < 0, -1.0, 1.0))


def test_round_a_clockwise_circle_the_printed_square_root_leaves_an_error(ideal_arm):
    """The feedforward points outwards: v²/ρ = −v²/ρ + k_p(ρ − r), so that ρ(ρ − r) = 2v²/k_p."""
    task, start = Circle(R_0, V_0, clockwise=True), np.array([1.0, -0.1])
    off = 0.5 * (np.sqrt(R_0**2 + 8 * V_0**2 / K_P) - R_0)
    loop = SampledLoop(period=1e-3)
    for law, expected in ((PrintedProjection, off), (Projection, 0.0)):
        run = simulate(law(ideal_arm, task, K_P, K_V), start, [0.0, -V_0], duration=1.5, loop=loop, progress=False)
        radius = np.linalg.norm(run.array("q")[0, -200:], axis=-1)
        assert np.allclose(radius - R_0, expected, atol=1e-4)  # torques are held for 1 ms
    ahead = Circle(R_0, V_0)
    runs = [
        simulate(law(ideal_arm, ahead, K_P, K_V), [1.0, 0.1], [0.0, V_0], duration=0.1, progress=False).array("q")
        for law in (PrintedProjection, Projection)
    ]
    assert np.allclose(*runs, atol=1e-12)  # the arm turns as the path does


def test_both_turning_directions_were_tried():
    turns = [signed_turning_rate(*np.random.default_rng(seed).normal(size=(2, 2))) for seed in range(20)]
    assert min(turns) < 0 < max(turns)


def test_our_projection_law_feeds_forward_with_the_signed_rate(ideal_arm):
    law = Projection(ideal_arm, Circle(R_0, V_0), K_P, K_V)
    for q, qd in np.random.default_rng(0).normal(size=(50, 2, 2)):
        assert law.law(0.0, q, qd, law.start(q, qd)).sdot == pytest.approx(signed_turning_rate(q, qd))


def test_the_arctangent_of_30_needs_two_arguments():
    task, q = Circle(R_0, V_0), np.array([-0.6, -0.3])
    one_argument = np.arctan(q[1] / q[0])
    nearest = R_0 * q / np.linalg.norm(q)
    assert np.allclose(task.q_d(one_argument), -nearest)  # the opposite side of the circle
    assert np.allclose(task.q_d(task.sigma_bar(q)), nearest)


def test_the_projection_is_undefined_at_the_centre_and_the_run_says_so(arm):
    law = Projection(arm, Circle(R_0, V_0), K_P, K_V)
    out = law.law(0.0, np.zeros(2), np.array([0.3, -0.2]), np.array([1.25]))
    assert not out.regular
    assert out.s == 1.25  # the last one is kept
    assert np.isfinite(out.tau).all()
    run = simulate(law, [0.0, 0.0], duration=2.0, loop=SampledLoop(torque_limits=True), progress=False)
    assert not run.array("regular")[0, 0]
    assert run.array("regular")[0, -1]
    assert all(np.isfinite(run.array(name)).all() for name in run.data.data_vars)
    assert run.norm("e_p")[0, -1] < np.deg2rad(3)


def test_32_with_the_rate_of_sigma_bar_does_not_give_34():
    task, q, qd = Circle(R_0, V_0), np.array([0.8, 0.5]), np.array([0.3, 0.9])
    s = task.sigma_bar(q)
    e_v_34 = V_0 * J @ q / np.linalg.norm(q) - qd
    assert np.allclose(task.dq_d(s) * task.theta(s) - qd, e_v_34)
    assert not np.allclose(task.dq_d(s) * signed_turning_rate(q, qd) - qd, e_v_34, atol=0.1)


@pytest.mark.parametrize("qd", [[0.0, -V_0], [V_0, 0.0], [-V_0, 0.0]])
def test_gamma_of_27_admits_reversed_and_radial_velocities(qd):
    q = np.array([R_0, 0.0])
    assert np.linalg.norm(q) == R_0
    assert np.linalg.norm(qd) == V_0  # so (27) holds, yet (11) is far away
    assert distance_to_gamma(Circle(R_0, V_0), q, np.array(qd)) > 1.0
    assert distance_to_gamma(Circle(R_0, V_0), q, np.array([0.0, V_0])) < 1e-12


def test_sigma_is_unbounded_and_starts_at_s0_unless_asked_otherwise(ideal_arm):
    task, q = Circle(R_0, V_0), np.array([0.5, 0.8])
    law = ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, 5.0)
    run = simulate(law, q, duration=7.0, progress=False)
    assert run.array("s")[0, 0] == 0
    assert run.array("s")[0, -1] > 2 * task.period  # laps are counted: σ is not wrapped
    nearest = ExtendedMotionPlan(ideal_arm, task, 100.0, 20.0, 5.0, start="nearest")
    assert nearest.start(q, 0 * q)[0] == pytest.approx(task.sigma_bar(q))
