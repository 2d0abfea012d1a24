"""Laws in a control loop are told which torques act, and how long: what an envelope takes away is no disturbance."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from simulated_arm import BAD, WIDE, H, Simulated, law_of

import pathcontrol as pc
from pathcontrol.errors import InputError
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.envelope import Envelope
from pathcontrol.simulation.compiled_plant import CompiledPlant


class OwnProjection(pc.Projection):
    """A law of a user, which is run in Python."""


@pytest.mark.parametrize("kind", [pc.Projection, OwnProjection])
def test_torques_that_the_envelope_takes_away_are_no_disturbance(kind):
    arm, task = law_of(2).robot.with_friction(None), law_of(2).task
    law = kind(arm, task, k_p=400.0, K_v=40.0, friction="observed")
    loop = ControlLoop(law, H, Envelope(**WIDE | {"torque_rate": 500.0, "torque": [30.0, 4.0]}))
    plant, seen, saturated = Simulated(law), [], []
    loop.start(plant.q[0])
    for _ in range(60):
        plant.drive(loop, 1)
        seen.append(law.observed_torque(loop.state))
        saturated.append(loop.status.saturated)
    assert np.mean(saturated) > 0.3
    assert np.abs(seen).max() < 0.02


@pytest.mark.parametrize("lost", ["measurements", "steps"])
@pytest.mark.parametrize("kind", [pc.Projection, OwnProjection])
def test_time_that_passes_without_a_tick_is_no_disturbance(kind, lost):
    """After three periods in which the last torque acts, the error is that of a period four times as long."""
    arm, task = law_of(2).robot.with_friction(None), law_of(2).task
    loop = ControlLoop(kind(arm, task, k_p=400.0, K_v=40.0, friction="observed"), H, Envelope(**WIDE))
    plant, seen = Simulated(loop.law), []
    loop.start(plant.q[0])
    plant.drive(loop, 40)
    for _ in range(5):
        if lost == "measurements":
            plant.drive(loop, 3, lambda k, *measured: BAD["not a number"](*measured))
        else:
            for _ in range(3):
                plant.q, plant.qd = plant.plant.advance(plant.q, plant.qd, loop._tau[None])
            plant.t += 3 * H
        plant.drive(loop, 1)
        seen.append(loop.law.observed_torque(loop.state))
    assert loop.status.faults["deadline"] == 5
    assert np.abs(seen).max() < 0.02


@pytest.mark.parametrize("kind", [pc.Projection, OwnProjection])
def test_torques_beyond_the_effort_limits_of_the_robot_are_no_disturbance_where_the_envelope_has_more(kind):
    arm, task = law_of(2).robot.with_friction(None), law_of(2).task
    law = kind(arm, task, k_p=400.0, K_v=40.0, friction="observed")
    loop, plant, seen, taus = ControlLoop(law, H, Envelope(**WIDE)), Simulated(law), [], []
    plant.q += [0.6, -0.6]  # off the path, from where the law asks for much
    loop.start(plant.q[0])
    for _ in range(60):
        taus.append(plant.drive(loop, 1)["tau"][0])
        seen.append(law.observed_torque(loop.state))
    assert (np.abs(taus) > 1.3 * arm.limits.effort).any()
    assert np.abs(seen).max() < 0.02


@pytest.mark.parametrize("kind", [pc.Projection, OwnProjection])
def test_steps_at_irregular_times_are_no_disturbance(kind):
    """Of periods that are shorter and longer, and of one that is no fault as ``late`` is large."""
    arm, task = law_of(2).robot.with_friction(None), law_of(2).task
    loop = ControlLoop(kind(arm, task, k_p=400.0, K_v=40.0, friction="observed"), H, Envelope(**WIDE, late=9.0))
    plant, seen = Simulated(loop.law), []
    loop.start(plant.q[0])
    for share in np.random.default_rng(1).uniform(0.6, 2.5, 60):
        tau = loop.step(plant.q[0], plant.qd[0], plant.t)
        plant.q, plant.qd = CompiledPlant(arm, share * H).advance(plant.q, plant.qd, tau[None])
        plant.t += share * H
        seen.append(loop.law.observed_torque(loop.state))
    assert loop.status.faults == {}
    assert np.abs(seen).max() < 0.02


@pytest.mark.parametrize("kind", [pc.Projection, OwnProjection])
def test_torques_that_are_written_into_the_returned_array_are_told_as_others_are(kind):
    law = kind(law_of(2).robot, law_of(2).task, k_p=400.0, K_v=40.0, friction="observed")
    q, states = law.task.q_d(np.array(0.02)), []
    for write in (np.multiply, lambda tau, share, out: tau * share):
        tick = pc.ControlTick(law, H)
        tick.start(q)
        for _ in range(3):
            tau = tick(q, np.zeros(2))
            tick.act(write(tau, 0.5, out=tau))
        states.append(tick.state)
    assert_array_equal(*states)


class Remembering(pc.ComputedTorque):
    """A law of a user, whose state has its time and the torque that acted."""

    def start(self, q, qd):
        return np.concatenate([super().start(q, qd), np.zeros_like(q), np.zeros_like(q[..., :1])], axis=-1)

    def law(self, t, q, qd, z):
        out = super().law(t, q, qd, z)
        rates = np.concatenate([np.zeros_like(q), np.full_like(q[..., :1], t)], axis=-1)
        return out._replace(zdot=np.concatenate([out.zdot, rates], axis=-1))

    def advance(self, z, out, period):
        return np.concatenate([super().advance(z, out, period), out.tau, out.zdot[..., -1:]], axis=-1)


def test_a_law_of_ones_own_advances_with_the_torque_that_acts_and_its_time_goes_on():
    plain = law_of(2)
    law = Remembering(plain.robot, plain.task, 400.0, 40.0)
    loop = ControlLoop(law, H, Envelope(**WIDE | {"torque_rate": 500.0, "torque": [30.0, 4.0]}))
    arm, saturated = Simulated(law), []

    def drive(ticks):
        for _ in range(ticks):
            tau = arm.drive(loop, 1)["tau"][0]
            assert (loop.state[-3:-1] == tau).all()
            assert loop.state[-1] == pytest.approx(H * len(saturated))
            saturated.append(loop.status.saturated)

    loop.start(arm.q[0])
    drive(50)
    loop.hold()
    drive(50)
    loop.resume()
    drive(500)
    assert loop._plan._tick is loop._plan._free
    assert sum(saturated) > 20
    loop._react(Mode.DAMP, "law", "")
    loop.resume()
    drive(50)


def test_a_tick_goes_on_from_its_state_to_the_last_bit():
    for law in (law_of(2).watching(), pc.SpeedOverride(Remembering(law_of(2).robot, law_of(2).task, 400.0, 40.0), 0.7)):
        one, other = (pc.ControlTick(law, H) for _ in range(2))
        q, qd = law.task.q_d(np.array(0.0)), np.array([0.3, -0.2])
        for tick in (one, other):
            tick.start(q, qd)
            for _ in range(3):
                tick(q, qd)
        other.start_from(other.state, other.ticks)
        for ticks in (-1, 1.5):
            with pytest.raises(InputError, match="ticks"):
                other.start_from(one.state, ticks)
        for _ in range(2):
            assert (one(q, qd) == other(q, qd)).all()
            assert (one.state == other.state).all()


def test_a_tick_is_told_which_torques_act():
    law = law_of(2).watching()
    told, not_told = (pc.ControlTick(law, H) for _ in range(2))
    for tick in (told, not_told):
        tick.start(law.task.q_d(np.array(0.0)))
    q, qd = law.task.q_d(np.array(0.0)), np.array([0.3, -0.2])
    for _ in range(2):
        tau = np.clip(told(q, qd), -law.robot.limits.effort, law.robot.limits.effort)
        not_told(q, qd)
        told.act(tau + 9.0)
        told.act(tau)  # the last word counts
    np.testing.assert_allclose(told.state, not_told.state, rtol=0, atol=1e-12)
    told.act(tau - [2.0, 1.0])
    told(q, qd), not_told(q, qd)
    share = (1 - np.exp(-2 * np.pi * 35.0 * H)) * np.array([2.0, 1.0])
    np.testing.assert_allclose(told.state[1:3] - not_told.state[1:3], share, rtol=1e-9)  # behind the first low pass
    with pytest.raises(InputError, match="tau"):
        told.act([1.0, 2.0, 3.0])
