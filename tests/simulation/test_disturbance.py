"""What pushes the arm beside its motors: impulse and momentum, virtual work, one amplitude for each rollout."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pathcontrol import (
    ComputedTorque,
    ContinuousTime,
    Disturbance,
    Dropout,
    ExtendedMotionPlan,
    FrameForce,
    FrictionChange,
    Harmonic,
    InputError,
    JammedJoint,
    Line,
    PickUp,
    Push,
    SampledLoop,
    TorqueLimitDrop,
    UnknownNameError,
    Wall,
    load_robot,
    simulate,
    simulate_sequence,
)

START = np.deg2rad([40.0, 70.0])
MASS = 2.0
SLIDE = load_robot(
    f"""<robot name="slide"><link name="base"/>
    <link name="carriage"><inertial><mass value="{MASS}"/>
    <inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial></link>
    <joint name="rail" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>"""
)
LOOPS = {"sampled": SampledLoop(), "continuous": ContinuousTime(output_period=0.01)}


class Idle(ComputedTorque):
    """A law that asks for nothing."""

    def law(self, t, q, qd, z):
        return super().law(t, q, qd, z)._replace(tau=np.zeros(q.shape))


def slide(disturbance, loop="sampled", duration=0.5, q=(0.0,), **options):
    law = Idle(SLIDE, Line([0.0], [1.0], 1.0), 1.0, 1.0)
    return simulate(
        law,
        q,
        duration=duration,
        until="duration",
        disturbance=disturbance,
        loop=LOOPS[loop],
        progress=False,
        **options,
    )


def law(arm, circle):
    return ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], 20.0)


@pytest.mark.parametrize("loop", LOOPS)
def test_a_push_gives_its_impulse(loop):
    """A free mass has the velocity ∫F dt/m; the push begins and ends within 40 ms of rest, and is not stepped over."""
    run = slide(Push([5.0], start=0.2, duration=0.04), loop)
    speed = run.array("qd")[0, :, 0]
    assert np.allclose(speed[run.time <= 0.2], 0.0, atol=1e-9)
    assert speed[-1] == pytest.approx(5.0 * 0.04 / MASS, rel=1e-6)
    ramp = (run.time > 0.2) & (run.time < 0.24)
    assert np.allclose(speed[ramp], 5.0 * (run.time[ramp] - 0.2) / MASS, atol=1e-7)


@pytest.mark.parametrize("loop", LOOPS)
def test_a_harmonic_force_moves_a_free_mass_as_it_must(loop):
    """v = A(cos φ − cos(2πft + φ))/(2πf m); the value in the middle of a step makes it second order."""
    A, f, phase = 3.0, 4.0, 0.7
    run = slide(Harmonic([A], f, phase), loop)
    w = 2 * np.pi * f
    exact = A * (np.cos(phase) - np.cos(w * run.time + phase)) / (w * MASS)
    # the midpoint rule: (wh)²/24 of the amplitude
    assert np.allclose(run.array("qd")[0, :, 0], exact, atol=A / (w * MASS) * (w * 2.5e-3) ** 2 / 12 + 1e-7)


def test_disturbances_add_up():
    terms = Push([5.0], 0.1, 0.1), Harmonic([3.0], 4.0), Push([-1.0])
    together = slide(terms[0] + terms[1] + terms[2]).array("qd")
    assert np.allclose(together, sum(slide(term).array("qd") for term in terms), atol=1e-12)


def test_a_force_does_the_work_that_its_point_moves_through(arm):
    """A load that hangs on the tool is a force: Jᵀf is the torque by which gravity changes with its mass."""
    q = np.random.default_rng(2).normal(size=(30, 2))
    force = FrameForce(arm, "tool", [0.0, 0.0, -9.81 * 1.5])
    gravity = arm.with_payload(1.5, "tool").gravity(q) - arm.gravity(q)
    assert np.allclose(-force.torque(0.0, q, np.zeros_like(q)), gravity, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("loop", LOOPS)
def test_each_rollout_has_its_own(ideal_arm, circle, loop):
    rng = np.random.default_rng(3)
    force, start, torque, phase = (
        rng.normal(size=(4, 3)),
        rng.uniform(0, 0.1, 4),
        rng.normal(size=(4, 2)),
        rng.normal(size=4),
    )
    length = rng.uniform(0.02, 0.1, 4)

    def run(rows):
        pushes = FrameForce(ideal_arm, "tool", 20 * force[rows], start[rows], length[rows])
        pushes += Push(5 * torque[rows], start[rows], length[rows]) + Harmonic(torque[rows], 5.0, phase[rows])
        q = np.broadcast_to(START, (len(start[rows]), 2))
        return simulate(law(ideal_arm, circle), q, duration=0.2, loop=LOOPS[loop], disturbance=pushes, progress=False)

    whole = run(slice(0, 4))
    for i in range(4):
        alone = run(slice(i, i + 1))
        for name in whole.data.data_vars:
            if loop == "sampled":
                assert_array_equal(whole.array(name)[i], alone.array(name)[0], err_msg=name)
            else:  # one integrator for all
                assert np.allclose(whole.array(name)[i], alone.array(name)[0], rtol=1e-4, atol=1e-4), name


def test_its_time_goes_on_through_a_sequence(arm):
    lines = [Line([0.0, 0.0], [0.3, 0.2], 1.0), Line([0.3, 0.2], [0.5, 0.5], 1.0)]
    laws = [ExtendedMotionPlan(arm, line, 800.0, 45.0, 2.0, friction="full") for line in lines]
    seen = []

    class Clock(Disturbance):
        def torque(self, t, q, qd):
            seen.append(t)
            return np.zeros(2)

    run = simulate_sequence(laws, [0.0, 0.0], duration=2.0, disturbance=Clock(), progress=False)
    middles = (np.arange(len(run.time) - 1) + 0.5) * 2.5e-3
    assert np.allclose(
        seen[-len(middles) :], middles, atol=1e-9
    )  # the calls before ask whether it fits, and how stiff it is


def test_it_is_beside_the_torque_limits(arm, circle):
    loop = SampledLoop(torque_limits=True)
    run = simulate(law(arm, circle), START, duration=0.1, loop=loop, disturbance=Push([900.0, 0.0]), progress=False)
    free = simulate(law(arm, circle), START, duration=0.1, loop=loop, progress=False)
    assert (np.abs(run.array("tau")) <= arm.limits.effort).all()
    assert np.abs(run.array("q") - free.array("q")).max() > 0.1


def test_the_record_says_what_pushed(arm, circle):
    push = Push(np.ones((50, 2)), 0.1, 0.2) + FrameForce(arm, "tool", [1.0, 0.0, 0.0])
    run = simulate(law(arm, circle), [START] * 50, duration=0.0025, disturbance=push, progress=False)
    first, second = run.config["disturbance"]["terms"]
    assert first == {
        "disturbance": "Push", "start": 0.1, "duration": 0.2, "magnitude": {"shape": [50, 2], "min": 1.0, "max": 1.0}
    }  # fmt: skip
    assert second["frame"] == "tool"


def test_arguments_for_another_number_of_rollouts_are_told_at_once(arm):
    for make, words in (
        (lambda: Push([[1.0, 2.0]] * 2, [0.0, 0.1, 0.2]), "start is for 3 rollouts and magnitude for 2"),
        (lambda: Push([1.0], [0.0] * 2, [0.1] * 3), "start is for 2 rollouts and duration for 3"),
        (lambda: Harmonic([1.0], [1.0] * 2, [0.0] * 3), "frequency is for 2 rollouts and phase for 3"),
        (lambda: FrameForce(arm, "tool", np.ones((2, 3)), [0.0] * 3), "start is for 3 rollouts and force for 2"),
        (lambda: JammedJoint([0, 1], [0.0] * 3), "start is for 3 rollouts and joint for 2"),
        (lambda: JammedJoint(["a", "b"], 0.0, [1.0] * 3), "duration is for 3 rollouts and joint for 2"),
        (lambda: TorqueLimitDrop([[0.5]] * 3, [0.0] * 2), "start is for 2 rollouts and factor for 3"),
        (lambda: FrictionChange([[2.0]] * 3, coulomb=[[1.0]] * 2), "factor is for 3 rollouts and coulomb for 2"),
        (lambda: Dropout([0.0] * 2, probability=[0.5] * 3), "start is for 2 rollouts and probability for 3"),
        (lambda: PickUp([1.0] * 2, "tool", [0.1] * 3), "time is for 3 rollouts and mass for 2"),
        (lambda: PickUp(1.0, "tool", [0.1] * 3, [0.1] * 2), "time is for 3 rollouts and duration for 2"),
        (lambda: Wall("tool", [[1.0, 0.0, 0.0]] * 2, [-1.0, 0.0, 0.0], [1e4] * 3), "point is for 2 rollouts and stiff"),
    ):
        with pytest.raises(InputError, match=words):
            make()
    for name, make in (("start", lambda t: JammedJoint(0, t)), ("time", lambda t: PickUp(1.0, "tool", t))):
        with pytest.raises(InputError, match=f"{name} is nan"):
            make(np.nan)


def test_a_disturbance_of_ones_own_that_cannot_say_what_it_holds_is_named():
    class Grip(Push):
        def held_joints(self, t, q):
            return np.ones(3, dtype=bool) & np.ones(2, dtype=bool)

    with pytest.raises(InputError, match=r"Grip\.held_joints fails for 1 rollouts of 1 joints"):
        slide(Grip([1.0]))


def test_what_is_held_may_be_said_by_a_list():
    class Grip(Push):
        def held_joints(self, t, q):
            return [t > 0.1]

    run = slide(Grip([5.0]))
    assert np.ptp(run.array("q")[0, run.time > 0.1, 0]) == 0


def test_disturbances_that_cannot_be(arm, circle):
    for make, words in (
        (lambda: Push([np.nan]), "magnitude"),
        (lambda: Push([1.0], 0.0, -1.0), r"duration = -1\.0, expected times greater than 0"),
        (lambda: Push([1.0], [[0.0]]), "start has shape"),
        (lambda: FrameForce(arm, "tool", [1.0, 0.0]), r"force has shape \(2,\), expected \(3,\)"),
        (lambda: slide(3.0), r"disturbance = 3\.0, expected a Disturbance"),
        (lambda: slide(Push([1.0, 2.0])), r"Push\.torque has shape \(2,\), expected \(1, 1\)"),
        (
            lambda: slide(FrictionChange([1.0, 2.0])),
            r"has shape \(2,\), expected .*; give a value for each of 1 joints",
        ),
        (
            lambda: slide(Push([[1.0]] * 2) + Push([1.0], [0.0] * 3)),
            r"Push \(term 0\) is for 2 .* Push \(term 1\) for 3",
        ),
        (lambda: slide(Push([[1.0]] * 3), q=[[0.0]] * 2), r"Push\.torque has shape \(3, 1\), expected \(2, 1\)"),
        (lambda: slide(Push([1.0], [0.0] * 3), q=[[0.0]] * 2), r"has shape \(3, 1\), expected \(2, 1\)"),
    ):
        with pytest.raises(InputError, match=words):
            make()
    with pytest.raises(UnknownNameError, match="no frame 'hand'"):
        FrameForce(arm, "hand", [1.0, 0.0, 0.0])
