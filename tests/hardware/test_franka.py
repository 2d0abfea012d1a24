"""A simulated Franka, driven through Franka's own client: franka-sim speaks the protocol of its robots.

It needs real-time priority: without it, a busy computer loses packets whatever the client does.
"""

import os

import numpy as np
import pytest
from franka_server import ROTORS, install, serve, urdf_of

import pathcontrol as pc
from pathcontrol.errors import ArmError
from pathcontrol.hardware import franka
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.drive import drive
from pathcontrol.hardware.real_time import real_time

H = 1e-3
HOME = np.array([0.0, 0.0, 0.0, -1.57, 0.0, 1.57, 0.785])
KINDS = ("projection", "paced")
SECONDS, SETTLED = 0.8, 0.5  # what is before the second is left out of the comparison
SETTLE = 0.2
MEASURES = "PATHCONTROL_FRANKA_SECONDS" in os.environ


@pytest.fixture(scope="session")
def simulator(tmp_path_factory):
    """The folder that has the simulated robot."""
    pytest.importorskip("pylibfranka", reason="Franka publishes no client for this platform")
    with real_time() as allowed:
        if not allowed:
            pytest.skip("no real-time priority here: packets would be lost to other programs")
    shared = tmp_path_factory.getbasetemp()
    return install((shared.parent if os.environ.get("PYTEST_XDIST_WORKER") else shared) / "franka-sim")


class WatchedFranka(pc.Franka):
    """It keeps the share of packets that came in time, of the last hundred."""

    def __init__(self):
        super().__init__("127.0.0.1", enforce_real_time=False)
        self.rates = []

    def read(self):
        measured = super().read()
        self.rates.append(self.state.control_command_success_rate)
        return measured


class UnpluggedFranka(pc.Franka):
    """Its robot vanishes at a time on the robot's own clock: a timer of this computer may be late by seconds."""

    def __init__(self, server, after):
        super().__init__("127.0.0.1", enforce_real_time=False)
        self.server, self.after, self.begin, self.t = server, after, None, 0.0

    def read(self):
        if self.t > self.after and self.server.poll() is None:
            self.server.kill()
            self.server.wait()
            self.unplugged = self.t
        measured = super().read()
        self.begin = measured.t if self.begin is None else self.begin
        self.t = measured.t - self.begin
        return measured


def law_of(kind, urdf):
    robot = pc.load_robot(urdf).with_armature(ROTORS)
    task = pc.Lissajous(np.full(7, 0.2), [1, 2, 1, 2, 1, 2, 1], 0.5, center=HOME)
    extended = pc.ExtendedMotionPlan(robot, task, K_p=400.0, K_v=40.0, k=5.0)
    return pc.Paced(extended) if kind == "paced" else pc.Projection(robot, task, 400.0, 40.0)


def rms_error(task, s, q):
    """The root mean square of ‖e_p‖ [rad] over positions (K, n), with those of the plan (K,)."""
    return np.sqrt((np.linalg.norm(task.q_d(s) - q, axis=-1) ** 2).mean())


@pytest.mark.parametrize("kind", KINDS)
def test_a_law_drives_the_robot_as_it_drives_the_simulation(simulator, kind):
    law, duration = law_of(kind, urdf_of(simulator)), float(os.environ.get("PATHCONTROL_FRANKA_SECONDS", SECONDS))
    with serve(simulator):
        arm = WatchedFranka()
        record = drive(ControlLoop(law, H, pc.Franka.envelope), arm, duration, SETTLE)
    ticks = int(np.searchsorted(record.t, duration))
    success = np.mean(arm.rates[100:ticks])
    late = not success >= 0.99 or record.stopped or (record.mode[:ticks] != Mode.RUN).any()
    if late and not MEASURES and not {"law", "motion", "tube"} & set(record.status.faults):
        pytest.skip(f"this machine has no time for 1 kHz: {success:.1%} of the packets came in time; {record.stopped}")
    assert record.stopped == ""
    assert (record.mode[:ticks] == Mode.RUN).all()
    assert record.status.mode == Mode.HOLD
    assert not {"law", "measurement", "motion", "tube"} & set(record.status.faults)
    assert record.t[-1] == pytest.approx(duration + SETTLE, abs=0.05)
    run = pc.simulate(law, record.q[0], record.qd[0], duration=duration, loop=pc.SampledLoop(period=H), progress=False)
    settled = round(SETTLED / H)  # once the first errors have gone
    mine = rms_error(law.task, record.s[settled - 1 : ticks - 1], record.q[settled:ticks])
    theirs = rms_error(law.task, run.array("s")[0, settled:], run.array("q")[0, settled:])
    print(f"{kind}: success {success:.4f}, |e_p| {mine:.5g} rad, simulated {theirs:.5g} rad, ticks {ticks}")
    assert mine == pytest.approx(theirs, rel=0.05)
    assert success >= 0.99


def test_a_connection_that_is_lost_ends_in_the_fallback_of_the_loop(simulator):
    law = law_of("projection", urdf_of(simulator))
    loop = ControlLoop(law, H, pc.Franka.envelope)
    with serve(simulator, enforced=()) as server:  # or packets that a busy computer loses would stop it before
        arm = UnpluggedFranka(server, after=0.2)
        record = drive(loop, arm, 30.0)
    assert "libfranka" in record.stopped
    assert loop.status.mode == Mode.GRAVITY
    assert 0.2 < arm.unplugged <= record.t[-1] < arm.unplugged + 0.2  # a few states may be on their way


def test_a_robot_that_is_not_there_is_an_error_and_priorities_stay_as_they_were():
    pytest.importorskip("pylibfranka")
    before = os.sched_getscheduler(0)
    with pytest.raises(ArmError, match=r"192\.0\.2\.1|0\.0\.0\.1|cannot be used"):
        pc.Franka("127.0.0.254", enforce_real_time=False)
    assert os.sched_getscheduler(0) == before


def test_no_torque_is_a_step_away_from_what_the_robot_had_or_was_sent():
    """Each joint is limited by itself, so these are as many robots."""
    rng = np.random.default_rng(0)
    tau, had, further = rng.uniform(-1, 1, (3, 10_000, 7)) * np.reshape([5, 5, 1.99], (3, 1, 1))
    further[:100] = np.clip(np.round(further[:100]), -1.99, 1.99)  # also no difference, and that of a whole step
    sent = had + further
    limited = franka._limit_step(tau, had, sent)
    for reference in (had, sent):
        assert (np.abs(limited - reference) <= 0.999 + 1e-9).all()
    within = (np.abs(tau - had) < 0.99) & (np.abs(tau - sent) < 0.99)
    assert (limited[within] == tau[within]).all()
    np.testing.assert_array_equal(franka._limit_step(tau, had, None), franka._limit_step(tau, had, had))
