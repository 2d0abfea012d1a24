"""The pace within torque limits: the fast circle, other arms, traps, and the theorem along paced runs."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import floats, tasks

import pathcontrol as pc
from pathcontrol.control.wrappers.pace_rule import rate_bounds
from pathcontrol.simulation.compiled_plant import CompiledPlant

LIMITS = np.array([150.0, 15.0])
LOOPS = {
    "exact": pc.SampledLoop(torque_limits=True),
    "encoders": pc.SampledLoop(encoders=True, velocity="difference", torque_limits=True),
}
LAWS = ("extended_motion_plan", "projection")


def make_law(name, arm, task):
    if name == "projection":
        return pc.Projection(arm, task, k_p=800.0, K_v=[45.0, 100.0])
    return pc.ExtendedMotionPlan(arm, task, K_p=800.0, K_v=[45.0, 100.0], k=20.0)


def run(law, **settings):
    begin = law.task.q_d(np.array(law.task.s0))
    return pc.simulate(law, begin, progress=False, **{"duration": 1.8, "loop": LOOPS["exact"]} | settings)


def late_contour(one):
    """The largest contour error [deg] in the second half."""
    return np.rad2deg(pc.contour_error(one)[0, len(one.time) // 2 :].max())


def lap_time(one):
    half, s = len(one.time) // 2, one.array("s")[0]
    return 2 * np.pi * (one.time[-1] - one.time[half]) / (s[-1] - s[half])


@pytest.mark.parametrize(("name", "loop"), list(zip(LAWS, LOOPS, strict=True)))
def test_the_circle_that_the_motors_cannot_do(arm, name, loop):
    """A lap asked in 0.571 s takes 0.673 s at least."""
    law = make_law(name, arm, pc.Circle(1.0, 11.0))
    paced = run(pc.Paced(law), loop=LOOPS[loop])
    assert late_contour(paced) < 1.5
    assert 0.673 < lap_time(paced) < 0.74
    assert late_contour(run(law, loop=LOOPS[loop])) > 5.5


@pytest.mark.parametrize("name", LAWS)
def test_where_the_motors_can_the_pace_changes_nothing(arm, name):
    law = make_law(name, arm, pc.Circle(1.0, 6.0))
    plain, paced = run(law), run(pc.Paced(law))
    assert late_contour(paced) < 1.005 * late_contour(plain)
    assert lap_time(paced) == pytest.approx(lap_time(plain), rel=2e-3)
    assert pc.contour_error(paced).max() < 1.005 * pc.contour_error(plain).max()


def test_the_pace_is_the_speed_that_is_asked_for_or_the_fastest_one(arm):
    task = pc.Circle(1.0, 11.0)
    law = pc.Paced(pc.ComputedTorque(arm.with_friction(pc.Viscous(arm.friction.viscous)), task, 800.0, [45.0, 100.0]))
    paced = run(law, plant=law.robot)
    w, s = pc.speed_factor(paced)[0], paced.array("s")[0]
    fastest = task.with_profile(pc.time_optimal(law.robot, task, velocity=None, margin=0.1))
    late = paced.time > 1.4
    largest = fastest.theta(s[late]) / 11.0
    short = np.minimum(1.0, largest) - w[late]
    # ẇ ≤ ẇ_max + (w_max − w)/T rounds the corner at which a falling w_max passes 1, by T|ẇ_max|/e
    rounded = 0.02 / np.e * -np.gradient(largest, paced.time[late]).min()
    assert -0.02 < short.min() < short.max() < rounded + 2e-3
    assert w[0] == 0.0
    assert (np.abs(paced.array("tau_demand")[0]) <= LIMITS * (1 + 1e-9)).all()


@pytest.mark.parametrize("name", LAWS)
def test_v_falls_as_the_theorem_says_along_a_paced_run(ideal_arm, name):
    law = pc.Paced(make_law(name, ideal_arm, pc.Circle(1.0, 11.0)))
    near = law.task.q_d(np.array(0.0)) + np.array([0.05, -0.05])
    paced = pc.simulate(law, near, duration=0.4, loop=pc.SampledLoop(4e-4), progress=False)
    V, Vdot = (part[0] for part in pc.lyapunov(law, paced))
    change = np.concatenate([[0.0], np.cumsum(2e-4 * (Vdot[1:] + Vdot[:-1]))])
    np.testing.assert_allclose(V, V[0] + change, rtol=0, atol=0.02 * V[0])  # of order h
    assert (Vdot <= 1e-15).all()
    w = pc.speed_factor(paced)[0]
    assert w.max() < 1.02
    assert np.ptp(w[w.size // 2 :]) > 0.1


@pytest.mark.parametrize("name", LAWS)
def test_a_paced_open_path_begins_and_ends_at_rest_within_the_limits(arm, name):
    task = pc.Line([-0.8, -0.6], [1.0, 1.4], speed=12.0)
    law = pc.Paced(make_law(name, arm, task))
    there = run(law)
    assert there.status[0] == "finished"
    np.testing.assert_allclose(there.array("q")[0, -1], task.q_d(np.array(task.s_end)), rtol=0, atol=0.03)
    assert late_contour(there) < 1.5
    assert np.rad2deg(pc.contour_error(there).max()) < 1.5


@pytest.mark.parametrize(("name", "order"), list(zip(LAWS, ("outside", "inside"), strict=True)))
def test_an_operator_slows_holds_and_reverses_a_paced_law(arm, name, order):
    u = [[0.7, 0.0], [1.7, -1.0], [2.6, 0.5]]
    law = make_law(name, arm, pc.Circle(1.0, 11.0))
    both = pc.SpeedOverride(pc.Paced(law), u) if order == "outside" else pc.Paced(pc.SpeedOverride(law, u))
    assert [type(rule).__name__ for rule in both.rules][-1] == "PaceRule"
    played = run(both, duration=3.9)
    t, w = played.time, pc.speed_factor(played)[0]
    assert np.abs(w[(t > 1.6) & (t < 1.7)]).max() < 1e-4
    assert w[(t > 2.4) & (t < 2.5)].max() < -0.7
    assert w[t > 3.7] == pytest.approx(0.5, abs=1e-3)
    assert np.rad2deg(pc.contour_error(played).max()) < 1.7
    assert np.abs(np.diff(w)).max() < 0.25


def test_plans_that_go_on_and_back_in_one_batch_are_what_they_are_alone(arm):
    """At 11 rad/s both are bounded, each by the fastest motion in its own direction."""

    def played(later):
        override = lambda t: later if t > 0.05 else np.ones_like(later)  # noqa: E731
        law = pc.Paced(pc.SpeedOverride(make_law("projection", arm, pc.Circle(1.0, 11.0)), override, 20.0))
        q = np.tile([1.0, 0.0], (len(later), 1))
        return pc.simulate(law, q, duration=0.6, loop=LOOPS["exact"], engine="pinocchio", progress=False)

    together = played(np.array([1.0, -1.0]))
    for row, later in enumerate((1.0, -1.0)):
        alone = played(np.array([later]))
        np.testing.assert_allclose(together.array("q")[row], alone.array("q")[0], rtol=0, atol=1e-12)
    assert pc.speed_factor(alone)[0, -1] < -0.5


class Uneven(pc.Circle):
    """A circle whose profile rises and falls three times a lap, faster than motors can follow."""

    def theta(self, s):
        return self.speed * (1 + 0.9 * np.cos(3 * s))

    def dtheta(self, s):
        return -2.7 * self.speed * np.sin(3 * s)


@pytest.mark.parametrize("name", LAWS)
def test_a_profile_that_falls_faster_than_motors_can_brake_is_no_trap(arm, name):
    """Where w comes down from more than 1 and w_max falls below 1, it has to brake before; there is no friction."""
    law = pc.Paced(make_law(name, arm.with_friction(None), Uneven(1.0, 20.0)))
    assert np.rad2deg(pc.contour_error(run(law, plant=law.robot)).max()) < 1.0


@pytest.mark.parametrize("name", LAWS)
def test_turning_round_keeps_the_torque_limits(arm, name):
    """An operator asks for more than the motors can do: the pace waits, on its path as near as without turning."""
    law, played = make_law(name, arm.with_friction(None), pc.Circle(1.0, 11.0)), [[0.5, -1.0], [1.0, 1.0], [1.4, -2.0]]
    steady, turned = (
        run(pc.Paced(pc.SpeedOverride(law, u, acceleration=30.0)), plant=law.robot) for u in (1.0, played)
    )
    assert (np.abs(turned.array("tau_demand")[0]) <= LIMITS * (1 + 1e-9)).all()
    assert np.ptp(np.sign(pc.speed_factor(turned)[0])) == 2
    assert pc.contour_error(turned).max() < 1.1 * pc.contour_error(steady).max()


def test_an_arm_that_is_moving_is_met_at_its_speed(arm):
    task = pc.Circle(1.0, 6.0)
    law = pc.Paced(make_law("extended_motion_plan", arm, task))
    point = task.at(np.array([0.0]))
    z = law.start(point.q_d[0], 0.5 * point.velocity[0])
    assert z[-1] == pytest.approx(0.5)
    assert law.start(point.q_d[0], -point.velocity[0])[-1] == 0.0
    fast = law.start(point.q_d[0], 9 * point.velocity[0])[-1]
    assert fast == pytest.approx(law.rules[-1].plan.forward(np.zeros(1))[0][0])


@given(st.integers(0, 10**6))
def test_bounds_of_the_rate_keep_the_limits_and_are_sharp(seed):
    rng = np.random.default_rng(seed)
    limits, tau, gradient = rng.uniform(4, 9, 5), rng.normal(size=5), rng.normal(size=5)
    gradient[rng.random(5) < 0.2] = 0.0
    least, most = rate_bounds(tau, gradient, limits)
    assert least <= most
    if gradient.any() and (np.abs(tau) <= limits)[gradient == 0].all():
        for rate in (least, most):
            assert (np.abs(tau + rate * gradient) / limits).max() == pytest.approx(1.0, rel=1e-9)


@given(tasks(), floats(-3, 3), floats(0, 1))
def test_slower_by_one_factor_the_rest_of_a_path_asks_for_no_more(arm, task, s, factor):
    """τ = λ²τ₁ + (1 − λ²)(τ₀ + λ/(1 + λ) B q_d'v) at λv: within a box that holds τ₁, τ₀ and τ₀ + ½B q_d'v."""
    point, viscous = task.at(np.array(s)), arm.friction.viscous
    plus, minus = arm.friction.levels(np.zeros(2))
    dry = np.where(point.velocity > 0, plus, -minus)

    def torque(share):
        qd, qdd = share * point.velocity, share**2 * point.velocity_slope * point.theta
        return arm.inverse_dynamics(point.q_d, qd, qdd) + viscous * qd + dry

    most = torque(0.0) + 0.5 * viscous * point.velocity
    between = torque(0.0) + factor / (1 + factor) * viscous * point.velocity
    predicted = factor**2 * torque(1.0) + (1 - factor**2) * between
    np.testing.assert_allclose(torque(factor), predicted, rtol=1e-9, atol=1e-9)
    box = np.abs([torque(1.0), torque(0.0), most]).max(0)
    assert (np.abs(torque(factor)) <= box + 1e-9 * box.max()).all()


def test_the_tasks_of_a_batch_have_their_own_pace(arm):
    @cache
    def circle(speed):
        return pc.Circle(1.0, speed)

    batch = pc.TaskBatch([circle(11.0), circle(4.0), circle(11.0)])
    together = pc.simulate(
        pc.Paced(make_law("projection", arm, batch)),
        [1.0, 0.0],
        duration=0.5,
        loop=LOOPS["exact"],
        progress=False,
    )
    for row, speed in enumerate((11.0, 4.0, 11.0)):
        alone = run(pc.Paced(make_law("projection", arm, circle(speed))), duration=0.5)
        np.testing.assert_allclose(together.array("q")[row], alone.array("q")[0], rtol=0, atol=1e-12)


def test_bad_arguments_are_told(arm):
    law = make_law("projection", arm, pc.Circle(1.0, 2.0))
    for margin in (1.0, -0.1, np.nan, "much"):
        with pytest.raises(pc.InputError, match="torque_margin"):
            pc.Paced(law, margin)
    for limits in ([1.0, 2.0, 3.0], [0.0, 1.0], None, [np.inf, np.inf]):
        with pytest.raises(pc.InputError, match="torque_limits"):
            pc.Paced(law, torque_limits=limits)
    with pytest.raises(pc.TaskError, match="torque limit"):
        pc.Paced(law, torque_limits=[1.0, 1.0])


@pytest.mark.parametrize("start", [[0.7, 1.2], [1.3, -0.5], [0.2, 0.1]])
def test_a_plan_that_goes_back_from_beside_its_path_does_not_run_away(arm, start):
    """Where no pace keeps all limits, slower is better, also for a plan that goes back: −1 ≤ w at all times."""
    law = pc.Paced(pc.ExtendedMotionPlan(arm, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0))
    law.reverse()
    tick, plant = pc.ControlTick(law, 2.5e-3), CompiledPlant(arm, 2.5e-3)
    q, qd = np.array([start]), np.array([[0.1, 0.2]])
    tick.start(q[0], qd[0])
    factors = [tick.state[-1]]
    for _ in range(480):
        tau = np.clip(tick(q[0], qd[0]), -arm.limits.effort, arm.limits.effort)
        q, qd = plant.advance(q, qd, tau[None])
        factors.append(tick.state[-1])
    assert -1 - 1e-9 <= min(factors) < -0.99
    assert max(factors) <= max(factors[0], 0.0) + 1e-12
    assert abs(np.linalg.norm(q) - 1.0) < np.deg2rad(2.0)
