"""EventPlan: the plan halts at a contact and goes on when it is gone; what its theorem asks for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import cumulative_simpson
from scipy.optimize import brentq
from strategies import floats, gains, tasks, vectors

import pathcontrol as pc
from pathcontrol.comparison.paper import START_DEG, paper_loop, paper_task

CICESE = pc.load_robot("cicese_2dof")
SMOOTH = CICESE.with_friction(None)
START = np.deg2rad(START_DEG)
JAM = pc.JammedJoint(1, 0.4, 0.6)
KINDS = (pc.ExtendedMotionPlan, pc.Projection, pc.ComputedTorque)
every_law = pytest.mark.parametrize("kind", KINDS)


def law(kind, arm=CICESE, task=None, **options):
    plan = {"k": 20.0} if kind is pc.ExtendedMotionPlan else {}
    return kind(arm, paper_task() if task is None else task, 800.0, [45.0, 100.0], **plan, **options)


def run(controller, q=START, duration=5.0, **settings):
    return pc.simulate(controller, q, duration=duration, progress=False, **{"loop": paper_loop()} | settings)


def run_along(controller, duration, begin=0.0, **settings):
    """A run from a state on the path: the errors are those that friction leaves in every lap."""
    point = paper_task().at(np.array([begin]))
    return run(controller, point.q_d, duration, qd=point.velocity, **settings)


class Led(pc.Projection):
    """The law (39) at a motion reference whose rate is given, and that need not be the nearest point."""

    lead = 0.0

    def law(self, t, q, qd, z):
        s, none = z[..., 0], np.zeros(z.shape[:-1])
        point, sdot = self.point(s), np.full(z.shape[:-1], self.lead)
        e_p, e_v = point.q_d - q, point.velocity - qd
        qdd = point.velocity_slope * sdot[..., None] + self.K_v * e_v + self.k_p * e_p
        tau = self.robot.inverse_dynamics(q, qd, qdd) + self.friction_torque(qd)
        return pc.ControlOutput(tau, sdot[..., None], s, sdot, none, none, e_p, e_v, np.isfinite(s))


states = st.tuples(vectors(2, 2.0), vectors(2, 4.0), floats(0, 6))


@given(tasks(), states, floats(1, 900), gains(2, 0.5, 100), floats(-9, 9), floats(-2, 2))
def test_what_any_motion_reference_does_to_v(ideal_arm, task, state, k_p, K_v, lead, w):
    """V̇ = −e_vᵀK_v e_v + k_p e_pᵀq_d'(σ̇ − wϑ): the last term must be 0 or less, as the docstring of EventPlan says."""
    assume(abs(w) > 1e-3)
    q, qd, s = state
    inner = Led(ideal_arm, task, k_p, K_v).at_speed(np.array(w))
    inner.lead = lead
    out = inner.law(0.0, q, qd, np.array([s]))
    point = task.at(np.array(s)[None])
    qdd = ideal_arm.forward_dynamics(q, qd, out.tau - ideal_arm.friction.viscous * qd)
    e_p_rate, e_v_rate = point.dq_d[0] * lead - qd, w * point.velocity_slope[0] * lead - qdd
    rate = out.e_v @ e_v_rate + k_p * out.e_p @ e_p_rate
    said = -out.e_v @ (K_v * out.e_v) + k_p * (out.e_p @ point.dq_d[0]) * (lead - w * point.theta[0])
    terms = np.abs(out.e_v * e_v_rate).sum() + k_p * np.abs(out.e_p * e_p_rate).sum()
    assert abs(rate - said) < 1e-9 * (1 + terms)


@pytest.mark.parametrize("kind", KINDS[:2])
def test_v_falls_as_the_theorem_says_from_where_the_arm_is_let_go(ideal_arm, kind):
    """A push halts the plan; from its end on, held, waiting and speeding up again, V follows the V̇ of the theorem."""
    controller = pc.EventPlan(law(kind, ideal_arm), threshold=[5.0, 1.0], acceleration=8.0, pause=0.1)
    loop = pc.ContinuousTime(output_period=2e-3)
    pushed = run(controller, duration=0.68, loop=loop, disturbance=pc.Push([40.0, 6.0], 0.03, 0.2))
    free, w = pushed.time > 0.232, pc.speed_factor(pushed)[0]
    V, Vdot = (part[0, free] for part in pc.lyapunov(controller, pushed))
    change = cumulative_simpson(Vdot, dx=2e-3, initial=0)
    assert_allclose(V, V[0] + change, rtol=0, atol=5e-4 * V[0])  # Simpson's rule: h⁴(2K_v)⁴/180
    assert (Vdot <= 0).all()
    assert w[free].min() < 0.01
    assert w[-1] > 0.99


def test_it_halts_and_goes_on_when_the_low_passed_push_says_so():
    """r = A(1 − (1 + Kt)e^{−Kt}) passes the threshold, and its half when it is gone; then the pause begins."""
    K, A, threshold, pause, h = 2 * np.pi * 20.0, 6.0, 3.0, 0.15, 1e-3
    controller = pc.EventPlan(law(pc.ComputedTorque, SMOOTH), threshold, pause=pause, observer_hz=20.0)
    begin, length = 0.3, 0.3
    pushed = run(controller, duration=1.2, loop=pc.SampledLoop(h), disturbance=pc.Push([0.0, A], begin, length))
    w = pc.speed_factor(pushed)[0]
    seen = begin + brentq(lambda t: A * (1 - (1 + K * t) * np.exp(-K * t)) - threshold, 0, 0.1)
    gone = begin + length + brentq(lambda t: A * (1 + K * t) * np.exp(-K * t) - threshold / 2, 0, 0.1)
    slows = pushed.time[np.argmax(w < 1 - 1e-6)]
    goes = pushed.time[np.flatnonzero(w < 1e-3)[-1]]
    assert 0 < slows - seen < 3 * h
    assert 0 < goes - (gone + pause) < 0.02  # the ramp begins smoothly, with T = 20 ms


@every_law
def test_nothing_changes_where_nothing_is_met(kind):
    """The paper's experiment, from rest beside the path and with all friction, raises no alarm all round the circle."""
    plain, watched = run(law(kind), duration=3.3), run(pc.EventPlan(law(kind)), duration=3.3)
    assert_allclose(watched.array("q"), plain.array("q"), rtol=0, atol=1e-9)


@every_law
def test_in_a_jam_it_does_not_push_on_and_leaves_its_path_less(kind):
    """The torque of the jammed joint is at its limit for less of the time; the arm goes on when it is let go."""
    jam = pc.JammedJoint(1, 0.4, 0.6)
    plain, event = (run_along(one, 2.3, disturbance=jam) for one in (law(kind), pc.EventPlan(law(kind))))
    jammed, after = (plain.time > 0.4) & (plain.time < 1.0), plain.time > 0.4
    peaks = [np.abs(pc.contour_error(one)[0, after]).max() for one in (plain, event)]
    pushes = [np.abs(one.array("tau")[0, jammed, 1]).mean() for one in (plain, event)]
    assert peaks[1] < 0.5 * peaks[0]
    assert pushes[1] < (0.5 if kind is not pc.ComputedTorque else 1.0) * pushes[0]
    w = pc.speed_factor(event)[0]
    assert w[jammed].min() < 0.01
    assert w[event.time > 1.8].min() > 0.99
    assert np.ptp(event.array("s")[0, event.time > 1.8]) > 0.8 * 2.0 * 0.5


@pytest.mark.parametrize("kind", KINDS[:2])
def test_at_a_wall_it_halts_and_when_that_is_gone_it_goes_on(kind):
    """A stiff wall comes before the tool at 0.5 s, for 0.9 s; the arm waits at it with less than half its torque."""
    free = run_along(law(kind, start="nearest"), 0.8, 5.2)
    before, at = (CICESE.frame_pose(free.array("q")[0, round(t / 2.5e-3)], "tool")[:3, 3] for t in (0.65, 0.7))
    wall = pc.Wall("tool", at, before - at, stiffness=1e5, start=0.5, duration=0.9)
    event = run_along(pc.EventPlan(law(kind, start="nearest")), 2.5, 5.2, disturbance=wall)
    there, w = (event.time > 1.1) & (event.time < 1.4), pc.speed_factor(event)[0]
    away = np.array([CICESE.frame_pose(q, "tool")[:3, 3] - at for q in event.array("q")[0, there]]) @ (before - at)
    assert np.abs(away / np.linalg.norm(before - at)).max() < 1e-2
    push = event.array("tau") - CICESE.gravity(event.array("q"))
    assert (np.abs(push[0, there]) < 0.5 * CICESE.limits.effort).all()
    assert w[there].min() < 0.01
    assert w[-1] > 0.99
    assert np.ptp(event.array("s")[0, event.time > 2.0]) > 0.8 * 2.0 * 0.5


def test_with_an_observed_law_it_shares_the_observer():
    controller = pc.EventPlan(law(pc.Projection, friction="observed", observer_hz=25.0))
    assert_array_equal(controller.observer.gain, 2 * np.pi * 25.0)
    event = run_along(controller, 1.6, disturbance=JAM)
    assert pc.speed_factor(event)[0, (event.time > 0.7) & (event.time < 1.0)].max() < 0.01
    assert pc.speed_factor(event)[0, -1] > 0.99


def test_the_speed_input_goes_on_working(arm):
    outer = pc.SpeedOverride(pc.EventPlan(law(pc.ExtendedMotionPlan)), [[0.1, 0.5]])
    event = run_along(outer, 2.3, disturbance=pc.JammedJoint(1, 1.0, 0.5))
    w = pc.speed_factor(event)[0]
    assert_allclose(w[(event.time > 0.9) & (event.time < 1.0)], 0.5, atol=1e-6)
    assert w[(event.time > 1.0) & (event.time < 1.5)].min() < 0.01
    assert w[-1] == pytest.approx(0.5, abs=1e-3)


def test_thresholds_of_several_rollouts_are_those_of_each_alone():
    thresholds = np.array([[2.0, 1.5], [100.0, 100.0], [15.0, 3.0]])
    settings = {"duration": 0.6, "disturbance": pc.Push([0.0, 8.0], 0.1, 0.2)}
    together = run(pc.EventPlan(law(pc.ExtendedMotionPlan), thresholds[:, None]), np.tile(START, (3, 1)), **settings)
    for i, threshold in enumerate(thresholds):
        alone = run(pc.EventPlan(law(pc.ExtendedMotionPlan), threshold), **settings)
        assert_allclose(alone.array("q")[0], together.array("q")[i], rtol=0, atol=1e-9)
    assert np.ptp(together.array("s")[:, -1]) > 0.1


def test_a_control_tick_halts_too():
    jammed = run(pc.EventPlan(law(pc.ExtendedMotionPlan)), duration=0.8, disturbance=JAM)
    tick = pc.ControlTick(pc.EventPlan(law(pc.ExtendedMotionPlan)), 2.5e-3)
    tick.start(START)
    pairs = zip(jammed.array("q_measured")[0], jammed.array("qd_measured")[0], strict=True)
    asked = [tick(q, qd).copy() for q, qd in pairs]
    assert_allclose(asked, jammed.array("tau_demand")[0], rtol=0, atol=1e-6)


def test_its_settings_are_described(tmp_path):
    event = run(pc.EventPlan(law(pc.Projection), [20.0, 2.0], pause=0.3), duration=0.1)
    event.save(tmp_path / "event.nc")
    said = pc.Run.load(tmp_path / "event.nc").config["controller"]
    assert said["controller"] == "EventPlan(Projection)"
    assert said["threshold"] == [20.0, 2.0]
    assert said["pause"] == 0.3


@pytest.mark.parametrize(
    ("name", "bad"),
    [("threshold", 0.0), ("threshold", [1.0, 2.0, 3.0]), ("pause", 0.0), ("acceleration", -1.0), ("observer_hz", 0.0)],
)
def test_bad_settings_are_told(name, bad):
    with pytest.raises(pc.InputError, match=name):
        pc.EventPlan(law(pc.Projection), **{name: bad})


def test_an_arm_without_limits_needs_a_threshold():
    free = pc.load_robot(
        '<robot name="free"><link name="a"/><link name="b"><inertial><mass value="1"/><origin xyz="0.1 0 0"/><inertia '
        'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>'
    )
    turn = pc.Line([0.0], [1.0], 1.0)
    with pytest.raises(pc.InputError, match="no effort limits"):
        pc.EventPlan(pc.ComputedTorque(free, turn, 100.0, 20.0))
