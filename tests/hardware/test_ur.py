"""An arm of Universal Robots through ur_rtde, against a peer that records what it is sent; see ``ur_peer``."""

import fcntl
import re
import tempfile
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import ur_peer

import pathcontrol as pc
from pathcontrol.errors import ArmError, InputError
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.drive import drive

H = 2e-3
CENTER = [0.0, -1.2, 1.4, -0.2, 1.5, 0.0]


@pytest.fixture
def peer():
    """A controller whose arm goes along the path of the law, whatever torques it is sent."""
    pytest.importorskip("rtde_control", reason="ur_rtde has no wheel for this platform")
    task = law_of().task
    s = 0.5 * H * np.arange(3000)
    motion = np.hstack([task.q_d(s) + 1e-3 * np.sin(40 * s)[:, None], 0.5 * task.dq_d(s)])
    with open(Path(tempfile.gettempdir()) / "ur-30004.lock", "w") as file:  # the ports are fixed
        fcntl.flock(file, fcntl.LOCK_EX)
        process = ur_peer.PeerProcess(motion.tolist())
        yield process
        process.kill()


def law_of():
    task = pc.Lissajous(np.full(6, 0.2), [1, 2, 1, 2, 1, 2], 0.5, center=CENTER)
    return pc.Projection(pc.load_robot("ur5"), task, k_p=400.0, K_v=40.0)


class StoppedUR(pc.UR):
    """Something happens to it at a time on its own clock: a timer of this computer may be late by seconds."""

    def __init__(self, event, after):
        super().__init__("127.0.0.1")
        self.event, self.after, self.begin = event, after, None

    def read(self):
        measured = super().read()
        if measured is not None:
            self.begin = measured.t if self.begin is None else self.begin
            if self.event is not None and measured.t - self.begin > self.after:
                self.event()
                self.event = None
        return measured


def registers(command, first):
    """Six input registers of a package from ``first``."""
    return [command[f"input_double_register_{k}"] for k in range(first, first + 6)]


def test_the_torques_in_the_packages_are_those_of_the_law_without_gravity(peer):
    law = law_of()
    loop, arm = ControlLoop(law, H), pc.UR("127.0.0.1")
    record = drive(loop, arm, 0.5, settle=0.0)
    log, commands = peer.change()
    assert record.stopped == ""
    sent = [command for command in commands if command["input_int_register_0"] == ur_peer.TORQUE]
    measured = np.isfinite(record.t)
    assert measured.sum() >= 10  # nearly all on a computer that has time, some on a busy one
    expected = record.tau[measured] - [law.robot.gravity(q) for q in record.q[measured]]
    got = np.array([registers(command, 0) for command in sent])
    np.testing.assert_array_equal(got[measured], expected)
    assert np.abs(got[measured] - record.tau[measured]).max() > 1.0  # gravity is not nothing
    assert {value for command in sent for value in registers(command, 6) + registers(command, 12)} == {0.0}
    script = b"".join(data for kind, data in log if kind == "script")
    assert b"direct_torque(torque" in script


def test_the_loop_reads_positions_velocities_and_time_of_one_state(peer):
    arm = pc.UR("127.0.0.1")
    states = (measured for measured in iter(arm.read, "no end") if measured is not None)
    read = list(islice(states, 100))  # on a busy computer some reads find none
    arm.finish()
    times = np.array([measured.t for measured in read])
    assert (np.diff(times) > 0).all()
    s = 0.5 * np.minimum(times - 100.0 - H, 2999 * H)  # the peer's row of that time, of 3000
    task = law_of().task
    np.testing.assert_allclose([m.q for m in read], task.q_d(s) + 1e-3 * np.sin(40 * s)[:, None], atol=1e-9)
    np.testing.assert_allclose([m.qd for m in read], 0.5 * task.dq_d(s), atol=1e-9)


@pytest.mark.parametrize(
    ("event", "reason"),
    [
        (lambda peer: peer.change(safety_status_bits=ur_peer.PROTECTIVE_STOP), "protective stop"),
        (lambda peer: peer.change(safety_status_bits=ur_peer.EMERGENCY_STOP), "emergency stop"),
        (lambda peer: peer.kill(), "connection|script"),
    ],
    ids=["protective stop", "emergency stop", "lost connection"],
)
def test_a_robot_that_stops_leaves_the_loop_in_its_fallback(peer, event, reason):
    loop = ControlLoop(law_of(), H)
    record = drive(loop, StoppedUR(lambda: event(peer), after=0.1), 60.0)  # far longer than a busy computer needs
    assert re.search(reason, record.stopped)
    assert loop.status.mode == Mode.GRAVITY
    assert loop.status.reason == record.stopped
    assert 0.1 < np.nanmax(record.t) < 50.0
    np.testing.assert_array_equal(loop.step(record.q[-1], record.qd[-1], np.nan), loop.gravity)


def test_a_robot_that_is_not_there_is_an_error():
    pytest.importorskip("rtde_control")
    with pytest.raises(ArmError, match=r"127\.0\.0\.254"):
        pc.UR("127.0.0.254")
    with pytest.raises(InputError, match="frequency"):
        pc.UR("127.0.0.254", frequency=-1.0)
