"""The speed input of a law: the theorems at any speed, ramps in closed form, hold, resume, override and reverse."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from given_speed import Given
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson
from strategies import floats, gains, tasks, vectors

import pathcontrol as pc
from pathcontrol.analysis.lyapunov_functions import extended_motion_plan_lyapunov, projection_lyapunov

START = np.deg2rad([40.0, 70.0])
GAINS = {"K_p": 800.0, "K_v": [45.0, 100.0]}
states = st.tuples(vectors(2, 2.0), vectors(2, 4.0), floats(0, 6))


def error_rates(law, out, q, qd, w, wdot):
    """ė_p = q_d'ṡ − q̇ and ė_v = d(wr)/dt − q̈ along the closed loop of an arm with viscous friction."""
    point, robot = law.task.at(out.s), law.robot
    qdd = robot.forward_dynamics(q, qd, out.tau - robot.friction.viscous * qd)
    return point.dq_d * out.sdot - qd, w * point.velocity_slope * out.sdot + wdot * point.velocity - qdd


@given(tasks(), states, gains(2, 1, 900), gains(2, 0.5, 100), floats(0, 50), floats(-2, 2), floats(-9, 9))
def test_vdot_of_the_extended_motion_plan_at_any_speed(ideal_arm, task, state, K_p, K_v, k, w, wdot):
    assume(abs(w) > 1e-3)
    q, qd, s = state
    law = pc.LawWrapper(pc.ExtendedMotionPlan(ideal_arm, task, K_p, K_v, k), Given(w, wdot))
    out = law.law(0.0, q, qd, np.array([s, 1.0, 0.0, w]))
    e_p_rate, e_v_rate = error_rates(law, out, q, qd, w, wdot)
    V, Vdot = extended_motion_plan_lyapunov(law.inner.at_speed(np.array(w)), out.s, out.e_p, out.e_v)
    along_the_loop = out.e_p @ e_p_rate + out.e_v / law.K_p @ e_v_rate
    terms = np.abs(out.e_p * e_p_rate).sum() + np.abs(out.e_v / law.K_p * e_v_rate).sum()
    assert abs(along_the_loop - Vdot) < 1e-9 * (1 + terms)
    assert Vdot <= 0 <= V


@given(tasks(), states, floats(1, 900), gains(2, 0.5, 100), floats(-2, 2), floats(-9, 9))
def test_vdot_of_the_projection_law_at_any_speed(ideal_arm, task, state, k_p, K_v, w, wdot):
    q, qd, _ = state
    law = pc.LawWrapper(pc.Projection(ideal_arm, task, k_p, K_v), Given(w, wdot))
    z = law.start(q, qd)
    out = law.law(0.0, q, qd, z)
    assume(bool(out.regular))
    e_p_rate, e_v_rate = error_rates(law, out, q, qd, w, wdot)
    along_the_loop = out.e_v @ e_v_rate + k_p * out.e_p @ e_p_rate
    terms = np.abs(out.e_v * e_v_rate).sum() + k_p * np.abs(out.e_p * e_p_rate).sum()
    V, Vdot = projection_lyapunov(law.inner, out.e_p, out.e_v)
    assert abs(along_the_loop - Vdot) < 1e-9 * (1 + terms)
    assert Vdot <= 0 <= V


@given(tasks(), states, floats(-2, 2), floats(-9, 9))
def test_torque_is_affine_in_the_rate_with_the_gradient_of_its_rules(ideal_arm, task, state, w, wdot):
    q, qd, s = state
    for inner in (pc.ComputedTorque(ideal_arm, task, 9.0, 6.0), pc.PDPlus(ideal_arm, task, 9.0, 6.0)):
        slow, fast = (
            pc.LawWrapper(inner, Given(w, rate)).law(0.0, q, qd, np.array([s, 1.0, 0.0, w])) for rate in (0, wdot)
        )
        expected = wdot * ideal_arm.mass_matrix(q) @ task.at(np.array([s])).velocity[0]
        np.testing.assert_allclose(fast.tau - slow.tau, expected, rtol=0, atol=1e-9 * (1 + np.abs(slow.tau).max()))


def path_laws(arm, task, **options):
    return pc.ExtendedMotionPlan(arm, task, **GAINS, k=20.0, **options), pc.Projection(
        arm, task, k_p=800.0, K_v=[45.0, 100.0], **options
    )


def paper_loop(**settings):
    return pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True, **settings)


def run(law, q=START, **settings):
    return pc.simulate(law, q, progress=False, **{"loop": paper_loop()} | settings)


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_the_full_speed_is_the_law_itself(arm, engine):
    for law in (
        *path_laws(arm, pc.Circle(1.0, 2.0)),
        pc.ComputedTorque(arm, pc.Line([0.1, 0], [1.0, 1.2], 1.0), **GAINS),
    ):
        plain, wrapped = run(law, duration=0.5, engine=engine), run(pc.SpeedOverride(law), duration=0.5, engine=engine)
        for name in ("q", "s", "sdot", "e_v"):
            np.testing.assert_allclose(wrapped.array(name), plain.array(name), rtol=0, atol=1e-9)


def test_a_step_of_a_free_override_is_its_closed_form(ideal_arm):
    """Far from its bound w − u = (1 + t/2T)exp(−t/2T), whatever the period."""
    law = pc.SpeedOverride(pc.ComputedTorque(ideal_arm, pc.Circle(1.0, 2.0), 400.0, 40.0), [[0.25, 0.0]], 1e3)
    for period in (2.5e-3, 1e-2):
        held = run(law, duration=0.8, loop=pc.SampledLoop(period))
        t = np.maximum(held.time - 0.25, 0.0) / 0.04
        np.testing.assert_allclose(pc.speed_factor(held)[0], (1 + t) * np.exp(-t), rtol=0, atol=1e-6)


@pytest.mark.parametrize("a", [2.0, 8.0, 400.0])
def test_a_hold_is_a_ramp_within_its_bound_and_the_plan_its_integral(ideal_arm, a):
    law = pc.SpeedOverride(pc.ComputedTorque(ideal_arm, pc.Circle(1.0, 2.0), 400.0, 40.0), [[0.2, 0.0]], a)
    held = run(law, duration=1.2 + 1 / a, loop=pc.SampledLoop(1e-3))
    after, w = held.time[200:] - 0.2, pc.speed_factor(held)[0, 200:]
    rate = np.diff(w) / 1e-3
    assert (np.abs(rate) <= a * (1 + 1e-9)).all()
    assert (rate <= 1e-9).all()
    assert (np.abs(np.diff(rate)) <= a * 1e-3 / 0.02 * (1 + 1e-9) + 1e-9).all()
    assert w[after > 1 / a + 0.8].max() < 1e-6
    assert w[after < 1 / a].min() > 0
    s = held.array("s")[0, 200:]
    middle = s[0] + np.concatenate([[0.0], np.cumsum(1e-3 * (w[1:] + w[:-1]))])
    np.testing.assert_allclose(s, middle, rtol=0, atol=1e-6 * 2.0 / 0.02)  # h²ϑ/T
    assert np.abs(held.array("e_p")[0, -1]).max() < 1e-6
    assert np.abs(held.array("qd")[0, -1]).max() < 1e-6


@pytest.mark.parametrize("which", [0, 1])
def test_v_falls_as_the_theorem_says_while_an_operator_plays(ideal_arm, which):
    def u(t):
        return 1.2 * np.cos(8.0 * t)

    law = pc.SpeedOverride(path_laws(ideal_arm, pc.Ellipse([1.0, 0.6], 1.5))[which], u, acceleration=8.0)
    played = run(law, duration=0.48, loop=pc.ContinuousTime(output_period=2e-3))
    V, Vdot = (part[0] for part in pc.lyapunov(law, played))
    change = cumulative_simpson(Vdot, dx=2e-3, initial=0)
    np.testing.assert_allclose(V, V[0] + change, rtol=0, atol=2e-4 * V[0])
    assert (Vdot <= 0).all()
    assert pc.speed_factor(played).min() < -0.9


@pytest.mark.parametrize("which", [0, 1])
def test_holding_and_resuming_does_not_leave_the_path(arm, which):
    task = pc.Circle(1.0, 2.0)
    law = path_laws(arm, task)[which]
    start = {"q": task.q_d(np.zeros(1)), "qd": task.at(np.zeros(1)).velocity}
    plain = run(law, duration=5.0, **start)
    held = run(pc.SpeedOverride(law, [[1.0, 0.0], [1.6, 1.0], [2.4, 0.0], [2.5, 1.0]]), duration=3.2, **start)
    late = [one.time > 0.7 for one in (plain, held)]
    without, within = (pc.contour_error(one)[0, when].max() for one, when in zip((plain, held), late, strict=True))
    assert within < 1.02 * without  # at other moments a joint may stick a little longer
    demands = [one.array("tau_demand")[0, when] for one, when in zip((plain, held), late, strict=True)]
    jumps = [np.abs(np.diff(demand, axis=0)).max() for demand in demands]
    largest = 2 * 10.0 * 2.5e-3 / 0.02 * np.abs(arm.mass_matrix(np.zeros(2))).sum(1).max() * 2.0  # 2a h/T M r
    assert jumps[1] < jumps[0] + largest


@pytest.mark.parametrize("which", [0, 1])
def test_a_held_plan_stays_whatever_pushes_the_arm(arm, which):
    """Nothing winds up: the state after a long hold is that after a short one, and so is what follows."""
    law = path_laws(arm, pc.Circle(1.0, 2.0))[which]
    heavy = arm.with_masses({arm.joint_names[1]: 1.5})
    push = pc.Push([6.0, 0.5], 1.5, 1e9)
    until = np.array([2.5, 4.0])
    override = pc.SpeedOverride(law, lambda t: np.where((t >= 1.0) & (t < until), 0.0, 1.0))
    held = run(override, np.tile(START, (2, 1)), duration=5.2, plant=heavy, disturbance=push)
    ends = []
    for s, error, end in zip(held.array("s"), pc.contour_error(held), until, strict=True):
        during = (held.time > 2.0) & (held.time < end)
        assert np.ptp(s[during]) < 1e-8
        ends.append(s[np.searchsorted(held.time, end + 1.2)] - s[during][-1])
        assert np.abs(error[during]).max() < np.deg2rad(1.5)
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)
    assert ends[0] > 1.0


@pytest.mark.parametrize("which", [0, 1])
def test_reversing_reaches_the_start_again_and_stops_there(arm, which):
    task = pc.Line([0.2, 0.1], [1.2, 1.4], 1.0)
    law = pc.SpeedOverride(path_laws(arm, task)[which], [[0.6, -1.0], [2.2, 1.0]])
    there = run(law, task.q_d(np.array(0.0)), duration=5.0, until="duration")
    s, w = there.array("s")[0], pc.speed_factor(there)[0]
    back = np.searchsorted(there.time, 2.2) - 1
    np.testing.assert_allclose(there.array("q")[0, back], task.q_d(np.array(task.s0)), rtol=0, atol=0.03)
    assert s[back] == pytest.approx(task.s0, abs=1e-3)
    assert s.min() >= task.s0
    assert s[-1] == pytest.approx(task.s_end, abs=1e-3)
    assert np.abs(np.diff(w)).max() < 2.5e-3 * 11  # the brakes of both ends have T = 0.1 s
    assert np.abs(there.array("qd")[0, [back, -1]]).max() < 1e-2


@pytest.mark.parametrize("which", [0, 1])
def test_rows_of_overrides_are_runs_of_their_own(arm, which):
    law = path_laws(arm, pc.Circle(1.0, 2.0))[which]
    together = run(pc.SpeedOverride(law, [0.5, 0.0, -1.0]), duration=0.5)
    assert together.rollouts == 3
    for row, u in enumerate([0.5, 0.0, -1.0]):
        alone = run(pc.SpeedOverride(law, u), duration=0.5)
        np.testing.assert_array_equal(together.array("q")[row], alone.array("q")[0])
    function = run(pc.SpeedOverride(law, lambda t: np.array([0.5, 0.0, -1.0])), duration=0.5)
    np.testing.assert_array_equal(function.array("q"), together.array("q"))


def test_the_operators_buttons_in_a_control_tick(ideal_arm):
    arm = ideal_arm
    law = pc.SpeedOverride(path_laws(arm, pc.Circle(1.0, 2.0))[0])
    tick, plant = pc.ControlTick(law, 5e-3), pc.Plant(arm, 5e-3)
    q, qd = law.task.q_d(np.zeros(1)), np.zeros((1, 2))
    tick.start(q[0], qd[0])

    def go(seconds):
        nonlocal q, qd
        first = tick.s
        for _ in range(round(seconds / 5e-3)):
            q, qd = plant.advance(q, qd, tick(q[0], qd[0])[None])
        return tick.s - first

    full = go(1.0)
    assert full == pytest.approx(2.0, abs=0.1)
    tick.hold()
    go(1.0)
    assert go(1.0) == pytest.approx(0.0, abs=1e-7)
    tick.override(0.5)
    assert go(1.0) == pytest.approx(0.0, abs=1e-9)  # held it stays held
    tick.resume()
    go(0.5)
    assert go(1.0) == pytest.approx(1.0, abs=0.1)
    tick.reverse()
    go(1.0)
    assert go(1.0) == pytest.approx(-1.0, abs=0.1)
    tick.override(2.0)
    tick.resume()
    go(2.0)
    assert go(1.0) == pytest.approx(4.0, abs=0.1)
    with pytest.raises(pc.InputError, match="SpeedOverride"):
        pc.ControlTick(law.inner, 2.5e-3).hold()


def test_laws_with_a_speed_input_can_be_sent_to_other_processes(arm):
    for u in (0.5, [[0.1, 0.0]], np.cos):
        law = pc.Paced(pc.SpeedOverride(path_laws(arm, pc.Circle(1.0, 9.0))[0], u))
        there = pickle.loads(pickle.dumps(law))
        np.testing.assert_array_equal(run(there, duration=0.25).array("q"), run(law, duration=0.25).array("q"))


def test_bad_overrides_are_told(arm):
    law = path_laws(arm, pc.Circle(1.0, 2.0))[0]
    for bad in (2.1, -3.0, np.nan, [[0.0, 5.0]], [[1.0, 0.0], [0.5, 1.0]], [[0.0, 1.0, 2.0]], "fast", [0.5, 9.0], []):
        with pytest.raises(pc.InputError, match="override"):
            pc.SpeedOverride(law, bad)
        with pytest.raises(pc.InputError, match="override"):
            pc.SpeedOverride(law).override(bad)
    for bad in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(pc.InputError, match="acceleration"):
            pc.SpeedOverride(law, 1.0, bad)
    with pytest.raises(pc.InputError, match=r"t = 0\.5 s"):
        run(pc.SpeedOverride(law, lambda t: 1.0 if t < 0.5 else 3.0), duration=1.0)
    with pytest.raises(pc.InputError, match=r"reverse\(\)"):
        pc.SpeedOverride(law).override(-0.5)
    with pytest.raises(pc.InputError, match="reverse"):
        pc.SpeedOverride(law).override([0.5, -0.5])
    with pytest.raises(pc.InputError, match="2 values for 1 rollouts"):
        run(pc.SpeedOverride(law, lambda t: 1.0 if t < 0.5 else [1.0, 0.5]), duration=1.0)
    with pytest.raises(pc.InputError, match="expected a Controller"):
        pc.SpeedOverride(law.task)
