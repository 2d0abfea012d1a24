"""After damping a control loop goes on from where the arm is: without a jump, at rest, with what was learned."""

import numpy as np
import pytest
from simulated_arm import BAD, WIDE, H, Simulated, law_of

import pathcontrol as pc
from pathcontrol.control.wrappers.stopping_rate import stopping_rate
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.envelope import Envelope

LAWS = [pc.ComputedTorque, pc.ExtendedMotionPlan, pc.Projection]


@pytest.mark.parametrize("n", [2, 7])
def test_after_damping_the_loop_goes_on_from_where_the_arm_is_without_a_jump(n):
    law = law_of(n)
    arm, loop = Simulated(law), ControlLoop(law, H)
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 100)
    arm.drive(loop, 20, lambda k, *measured: BAD["not a number"](*measured))
    arm.drive(loop, 200)
    assert loop.status.mode == Mode.DAMP
    loop.resume()
    done = arm.drive(loop, 150)
    assert loop.status.mode == Mode.RUN
    change = np.abs(np.diff(done["tau"], axis=0))
    assert (change <= loop.envelope.torque_rate * H * (1 + 1e-9)).all()
    assert loop._plan.distance(arm.q[0]) < 0.05


@pytest.mark.parametrize("kind", LAWS)
def test_after_damping_the_plan_begins_at_rest_and_speeds_up_within_its_bound(kind):
    """Its factor w is 0, and at most at after a time t."""
    law = law_of(2, kind)
    arm, loop = Simulated(law), ControlLoop(law, H)
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 100)
    arm.drive(loop, 20, lambda k, *measured: BAD["not a number"](*measured))
    arm.drive(loop, 200)
    loop.resume()
    assert loop._plan.factor == 0.0
    for t in H * np.arange(1, 51):
        arm.drive(loop, 1)
        assert loop._plan.factor <= stopping_rate(law.robot, law.task) * t * (1 + 1e-9)
    arm.drive(loop, 600)
    assert loop._plan.factor == 1.0


@pytest.mark.parametrize("broken", [False, True])
def test_after_damping_what_was_learned_goes_on_unless_it_is_no_number(broken):
    inner = pc.Projection(law_of(2).robot, pc.Circle(0.1, 12.0), k_p=800.0, K_v=40.0)
    law = pc.Learned(inner, nodes=32)
    arm, loop = Simulated(law), ControlLoop(law, H, Envelope(**WIDE))
    loop.start(arm.q[0])
    z = loop.state
    learned = law.recall(z)  # views of z
    learned.torque[:], learned.known[:], learned.fits[...], learned.weight[:] = 2.0, 1.0, 1.0, 0.1
    loop._plan._held.start_from(z)
    arm.drive(loop, 1)
    loop._react(Mode.DAMP, "law", "")
    if broken:
        loop._plan._held._tick._z[:, 1:] = np.nan
    loop.resume()
    after = law.recall(loop.state)
    for name in ("torque", "known", "fits"):
        assert (getattr(after, name) == (0.0 if broken else getattr(learned, name))).all()
    assert not after.weight.any()
    assert np.abs(arm.drive(loop, 10)["tau"]).max() < 100.0
    assert loop.status.mode == Mode.RUN


class Counting(pc.Projection):
    """A law of a user, whose state has the number of its ticks, which it knows again."""

    def start(self, q, qd):
        return np.concatenate([super().start(q, qd), 0.0 * q[..., :1]], axis=-1)

    def advance(self, z, out, period):
        return np.concatenate([super().advance(z[..., :1], out, period), z[..., 1:] + 1], axis=-1)

    def recollect(self, z, before):
        return np.concatenate([z[..., :1], before[..., 1:]], axis=-1)

    def outcome(self, z):
        return {"forgotten": z[..., 1].astype(np.int64)}


@pytest.mark.parametrize("wrap", [pc.SpeedOverride, lambda law: law])
def test_what_a_law_of_one_s_own_remembers_goes_on_and_is_told_wrapped_or_not(wrap):
    law = wrap(Counting(law_of(2).robot, law_of(2).task, k_p=400.0, K_v=40.0))
    arm, loop = Simulated(law), ControlLoop(law, H)
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 50)
    loop._react(Mode.DAMP, "law", "")
    loop.resume()
    arm.drive(loop, 10)
    assert loop.state[1] == loop.outcome["forgotten"] == 60


class Lost(pc.Lissajous):
    """A path that cannot say any more which point is nearest."""

    lost = ""

    def sigma_bar(self, q, near=None):
        if Lost.lost == "raises":
            raise RuntimeError("no nearest point")
        return super().sigma_bar(q, near) * (np.nan if Lost.lost else 1.0)


@pytest.mark.parametrize("lost", ["raises", "no number"])
def test_a_law_that_cannot_go_on_leaves_the_arm_damped_and_resume_does_not_raise(lost, monkeypatch):
    plain = law_of(2)
    law = pc.ExtendedMotionPlan(plain.robot, Lost([0.3, 0.3], [1, 2], 0.5, center=[0.2, 0.4]), 400.0, 40.0, k=5.0)
    arm, loop = Simulated(law), ControlLoop(law, H)
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 50)
    arm.drive(loop, 20, lambda k, *measured: BAD["not a number"](*measured))
    arm.drive(loop, 50)
    monkeypatch.setattr(Lost, "lost", lost)
    loop.resume()
    assert loop.status.mode == Mode.DAMP
    assert "cannot go on" in loop.status.reason
    assert loop.status.faults["law"] == 1
    assert np.isfinite(arm.drive(loop, 50)["tau"]).all()
    monkeypatch.setattr(Lost, "lost", "")
    loop.resume()
    arm.drive(loop, 50)
    assert loop.status.mode == Mode.RUN
