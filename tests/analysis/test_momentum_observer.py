"""The momentum observer: the true disturbance behind a first-order filter, in closed form, for any arm and loop."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from random_arms import random_arm

from pathcontrol import (
    ContinuousTime,
    Coulomb,
    ExtendedMotionPlan,
    FrameForce,
    Harmonic,
    InputError,
    Line,
    Lissajous,
    Push,
    Run,
    SampledLoop,
    Stribeck,
    UnknownNameError,
    Viscous,
    load_robot,
    momentum_observer,
    simulate,
    simulate_sequence,
)

CUTOFF = 20.0
RATE = 2 * np.pi * CUTOFF
PERIODS = (4e-3, 2e-3, 1e-3)
ARMS = {
    2: load_robot("cicese_2dof").with_friction(None),
    6: random_arm(6, 6, branched=False),
    7: random_arm(7, 7, branched=False),
}
LOOPS = {
    "exact": {},
    "delay": {"delay": 1.3e-3},
    "difference": {"velocity": "difference"},
    "filter": {"filter_hz": 30.0},
    "filtered difference": {"velocity": "difference", "filter_hz": 30.0},
    "late difference": {"velocity": "difference", "delay": 1.3e-3},
    "two substeps": {"substeps": 2},
}
every_arm = pytest.mark.parametrize("arm", [ARMS[2], ARMS[7]], ids=["2", "7"])


TASKS = {n: Lissajous(np.full(n, 0.4), 1 + np.arange(n) % 3, 1.0, phases=0.3 * np.arange(n)) for n in ARMS}


def law(arm, **options):
    return ExtendedMotionPlan(arm, TASKS[arm.n], 200.0, 30.0, 5.0, **options)


def moved(
    arm, disturbance=None, period=2e-3, duration=0.6, *, loop=None, starts=1, plant=None, friction="none", **options
):
    """A run along a path, from beside it."""
    controller = law(arm, friction=friction)
    start = controller.task.q_d(np.zeros(starts)) + 0.05 * (1 + np.arange(starts))[:, None]
    return simulate(
        controller,
        start,
        duration=duration,
        until="duration",
        loop=SampledLoop(period=period, **options) if loop is None else loop,
        disturbance=disturbance,
        plant=plant,
        progress=False,
    )


def filtered(held, period):
    """The exact response of the filter, from rest, to a torque held over each period, (time − 1, n)."""
    keep, r = np.exp(-RATE * period), [np.zeros(held.shape[-1])]
    for d in held:
        r.append(keep * r[-1] + (1 - keep) * d)
    return np.array(r)


def orders(errors):
    """The orders of convergence from each period to the half of it."""
    return np.log2(np.array(errors[:-1]) / errors[1:])


def step_response(t):
    return np.where(t > 0, -np.expm1(-RATE * np.maximum(t, 0)), 0.0)[:, None]


@every_arm
@pytest.mark.parametrize("loop", LOOPS)
def test_nothing_is_seen_where_nothing_pushes(arm, loop):
    """With an exact model what is left is the error of sampling, which falls with the square of the period."""
    runs = [moved(arm, period=h, **LOOPS[loop]) for h in PERIODS]
    errors = [np.abs(momentum_observer(run, cutoff_hz=CUTOFF)).max() for run in runs]
    assert errors[-1] < 1e-3 * np.abs(runs[-1].array("tau")).max()
    assert (orders(errors) > 1.7).all()


@every_arm
@pytest.mark.parametrize("loop", LOOPS)
def test_a_push_rises_and_falls_as_in_a_first_order_filter(arm, loop):
    """A (1 − e^{−Kt}) while it lasts, then e^{−Kt} of what it has reached; velocities by difference are h/2 late."""
    A, errors = np.linspace(1.0, 2.0, arm.n), []
    for h in PERIODS:
        run = moved(arm, Push(A, 0.2, 0.2), h, **LOOPS[loop])
        t = run.time - (h / 2 if "difference" in loop else 0.0)
        exact = A * (step_response(t - 0.2) - step_response(t - 0.4))
        errors.append(np.abs(momentum_observer(run, cutoff_hz=CUTOFF)[0] - exact).max())
    assert errors[-1] < 0.005 * A.max()
    assert (orders(errors) > 1.7).all()


@every_arm
@pytest.mark.parametrize("kind", ["sampled", "continuous"])
@pytest.mark.parametrize("frequency", [3.0, 20.0])
def test_a_harmonic_torque_has_the_amplitude_and_the_phase_of_the_filter(arm, kind, frequency):
    """Amplitude A/√(1 + (ω/K)²), phase −arctan(ω/K), once the start has died out as e^{−Kt}."""
    A, phase, w = np.linspace(1.0, 2.0, arm.n), 0.4, 2 * np.pi * frequency
    errors = []
    for h in PERIODS:
        loop = ContinuousTime(output_period=h) if kind == "continuous" else SampledLoop(period=h)
        run = moved(arm, Harmonic(A, frequency, phase), loop=loop, duration=0.3)
        lag, t = np.arctan(w / RATE), run.time
        wave = np.sin(w * t + phase - lag) - np.sin(phase - lag) * np.exp(-RATE * t)
        exact = (A / np.hypot(1.0, w / RATE)) * wave[:, None]
        errors.append(np.abs(momentum_observer(run, cutoff_hz=CUTOFF)[0] - exact).max())
    assert errors[-1] < (0.25 * (w + RATE) * PERIODS[-1]) ** 2 * A.max()
    assert (orders(errors) > 1.8).all()


@every_arm
def test_a_force_on_a_frame_is_seen_as_its_torques(arm):
    """Jᵀf, which the loop holds over each step, behind the filter."""
    frame = arm.frame_names[-1]
    force, errors = FrameForce(arm, frame, [3.0, -2.0, 4.0], 0.1, 0.3), []
    for h in PERIODS:
        run = moved(arm, force, h)
        q, qd = run.array("q")[0], run.array("qd")[0]
        held = [force.torque(t + h / 2, a[None], b[None])[0] for t, a, b in zip(run.time[:-1], q, qd, strict=False)]
        exact = filtered(np.array(held), h)
        errors.append(np.abs(momentum_observer(run, cutoff_hz=CUTOFF)[0] - exact).max())
    assert errors[-1] < 1e-3 * np.abs(exact).max()
    assert (orders(errors) > 1.7).all()


@every_arm
def test_a_load_that_the_model_does_not_know_is_seen_as_what_it_needs(arm):
    """−(M̃q̈ + C̃q̇ + g̃), by inverse dynamics of the acceleration, which the observer does without."""
    plant, errors = arm.with_payload(0.8, arm.frame_names[-1]), []
    for h in PERIODS:
        run = moved(arm, period=h, plant=plant)
        q, qd, tau = (run.array(name)[0] for name in ("q", "qd", "tau"))
        ends = []
        for part in (slice(None, -1), slice(1, None)):  # the beginning and the end of each period, under its torque
            qdd = plant.forward_dynamics(q[part], qd[part], tau[:-1])
            ends.append(arm.inverse_dynamics(q[part], qd[part], qdd) - tau[:-1])
        exact = filtered(0.5 * (ends[0] + ends[1]), h)
        errors.append(np.abs(momentum_observer(run, cutoff_hz=CUTOFF)[0] - exact).max())
        assert_allclose(momentum_observer(run, plant, cutoff_hz=CUTOFF), 0.0, atol=2e-3 * np.abs(tau).max())
    assert errors[-1] < 2e-3 * np.abs(exact).max()
    assert (orders(errors) > 1.7).all()


def test_at_rest_a_load_is_its_weight():
    arm, q = ARMS[2], np.array([0.7, 0.4])
    stays = ExtendedMotionPlan(arm, Line(q, q + 1e-9, 1e-9), 800.0, 60.0, 0.0)
    heavy = arm.with_payload(2.0, "tool")
    run = simulate(stays, q, duration=3.0, until="duration", plant=heavy, progress=False)
    seen, hangs = momentum_observer(run)[0, -1], run.array("q")[0, -1]
    assert_allclose(seen, arm.gravity(hangs) - heavy.gravity(hangs), rtol=1e-4, atol=1e-3)


@every_arm
def test_friction_is_seen_with_a_minus_unless_it_is_known(arm):
    b, F = np.linspace(0.2, 0.5, arm.n), np.linspace(0.04, 0.06, arm.n)
    rough, h = arm.with_friction(Viscous(b) + Coulomb(F)), 1e-3
    run = moved(rough, period=h, friction="full")  # which keeps it from sticking
    qd = run.array("qd")[0]
    ends = {"viscous": b * qd, "dry": F * np.sign(qd)}
    viscous, dry = (filtered(0.5 * (f[1:] + f[:-1]), h) for f in ends.values())
    sampling = 1e-5 * np.abs(run.array("tau")).max()
    bound = 2 * F * -np.expm1(-RATE * h) + sampling  # dry friction has either sign where a joint turns round
    seen = {kind: momentum_observer(run, cutoff_hz=CUTOFF, friction=kind)[0] for kind in ("none", "viscous", "full")}
    assert (np.abs(seen["none"] + viscous + dry) < bound).all()
    assert (np.abs(seen["viscous"] + dry) < bound).all()
    assert (np.abs(seen["full"]) < sampling).all()
    assert np.abs(dry).max() > 3 * bound.min()


@every_arm
@pytest.mark.parametrize(
    "law_of_friction", [Coulomb, lambda F: Stribeck(F, 1.5 * F, 0 * F + 0.1)], ids=["Coulomb", "Stribeck"]
)
def test_known_friction_that_sticks_and_slips_hides_no_push_and_shows_none(arm, law_of_friction):
    """Joints that stop and break loose again, as the law does not compensate: nothing is seen until they are pushed."""
    h, rough = 1e-3, arm.with_friction(law_of_friction(np.linspace(0.4, 0.6, arm.n)))
    alone = moved(rough, period=h)
    assert (alone.array("qd")[0, 1:] == 0).any()
    sampling = 2e-4 if law_of_friction is Coulomb else 2e-3
    assert np.abs(momentum_observer(alone, cutoff_hz=CUTOFF, friction="full")).max() < sampling
    A = np.full(arm.n, 8.0)
    run = moved(rough, Push(A, 0.2), h)
    moving = (np.sign(run.array("qd")[0, 1:]) == np.sign(run.array("qd")[0, :-1])) & (run.array("qd")[0, 1:] != 0)
    steady = (run.time[1:] > 0.2 + 10 / RATE) & (run.time[1:] < 0.6)
    seen = momentum_observer(run, cutoff_hz=np.inf, friction="full")[0, 1:]
    error = np.abs(seen - A)[moving & steady[:, None]]
    assert error.size > 100
    assert error.max() < 5e-3


def test_a_joint_that_sticks_is_held_by_friction():
    """What pushes is what friction answers: nothing is left of both."""
    arm = load_robot("cicese_2dof").with_friction(Coulomb([60.0, 60.0]))
    stays = ExtendedMotionPlan(arm, Line([0.0, 0.0], [1e-9, 0.0], 1e-9), 1.0, 1.0, 0.0, friction="none")
    run = simulate(
        stays, [0.0, 0.0], duration=0.5, until="duration", disturbance=Push([20.0, 1.0], 0.1), progress=False
    )
    assert_array_equal(run.array("qd"), 0.0)
    assert_allclose(momentum_observer(run), 0.0, atol=1e-6)
    assert_array_equal(momentum_observer(run, friction="full"), 0.0)


def test_without_a_filter_it_is_the_mean_of_each_period():
    arm, h = ARMS[6], 1e-3
    A = np.linspace(1.0, 2.0, 6)
    run = moved(arm, Push(A, 0.2, 0.2), h)
    pushed = A * ((run.time[:-1] >= 0.2 - h / 2) & (run.time[:-1] < 0.4 - h / 2))[:, None]
    seen = momentum_observer(run, cutoff_hz=np.inf)[0]
    assert_array_equal(seen[0], 0.0)
    assert_allclose(seen[1:], pushed, atol=2e-3 * np.abs(run.array("tau")).max())


def test_each_joint_may_have_a_filter_of_its_own():
    run = moved(ARMS[2], Push([5.0, 3.0], 0.2))
    both = momentum_observer(run, cutoff_hz=[5.0, 40.0])
    for j, cutoff in enumerate((5.0, 40.0)):
        assert_array_equal(both[..., j], momentum_observer(run, cutoff_hz=cutoff)[..., j])


def test_a_rollout_is_estimated_as_if_it_were_alone():
    arm = ARMS[7]
    run = moved(arm, Push(np.outer(np.arange(4.0), np.ones(7)), 0.1), starts=4)
    together = momentum_observer(run)
    assert together.shape == (4, len(run.time), 7)
    for i in range(4):
        assert_array_equal(together[[i]], momentum_observer(run.rollout(i)))


@pytest.mark.filterwarnings("ignore::pathcontrol.PathControlWarning")
def test_a_rollout_that_diverges_has_no_estimate_from_then_on():
    arm = ARMS[2]
    run = moved(arm, Push([[0.0, 0.0], [1e9, 0.0]], 0.2), starts=2)
    assert list(run.status) == ["running", "diverged"]
    seen, lost = momentum_observer(run), run.time >= run.diverged_time[1]
    assert np.isfinite(seen[0]).all()
    assert_array_equal(np.isnan(seen[1]).all(-1), lost)
    assert_array_equal(seen[[0]], momentum_observer(run.rollout(0)))


def test_noise_and_encoders_are_in_the_estimate_unless_the_true_motion_is_taken():
    A = np.array([10.0, 5.0])
    coarse = moved(ARMS[2], Push(A, 0.2), encoders=[4096.0, 4096.0])
    t = coarse.time
    exact = A * step_response(t - 0.2)
    errors = [np.abs(momentum_observer(coarse, cutoff_hz=CUTOFF, measured=m)[0] - exact).max() for m in (True, False)]
    assert errors[1] < 0.01 < errors[0]


def test_a_saved_run_a_log_and_each_path_of_a_sequence_have_it_too(tmp_path):
    arm = ARMS[2]
    run = moved(arm, Push([5.0, 3.0], 0.2))
    seen = momentum_observer(run)
    assert_array_equal(momentum_observer(Run.load(run.save(tmp_path / "run.nc"))), seen)
    names = dict(zip(run.joints, arm.position_units, strict=True))
    log = Run.from_arrays(run.time, names, {name: run.array(name) for name in ("q", "qd", "tau")}, {})
    assert_array_equal(momentum_observer(log, arm), seen)
    with pytest.raises(InputError, match="does not know its robot"):
        momentum_observer(log)
    ways = [
        ExtendedMotionPlan(arm, Line(a, b, 2.0), 400.0, 40.0, 5.0)
        for a, b in (([0.0, 0.0], [0.5, 0.2]), ([0.5, 0.2], [0.1, 0.4]))
    ]
    pushed = simulate_sequence(ways, [0.0, 0.0], duration=3.0, disturbance=Push([5.0, 3.0]), progress=False)
    seen = momentum_observer(pushed, cutoff_hz=CUTOFF)
    assert_allclose(seen[0], [5.0, 3.0] * step_response(pushed.time), atol=0.02)


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"cutoff_hz": 0.0}, InputError, "cutoff_hz = 0.0, expected a frequency greater than 0"),
        ({"cutoff_hz": np.nan}, InputError, "cutoff_hz = nan"),
        ({"cutoff_hz": [1.0, 2.0, 3.0]}, InputError, "each of the 2 joints"),
        ({"cutoff_hz": "fast"}, InputError, "cutoff_hz = 'fast'"),
        ({"friction": "dry"}, UnknownNameError, "'dry'"),
        ({"robot": ARMS[6]}, InputError, "has 6 joints, the run 2"),
        ({"robot": "ur5"}, InputError, "robot = 'ur5'"),
    ],
)
def test_what_cannot_be_is_refused(options, kind, words):
    with pytest.raises(kind) as error:
        momentum_observer(moved(ARMS[2], duration=0.01), **options)
    assert words in str(error.value)


def test_what_is_no_run_is_refused():
    with pytest.raises(InputError, match="run = 3"):
        momentum_observer(3)
