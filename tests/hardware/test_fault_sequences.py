"""Any sequence of faults, and laws that are wrapped or observe, in the control loop."""

import numpy as np
import pytest
from simulated_arm import BAD, H, Simulated, law_of

import pathcontrol as pc
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.envelope import Envelope


def observed_law(n):
    plan = law_of(n, pc.ExtendedMotionPlan)
    return pc.ExtendedMotionPlan(plan.robot, plan.task, K_p=400.0, K_v=40.0, k=5.0, friction="observed")


WRAPPED = {
    "override": lambda n: pc.SpeedOverride(law_of(n, pc.ExtendedMotionPlan), 0.5),
    "paced": lambda n: pc.Paced(law_of(n)),
    "both": lambda n: pc.SpeedOverride(pc.Paced(law_of(n, pc.ExtendedMotionPlan)), 0.7),
    "event": lambda n: pc.EventPlan(law_of(n, pc.ComputedTorque)),
    "observed": observed_law,
    "observed override": lambda n: pc.SpeedOverride(observed_law(n)),
}


@pytest.mark.parametrize("name", WRAPPED)
def test_wrapped_and_observing_laws_run_hold_and_go_on_without_a_jump(name):
    law = WRAPPED[name](2)
    arm, loop = Simulated(law), ControlLoop(law, H)
    loop.start(arm.q[0], arm.qd[0])
    gone = [arm.drive(loop, 60)]
    assert loop.status.mode == Mode.RUN
    loop.hold()
    gone += [arm.drive(loop, 250)]
    assert np.abs(arm.qd).max() < 1e-2
    loop.resume()
    gone += [arm.drive(loop, 60), arm.drive(loop, 20, lambda k, *m: BAD["not a number"](*m)), arm.drive(loop, 30)]
    assert loop.status.mode == Mode.DAMP
    s = loop.status.s
    loop.resume()
    gone += [arm.drive(loop, 180)]
    assert (loop.status.mode, loop.status.reason) == (Mode.RUN, "")
    assert loop.status.s > s
    assert "law" not in loop.status.faults
    assert loop._plan.distance(arm.q[0]) < 0.1
    change = np.abs(np.diff(np.concatenate([part["tau"] for part in gone]), axis=0))
    assert (change <= loop.envelope.torque_rate * H * (1 + 1e-9)).all()


@pytest.mark.parametrize("n", [2, 7])
def test_no_torque_is_beyond_its_limit_or_its_rate_whatever_happens(n):
    try_faults(law_of(n), np.random.default_rng(n), sequences=40)


@pytest.mark.parametrize(("n", "name"), [*((2, name) for name in WRAPPED), (6, "both"), (6, "observed override")])
def test_the_same_of_wrapped_and_observing_laws(n, name):
    try_faults(WRAPPED[name](n), np.random.default_rng(n), sequences=20)


def try_faults(law, rng, sequences):
    """Give a loop random sequences of faults, and hold its torques to their limits and rates."""
    n = law.robot.n
    loop = ControlLoop(law, H, Envelope(patience=2, frozen=5))
    limit, change = loop.envelope.torque, loop.envelope.torque_rate * H
    center = np.asarray(law.task.q_d(np.array(0.0)))
    for _ in range(sequences):
        q, qd, t = center + rng.normal(0, 0.3, n), rng.normal(0, 0.5, n), rng.uniform(0, 9)
        loop.start(q, qd, t)
        last = np.clip(law.robot.gravity(q), -limit, limit)
        for _ in range(25):
            t += H * rng.choice([1.0, 1.0, 1.0, 0.0, -3.0, 2.0, 40.0])
            q, qd = q + rng.normal(0, rng.choice([1e-3, 0.1, 3.0]), n), rng.normal(0, rng.choice([0.1, 5.0, 1e4]), n)
            measured = (q, qd, t)
            if rng.random() < 0.3:
                measured = BAD[rng.choice(list(BAD))](*measured)
            if rng.random() < 0.1:
                [loop.hold, loop.resume][rng.integers(2)]()
            tau = loop.step(*measured)
            assert tau.shape == (n,)
            assert np.isfinite(tau).all()
            assert (np.abs(tau) <= limit).all()
            assert (np.abs(tau - last) <= change * (1 + 1e-12)).all()
            last = tau
