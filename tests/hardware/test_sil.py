"""Software in the loop: a machine of another maker's mechanics, and a line that loses, delays and falsifies packets."""

from __future__ import annotations

import contextlib
import heapq
import json
import select
import socket
import threading
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from click.testing import CliRunner

import pathcontrol as pc
from pathcontrol.cli import main
from pathcontrol.cli.sil_command import describe_report
from pathcontrol.errors import ArmError, InputError
from pathcontrol.hardware.real_time import real_time
from pathcontrol.hardware.sil import session
from pathcontrol.hardware.sil.machine import Machine
from pathcontrol.hardware.sil.machine_arm import MachineArm
from pathcontrol.hardware.sil.machine_process import MachineProcess, choose_settings
from pathcontrol.hardware.sil.mjcf import friction_bias, write_mjcf
from pathcontrol.hardware.sil.packets import LONGEST, Kind, Packet, write_packet
from pathcontrol.hardware.sil.session import finish_session, run_sil

KEY = b"a key of a test, 24 byte"
H = 2e-3


def law_of(kind=pc.ExtendedMotionPlan):
    robot = pc.load_robot("cicese_2dof")
    task = pc.Lissajous([0.3, 0.3], [1, 2], 0.5, center=[0.2, 0.4])
    gains = {"k_p": 400.0} if kind is pc.Projection else {"K_p": 400.0, "k": 5.0}
    return kind(robot, task, K_v=40.0, **gains)


@pytest.fixture
def briefly(monkeypatch):
    """Sessions have less time to come to rest in, which is enough for these arms."""
    monkeypatch.setattr(session, "drive", partial(session.drive, settle=0.4))


def start_of(law):
    return np.asarray(law.task.q_d(np.array(law.task.s0)), dtype=float)


# --- the machine -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cicese_2dof", "ur5", "panda"])
def test_the_machine_has_the_dynamics_of_the_arm(name):
    """MuJoCo's own recursion gives the mass matrix and the bias torques of Pinocchio."""
    mujoco = pytest.importorskip("mujoco")
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0} if name == "panda" else None
    robot = pc.load_robot(name, lock=fingers)
    model = mujoco.MjModel.from_xml_string(write_mjcf(robot, 1e-3))
    data, M = mujoco.MjData(model), np.zeros((robot.n, robot.n))
    for q, qd in np.random.default_rng(0).normal(size=(10, 2, robot.n)):
        data.qpos[:], data.qvel[:] = q, qd
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, M)
        scale = np.abs(robot.mass_matrix(q)).max()
        np.testing.assert_allclose(M, robot.mass_matrix(q), atol=1e-6 * scale)
        bias = robot.nonlinear_effects(q, qd)
        np.testing.assert_allclose(data.qfrc_bias, bias, atol=1e-6 * np.abs(bias).max())


def test_dry_friction_of_the_machine_is_that_of_both_directions():
    robot = pc.load_robot("cicese_2dof")
    assert friction_bias(robot) == pytest.approx([(7.17 - 8.049) / 2, 0.0])
    text = write_mjcf(robot, 1e-3)
    assert f'frictionloss="{(7.17 + 8.049) / 2!r}"' in text
    assert 'damping="2.288"' in text


@pytest.mark.usefixtures("briefly")
def test_a_session_ends_on_the_path_and_says_what_happened():
    pytest.importorskip("mujoco")
    law = law_of(pc.Projection)  # the command and the lines below have the other law
    envelope = pc.Envelope(velocity=20.0, lower=-9.0, upper=9.0, patience=50, lost=100.0)
    report = run_sil(law, start_of(law), 0.3, H, envelope=envelope)
    assert json.loads(json.dumps(report.to_dict())) == report.to_dict()
    assert report.ticks >= 10  # hundreds on a computer that has time
    assert set(report.jitter) == {"p50", "p90", "p99", "p99.9", "max"}
    assert list(report.jitter.values()) == sorted(report.jitter.values())
    assert report.events["stopped"] == ""
    assert is_safe(report)
    assert report.packets["machine"]["taken"] >= 10


def is_safe(report):
    """On the path or at rest."""
    return report.end["distance"] < 0.1 or report.end["speed"] < 0.1


# --- a line that does all that lines do ----------------------------------------------------------------------------


class MachineThread:
    """A machine in a thread: a process of its own would take longer to start than the whole session."""

    def __init__(self, robot, q):
        self.machine = Machine(choose_settings(robot, q, H, "127.0.0.1", 0, KEY))
        self.port = self.machine.port
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        with real_time():
            self.machine.run()

    def wait(self):
        self.thread.join(10.0)
        assert not self.thread.is_alive()
        self.machine._line.close()
        return self.machine.summary()


class Line:
    """A relay between loop and machine; a ``fault`` makes of each packet those that go on, with their delays [s]."""

    def __init__(self, port, fault):
        self.front, self.back = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.front.bind(("127.0.0.1", 0))
        self.back.connect(("127.0.0.1", port))
        self.port, self.fault, self.loop = self.front.getsockname()[1], fault, None
        self.waiting, self.count, self.ended = [], 0, False
        self.thread = threading.Thread(target=self.relay, daemon=True)
        self.thread.start()

    def relay(self):
        with real_time():  # where that is allowed, or a busy computer adds delays that no test asked for
            while not self.ended:
                self.pass_on()

    def pass_on(self):
        due = self.waiting[0][0] - time.monotonic() if self.waiting else 0.05
        for line in select.select([self.front, self.back], [], [], max(due, 0.0))[0]:
            forward = line is self.front
            try:
                data, sender = line.recvfrom(LONGEST + 1)
            except OSError:  # nobody listens at the other end
                continue
            self.loop = sender if forward else self.loop
            for delay, changed in self.fault(self.count, data):
                heapq.heappush(self.waiting, (time.monotonic() + delay, self.count, forward, changed))
            self.count += 1
        while self.waiting and self.waiting[0][0] <= time.monotonic():
            _, _, forward, data = heapq.heappop(self.waiting)
            with contextlib.suppress(OSError):
                self.back.send(data) if forward else self.front.sendto(data, self.loop)

    def close(self):
        self.ended = True
        self.thread.join()
        self.front.close()
        self.back.close()


RNG = np.random.default_rng(5)
OLD = []


def replay(count, data):
    """Each packet twice, and one of long ago."""
    OLD.append(data)
    return [(0.0, data), (0.0, data), (0.0, OLD[len(OLD) // 2])]


def garble(count, data):
    changed = bytearray(data)
    changed[int(RNG.integers(len(data)))] ^= 0xFF
    return [(0.0, bytes(changed) if RNG.random() < 0.5 else data), (0.0, RNG.bytes(int(RNG.integers(1, 200))))]


BEFORE = 200  # packets before a fault begins

FAULTS = {
    "half of them lost": lambda count, data: [(0.0, data)] if RNG.random() < 0.5 else [],
    "all lost but the goodbye": lambda count, data: [(0.0, data)] if count < BEFORE or data[4] == Kind.BYE else [],
    "late": lambda count, data: [(0.01, data)],
    "very late": lambda count, data: [(0.0 if count < BEFORE else 0.2, data)],
    "out of order": lambda count, data: [(float(RNG.uniform(0, 0.006)), data)],
    "garbage": garble,
    "doubled and replayed": replay,
}


@pytest.mark.usefixtures("briefly")
@pytest.mark.parametrize("what", FAULTS)
def test_whatever_the_line_does_the_arm_ends_on_its_path_or_at_rest(what):
    pytest.importorskip("mujoco")
    law = law_of()
    OLD.clear()
    machine = MachineThread(law.robot, start_of(law))
    line = Line(machine.port, FAULTS[what])
    arm = MachineArm(law.robot, "127.0.0.1", line.port, KEY, H)
    loop = pc.ControlLoop(law, H, pc.Envelope(velocity=20.0, lower=-9.0, upper=9.0, patience=10, lost=25.0))
    report = finish_session(loop, arm, 0.3)
    told = machine.wait()
    line.close()
    assert is_safe(report), report
    counted = told["packets"]
    assert counted.get("taken", 0) > 0, told
    assert np.abs(told["qd"]).max() < 5.0  # the machine's own word
    if what == "garbage":
        assert counted["foreign"] > 0
        assert report.packets["loop"]["foreign"] > 0
    if what == "doubled and replayed":
        for side in (counted, report.packets["loop"]):
            assert side["repeated"] > 0
            assert side["taken"] <= told["ticks"] + 1  # each once
    if what == "all lost but the goodbye":
        assert report.events["mode"] == "GRAVITY"
        assert counted["braked"] > 50, told  # 200, and those before the first torque
        assert np.abs(told["qd"]).max() < 1e-2


def test_packets_from_elsewhere_move_nothing():
    """A stranger without the key, and one with the key but at another address."""
    pytest.importorskip("mujoco")
    law = law_of()
    machine = MachineProcess(law.robot, start_of(law), H)
    arm = MachineArm(law.robot, "127.0.0.1", machine.port, machine.key, H)
    assert arm.read() is not None
    stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for number in range(200):
        wild = Packet(Kind.TORQUE, arm._session, number, np.array([150.0, -15.0]))
        for key in (machine.key, KEY):
            stranger.sendto(write_packet(wild, key), ("127.0.0.1", machine.port))
        time.sleep(5e-4)
    arm.finish()
    told = machine.wait()
    assert told["packets"]["foreign"] > 100
    assert told["packets"].get("taken", 0) == 0
    np.testing.assert_allclose(told["q"], start_of(law), atol=1e-4)  # the brakes held it


def test_no_machine_is_told(monkeypatch):
    monkeypatch.setattr("pathcontrol.hardware.sil.machine_arm._MEET", 0.3)
    arm = MachineArm(law_of().robot, "127.0.0.1", 9, KEY)
    with pytest.raises(ArmError, match="no machine answers"):
        arm.read()
    arm.finish()


# --- the command -----------------------------------------------------------------------------------------------------


def invoke(*words):
    return CliRunner().invoke(main, ["sil", *words])


@pytest.mark.usefixtures("briefly")
def test_the_command_drives_the_papers_experiment_and_says_the_numbers():
    pytest.importorskip("mujoco")
    done = invoke("--duration", "0.3", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert {"ticks", "missed", "jitter", "peaks", "events", "packets", "end", "real_time"} <= set(told)
    assert {"e_p", "contour_error", "qd", "tau", "tau_ratio"} <= set(told["peaks"]) or not told["peaks"]
    assert told["ticks"] >= 10


def test_the_numbers_are_said_in_words_with_their_units():
    report = session.SilReport(
        1000,
        3,
        {"p50": 29e-6, "max": 4.8e-3},
        {"e_p": 0.01, "contour_error": 0.009, "qd": 1.9, "tau": 35.27, "tau_ratio": 0.235},
        {"faults": {"deadline": 2, "measurement": 7}, "resumed": 1, "stopped": "", "mode": "HOLD", "reason": "why"},
        {},
        {"distance": 0.005, "speed": 0.0015},
        False,
    )
    said = describe_report(report)
    for part in (
        "29 µs",
        "e_p 0.01 rad",
        "velocity 1.9 rad/s",
        "torque 35.27 N m",
        "late steps: 2, bad measurements: 7",
    ):
        assert part in said
    assert "resumed once" in said
    assert "{" not in said
    assert "nothing to react to" in describe_report(replace(report, events=report.events | {"faults": {}}))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--serve", "0.0.0.0:9700"), "a key is needed"),
        (("--connect", "10.0.0.1:9700"), "a key is needed"),
        (("--connect", "here"), "HOST:PORT"),
        (("--serve", "127.0.0.1:1", "--connect", "127.0.0.1:1"), "--serve"),
        (("--task", "missing.toml"), "experiment file"),
        (("--key", "missing.key"), "there is no file"),
        (("--duration", "-1"), "duration"),
    ],
)
def test_what_cannot_be_driven_is_told(words, said):
    done = invoke(*words)
    assert done.exit_code == 2
    assert said in done.output


def test_wrong_arguments_are_told_before_a_machine_starts(monkeypatch):
    pytest.importorskip("mujoco")
    law = law_of()
    monkeypatch.setattr(session, "MachineProcess", None)  # calling it would be another error
    for duration in (-1.0, 0.0, np.nan, np.inf, "long"):
        with pytest.raises(InputError, match="duration"):
            run_sil(law, start_of(law), duration)
    for q in ([0.0], [np.nan, 0.0], [[0.0, 0.0]] * 2):
        with pytest.raises(InputError, match=r"^q"):
            run_sil(law, q, 1.0)
    for duration in ("-1", "nan", "inf"):
        told = CliRunner().invoke(main, ["sil", "--duration", duration])
        assert told.exit_code == 2
        assert "--duration" in told.output


def test_an_address_that_is_taken_or_not_there_is_told_in_a_sentence():
    pytest.importorskip("mujoco")
    law = law_of()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(ArmError, match=rf"127\.0\.0\.1:{port} did not start: Address already in use"):
            MachineProcess(law.robot, start_of(law), H, port=port)
    for port in (-5, 99999, "ssh"):
        with pytest.raises(InputError, match="port"):
            MachineArm(law.robot, "127.0.0.1", port, bytes(32), H)
    with pytest.raises(InputError, match="expected bytes"):
        MachineArm(law.robot, "127.0.0.1", 9700, "a key that is a text", H)
    with pytest.raises(ArmError, match=r"no\.such\.host\.invalid:9700"):
        MachineArm(law.robot, "no.such.host.invalid", 9700, bytes(32), H)


def test_a_session_that_breaks_leaves_no_machine_behind(monkeypatch):
    pytest.importorskip("mujoco")
    law, started = law_of(), []

    def start(*arguments):
        started.append(MachineProcess(*arguments))
        return started[0]

    monkeypatch.setattr(session, "MachineProcess", start)
    monkeypatch.setattr(session, "drive", lambda *arguments: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run_sil(law, start_of(law), 1.0, H)
    assert not started[0].running
