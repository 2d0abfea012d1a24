"""friction="observed": the law compensates the true disturbance behind two low passes, in closed form, in any loop."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from random_arms import random_arm

from pathcontrol import (
    Circle,
    ComputedTorque,
    ContinuousTime,
    Controller,
    ControlOutput,
    ControlTick,
    Dropout,
    EventPlan,
    ExtendedMotionPlan,
    Harmonic,
    InputError,
    Line,
    Lissajous,
    PathControlWarning,
    PDPlus,
    Projection,
    Push,
    SampledLoop,
    SlotineLi,
    SpeedOverride,
    Stribeck,
    TorqueLimitDrop,
    Viscous,
    law_states,
    load_robot,
    metrics,
    peak,
    simulate,
    simulate_sequence,
    steady_state,
)
from pathcontrol.comparison.paper import START_DEG, paper_loop, paper_task

CUTOFF = 20.0
RATE = 2 * np.pi * CUTOFF
PERIODS = (2e-3, 1e-3)
CICESE = load_robot("cicese_2dof")
ARMS = {
    2: CICESE.with_friction(None),
    6: random_arm(6, 6, branched=False),
    7: random_arm(7, 7, branched=False),
}
every_arm = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
LAWS = {
    ExtendedMotionPlan: {"K_p": 200.0, "K_v": 30.0, "k": 5.0},
    Projection: {"k_p": 200.0, "K_v": 30.0},
    ComputedTorque: {"K_p": 200.0, "K_v": 30.0},
    PDPlus: {"K_p": [400.0, 20.0], "K_v": [60.0, 3.0]},
    SlotineLi: {"Lambda": 10.0, "K_d": [40.0, 2.0]},
}


def winding(n):
    return Lissajous(np.full(n, 0.4), 1 + np.arange(n) % 3, 1.0, phases=0.3 * np.arange(n))


def law(arm, friction="observed", **options):
    if friction == "observed":
        options = {"observer_hz": CUTOFF} | options
    return ExtendedMotionPlan(arm, winding(arm.n), 200.0, 30.0, 5.0, friction=friction, **options)


def moved(controller, duration=0.5, *, starts=1, **settings):
    """A run from beside the path."""
    start = controller.task.q_d(np.zeros(starts)) + 0.05 * (1 + np.arange(starts))[:, None]
    return simulate(controller, start, duration=duration, until="duration", progress=False, **settings)


def compensated(run, arm):
    """What the law took from the torque that the same law without an observer asks for, (time, n)."""
    without = law(arm, friction="none")
    asked = without.law(0.0, run.array("q_measured")[0], run.array("qd_measured")[0], run.array("s")[0][:, None])
    return asked.tau - run.array("tau_demand")[0]


def step_response(t):
    return np.where(t > 0, 1 - (1 + RATE * np.maximum(t, 0)) * np.exp(-RATE * np.maximum(t, 0)), 0.0)[:, None]


def orders(errors):
    """The orders of convergence from each period to the half of it."""
    return np.log2(np.array(errors[:-1]) / errors[1:])


@every_arm
def test_a_push_is_compensated_as_it_comes_through_two_low_passes(arm):
    """A (1 − (1 + Kt)e^{−Kt}) from its begin, and the same less from its end, to second order in the period."""
    A, errors = np.linspace(1.0, 2.0, arm.n), []
    for h in PERIODS:
        run = moved(law(arm), 0.4, loop=SampledLoop(period=h), disturbance=Push(A, 0.1, 0.2))
        exact = A * (step_response(run.time - 0.1) - step_response(run.time - 0.3))
        errors.append(np.abs(compensated(run, arm) - exact).max())
    assert errors[-1] < 0.005 * A.max()
    assert (orders(errors) > 1.7).all()


@every_arm
def test_a_harmonic_torque_has_amplitude_and_phase_of_both_low_passes(arm):
    """d = A sin ωt is compensated as the imaginary part of A (K/(K + iω))² e^{iωt}, once the start has died out."""
    A, w, errors = np.linspace(1.0, 2.0, arm.n), 2 * np.pi * 8.0, []
    for h in PERIODS:
        run = moved(law(arm), 0.4, loop=SampledLoop(period=h), disturbance=Harmonic(A, 8.0))
        late = run.time > 0.3
        exact = A * ((RATE / (RATE + 1j * w)) ** 2 * np.exp(1j * w * run.time)).imag[:, None]
        errors.append(np.abs(compensated(run, arm) - exact)[late].max())
    assert errors[-1] < 0.01 * A.max()
    assert (orders(errors) > 1.7).all()


def test_in_continuous_time_it_is_the_response_itself():
    arm = ARMS[2]
    loop = ContinuousTime(rtol=1e-10, atol=1e-12)
    run = moved(law(arm), loop=loop, disturbance=Push([3.0, 1.0], 0.2, 0.2))
    exact = [3.0, 1.0] * (step_response(run.time - 0.2) - step_response(run.time - 0.4))
    assert_allclose(compensated(run, arm), exact, atol=1e-6)


@pytest.mark.parametrize("loop", [{"delay": 2e-3}, {"delay": 3.2e-3}, {}], ids=["a period", "a part more", "none"])
def test_torque_limits_and_delays_are_known(loop):
    """Of an arm without disturbance nothing is compensated, whatever part of the demand the motors give, and when."""
    arm, errors = ARMS[2], []
    for h in PERIODS:
        run = moved(law(arm), loop=SampledLoop(period=h, torque_limits=[9.0, 1.0], **loop))
        assert (np.abs(run.array("tau_demand")) > 1.5 * np.array([9.0, 1.0])).any()
        errors.append(np.abs(compensated(run, arm)).max())
    assert errors[-1] < 0.03
    assert (orders(errors) > 1.5).all()


def test_so_are_motors_that_are_weak_for_a_while():
    drop = TorqueLimitDrop(0.2, 0.1, 0.2)
    loop = SampledLoop(period=1e-3, torque_limits=[60.0, 6.0])
    run = moved(law(ARMS[2]), loop=loop, disturbance=drop)
    assert np.abs(compensated(run, ARMS[2])).max() < 0.05


def test_torque_limits_are_known_in_continuous_time():
    loop = ContinuousTime(rtol=1e-10, atol=1e-12, torque_limits=[9.0, 1.0])
    run = moved(law(ARMS[2]), 0.2, loop=loop)
    assert (np.abs(run.array("tau_demand")) > 1.5 * np.array([9.0, 1.0])).any()
    assert np.abs(compensated(run, ARMS[2])).max() < 1e-5


@pytest.mark.parametrize("kind", [ExtendedMotionPlan, Projection])
def test_the_residual_error_of_the_papers_experiments_all_but_vanishes(kind):
    """At most 0.3 deg and 8 deg/s of 1.5 deg and 16 deg/s, with at most twice the noise of the torque."""
    gains = {ExtendedMotionPlan: (800.0, (45.0, 100.0), 20.0), Projection: (800.0, (45.0, 100.0))}[kind]
    noise = {}
    for friction in ("viscous", "observed"):
        controller = kind(CICESE, paper_task(), *gains, friction=friction)
        run = simulate(controller, np.deg2rad(START_DEG), duration=5.0, loop=paper_loop(), progress=False)
        noise[friction], late = metrics(run)["tau_noise"][0], steady_state(run)
    assert np.rad2deg(peak(late.norm("e_p"))[0]) <= 0.3
    assert np.rad2deg(peak(late.norm("e_v"))[0]) <= 8.0
    assert noise["observed"] <= 2 * noise["viscous"]


@pytest.mark.parametrize("kind", LAWS)
def test_every_law_carries_a_load_that_it_does_not_know(kind):
    """With a load of 2 kg, half of link 2's mass, the steady error is a small part of that without the observer."""
    errors, smooth = {}, ARMS[2]
    for friction in ("none", "observed"):
        controller = kind(smooth, Circle(0.8, 1.0), **LAWS[kind], friction=friction)
        heavy = smooth.with_payload(2.0, "tool")
        run = simulate(controller, [0.8, 0.0], duration=4.5, loop=SampledLoop(5e-3), plant=heavy, progress=False)
        errors[friction] = peak(steady_state(run).norm("e_p"))[0]
    assert errors["observed"] < 0.1 * errors["none"]


STICKY = CICESE.with_friction(Stribeck([7.17, 1.734], [10.7, 2.6], [0.1, 0.1]) + Viscous([2.288, 0.175]))


@pytest.mark.parametrize(
    ("kind", "loop"),
    [
        pytest.param(ExtendedMotionPlan, paper_loop(), id="extended motion plan, encoders"),
        pytest.param(Projection, paper_loop(), id="projection, encoders"),
        pytest.param(ComputedTorque, paper_loop(), id="computed torque, encoders"),
        pytest.param(ComputedTorque, SampledLoop(5e-3), id="computed torque, exact"),
    ],
)
def test_an_arm_that_has_arrived_rests_and_its_torque_does_not_grow(kind, loop):
    """Static friction is half more than Coulomb's; at the end of its path the arm rests, with the same torque."""
    gains = {name: 800.0 if "p" in name else 60.0 for name in LAWS[kind]}
    controller = kind(CICESE, Line([0.3, 0.2], [1.0, 0.6], 1.0), **gains, friction="observed")
    run = simulate(
        controller, [0.3, 0.2], duration=3.2, plant=STICKY, loop=loop, until="duration", progress=False
    ).rollout(0)
    late = run.time > 2.6
    assert np.ptp(run.array("q")[0, late], axis=0).max() < 1e-6
    assert np.ptp(run.array("tau")[0, late], axis=0).max() < 1e-6
    assert np.rad2deg(np.abs(run.array("e_p")[0, -1]).max()) < 0.01


def test_without_the_rule_for_rest_the_torque_would_grow(monkeypatch):
    """The same arm as above: an error of less than a count is summed up for ever."""
    line = Line([0.3, 0.2], [1.0, 0.6], 1.0)
    controller = ComputedTorque(CICESE, line, 800.0, 60.0, friction="observed")
    observe = controller.observer.observe
    monkeypatch.setattr(controller.observer, "observe", lambda t, q, qd, memory, kept: observe(t, q, qd, memory))
    options = {"duration": 2.6, "plant": STICKY, "until": "duration", "engine": "pinocchio"}
    run = simulate(controller, [0.3, 0.2], loop=paper_loop(), progress=False, **options)
    assert np.ptp(run.array("tau")[0, run.time > 2.2], axis=0).max() > 0.1


def test_a_slow_path_is_followed_without_stick_and_slip():
    """At 0.05 rad/s friction holds for ever an arm whose law does not compensate it."""
    controller = ExtendedMotionPlan(CICESE, Circle(1.0, 0.05), 800.0, (45.0, 100.0), 20.0, friction="observed")
    run = simulate(controller, [1.0, 0.0], duration=4.0, plant=STICKY, loop=paper_loop(), progress=False)
    late = steady_state(run)
    assert np.rad2deg(peak(late.norm("e_p"))[0]) < 0.01
    assert (late.array("qd") == 0).mean() < 0.02


def test_gains_and_cutoffs_of_several_rollouts_are_those_of_each_alone():
    cutoffs = np.array([[10.0, 20.0], [40.0, 30.0], [5.0, 5.0]])
    arm = CICESE
    together = moved(law(arm, observer_hz=cutoffs[:, None]), 0.3, starts=3)
    start = together.array("q")[:, 0]
    for i, cutoff in enumerate(cutoffs):
        alone = simulate(law(arm, observer_hz=cutoff), start[i], duration=0.3, until="duration", progress=False)
        assert_allclose(alone.array("q")[0], together.array("q")[i], rtol=0, atol=1e-12)
    assert np.ptp(together.array("tau")[:, -1], axis=0).min() > 0


def test_both_engines_agree():
    runs = [moved(law(CICESE), engine=engine, loop=paper_loop()) for engine in ("auto", "pinocchio")]
    assert_allclose(runs[0].array("q"), runs[1].array("q"), rtol=0, atol=1e-10)


def test_a_control_tick_does_what_the_loop_does():
    run = moved(law(CICESE), loop=SampledLoop(torque_limits=True))
    tick = ControlTick(law(CICESE), period=2.5e-3)
    tick.start(run.array("q")[0, 0])
    asked = [tick(q, qd).copy() for q, qd in zip(run.array("q")[0], run.array("qd")[0], strict=True)]
    assert_allclose(asked, run.array("tau_demand")[0], rtol=0, atol=1e-9)
    with pytest.raises(InputError, match="several rollouts"):
        ControlTick(law(CICESE, observer_hz=np.full((3, 1, 2), 5.0)), period=2.5e-3)


@pytest.mark.parametrize("loop", [SampledLoop(), ContinuousTime()], ids=["sampled", "continuous"])
def test_a_law_with_a_speed_input_has_it_too(loop):
    plain, wrapped = law(CICESE), SpeedOverride(law(CICESE))
    runs = [moved(one, 0.25, loop=loop) for one in (plain, wrapped)]
    assert_allclose(runs[1].array("q"), runs[0].array("q"), rtol=0, atol=1e-6)


def test_ticks_that_are_missed_are_no_disturbance():
    """The torque is held meanwhile, and the time since the last tick is known."""
    run = moved(law(ARMS[2]), loop=SampledLoop(period=1e-3), disturbance=Dropout(0.2, 0.02))
    assert np.abs(np.diff(run.array("tau_demand")[0, :195], axis=0)).max() < 1.0
    assert np.abs(compensated(run, ARMS[2])[run.time > 0.23]).max() < 0.1


@pytest.mark.parametrize("loop", [SampledLoop(1e-3), ContinuousTime(5e-3)], ids=["sampled", "continuous"])
def test_from_path_to_path_of_a_sequence_the_observer_goes_on(loop):
    """A steady push stays compensated at the seam, where a law that begins anew would lose it."""
    line, back = Line([0.3, 0.2], [0.5, 0.3], 1.0), Line([0.5, 0.3], [0.3, 0.2], 1.0)
    laws = [ExtendedMotionPlan(ARMS[2], task, 200.0, 30.0, 5.0, friction="observed") for task in (line, back)]
    push = np.array([6.0, 2.0])
    run = simulate_sequence(laws, [0.3, 0.2], duration=9.0, loop=loop, disturbance=Push(push), progress=False)
    assert run.status[0] == "finished"
    without = ExtendedMotionPlan(ARMS[2], back, 200.0, 30.0, 5.0, friction="none")
    second = run.path(1)
    s = second.array("s")[0][:, None]
    asked = without.law(0.0, second.array("q_measured")[0], second.array("qd_measured")[0], s).tau
    taken = (asked - second.array("tau_demand")[0])[s[:, 0] < 0.1]
    assert_allclose(taken, np.broadcast_to(push, taken.shape), rtol=0, atol=0.05)


@pytest.mark.parametrize("given", [0.0, -3.0, np.nan, [1.0, 2.0, 3.0], "fast"])
def test_a_cutoff_that_is_none_is_refused(given):
    with pytest.raises(InputError, match="observer_hz"):
        law(CICESE, observer_hz=given)


def test_a_cutoff_without_an_observer_is_told():
    with pytest.warns(PathControlWarning, match=r"observer_hz = 20\.0, but friction = 'full' has no observer"):
        law(CICESE, friction="full", observer_hz=20.0)


class Plain(Controller):
    """A law of a user that does not know of observers."""

    def law(self, t, q, qd, z):
        s = z[..., 0]
        point = self.point(s)
        e_p, e_v = point.q_d - q, point.velocity - qd
        tau = self.robot.inverse_dynamics(q, qd, 200.0 * e_p + 30.0 * e_v)
        none = np.zeros_like(s)
        return ControlOutput(tau, point.theta[..., None], s, point.theta, point.dtheta, none, e_p, e_v, np.isfinite(s))


class Compensating(Plain):
    """The same law, which asks its observer."""

    def law(self, t, q, qd, z):
        return self.compensate(t, q, qd, z, super().law(t, q, qd, z))


def test_a_law_of_a_user_compensates_with_one_call():
    push, task = Push([3.0, 1.0]), winding(2)
    plain, observed = (
        moved(cls(ARMS[2], task, friction=friction), 1.2, disturbance=push)
        for cls, friction in ((Plain, "none"), (Compensating, "observed"))
    )
    with pytest.raises(InputError, match=r"return self\.compensate"):
        moved(Plain(ARMS[2], task, friction="observed"))
    first, second = (np.abs(run.array("e_p")[0, -100:]).max() for run in (plain, observed))
    assert second < first


def watching_laws():
    plain = law(ARMS[2], friction="none")
    yield "a law", plain.watching(CUTOFF)
    yield "a law that compensates it", law(ARMS[2])
    yield "a wrapper", SpeedOverride(plain).watching(CUTOFF)
    yield "wrappers", EventPlan(SpeedOverride(plain), threshold=100.0, observer_hz=CUTOFF)


@pytest.mark.parametrize("watching", [pytest.param(one, id=name) for name, one in watching_laws()])
def test_a_state_says_what_the_observer_saw(watching):
    """In a control tick and along a run: a push behind two low passes, of the tick before."""
    h, A = 2e-3, np.array([2.0, 1.0])
    run = moved(watching, 0.1, loop=SampledLoop(period=h), disturbance=Push(A, 0.02, 0.05))
    seen = watching.observed_torque(law_states(run, watching))[0]
    t = run.time - h
    assert_allclose(seen, A * (step_response(t - 0.02) - step_response(t - 0.07)), rtol=0, atol=5e-3)
    tick = ControlTick(watching, period=h)
    tick.start(run.array("q")[0, 0])
    for row, q, qd in zip(seen, run.array("q")[0], run.array("qd")[0], strict=True):
        assert_allclose(watching.observed_torque(tick.state), row, rtol=0, atol=1e-9)
        tick(q, qd)


def test_a_law_without_observer_says_that_it_sees_nothing():
    plain = law(ARMS[2], friction="none")
    with pytest.raises(InputError, match=r"no observer; give it friction='observed', or take law\.watching\(\)"):
        plain.observed_torque(plain.start(np.zeros(2), np.zeros(2)))
    for other in (0.0, [0.3, 0.0]):
        with pytest.raises(InputError, match="expected 9"):
            plain.watching().observed_torque(other)
