"""Driving an arm by a loop: what is sent, how it ends, and what the record holds."""

import gc
import signal

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import ArmError, InputError
from pathcontrol.hardware.arm import Measurement
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.drive import drive
from pathcontrol.hardware.envelope import Envelope
from pathcontrol.simulation.compiled_plant import CompiledPlant

H = 2e-3
WIDE = Envelope(torque=1e6, torque_rate=1e12, velocity=1e3, lower=-1e3, upper=1e3, tube=np.inf)


def law_of(kind=pc.Projection):
    task = pc.Lissajous([0.3, 0.3], [1, 2], 0.5, center=[0.2, 0.4])
    gains = {"k_p": 400.0} if kind is pc.Projection else {"K_p": 400.0, "k": 5.0}
    return kind(pc.load_robot("cicese_2dof"), task, K_v=40.0, **gains)


class SimulatedArm:
    """An arm in this process; ``events`` are called at a tick with the arm, and may lose a measurement or stop it."""

    def __init__(self, law, carries_weight=False, **events):
        self.carries_weight, self.events = carries_weight, {int(k[4:]): act for k, act in events.items()}
        self.robot, self.plant = law.robot, CompiledPlant(law.robot, H)
        self.q = np.asarray(law.task.q_d(np.array(law.task.s0)), float).reshape(1, -1)
        self.qd, self.reads, self.sent, self.finished = np.zeros_like(self.q), 0, [], 0

    def locate(self):
        return Measurement(self.q[0].copy(), self.qd[0].copy(), 3.0)

    def read(self):
        self.reads += 1
        if self.reads in self.events and self.events[self.reads](self) == "lost":
            return None
        return Measurement(self.q[0].copy(), self.qd[0].copy(), 7.0 + H * self.reads)

    def write(self, tau):
        self.sent.append(tau)
        acting = tau + self.robot.gravity(self.q[0]) if self.carries_weight else tau
        self.q, self.qd = self.plant.advance(self.q, self.qd, acting[None])

    def finish(self):
        self.finished += 1


def stop(arm):
    raise ArmError("protective stop")


def interrupt(arm):
    signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("kind", [pc.Projection, pc.ExtendedMotionPlan])
def test_a_drive_is_the_simulation_of_its_law(kind):
    law = law_of(kind)
    run = pc.simulate(law, law.task.q_d(0.0), duration=0.4, loop=pc.SampledLoop(period=H), progress=False)
    record = drive(ControlLoop(law, H, WIDE), SimulatedArm(law), 0.4, settle=0.0)
    ticks = len(record.t)
    assert ticks == 201
    for mine, theirs in (("q", "q_measured"), ("qd", "qd_measured"), ("tau", "tau_demand")):
        np.testing.assert_allclose(getattr(record, mine), run.array(theirs)[0, :ticks], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(record.t, H * np.arange(ticks), atol=1e-12)


def test_the_run_of_a_drive_is_that_of_its_log():
    law = law_of(pc.ExtendedMotionPlan)
    arm = SimulatedArm(law, tick30=lambda arm: "lost")
    loop = ControlLoop(law, H, WIDE)
    with loop.record() as log:
        record = drive(loop, arm, 0.3, settle=0.2)
    run, logged = record.run(), log.run()
    assert len(run.time) == len(record.t)
    assert set(run.data) == set(logged.data)
    for name in run.data:
        np.testing.assert_array_equal(run.data[name], logged.data[name], err_msg=name)
    assert {**run.config, "loop": 0} == {**logged.config, "loop": 0}
    measured = np.isfinite(record.t)
    for name in ("q", "qd", "tau"):
        np.testing.assert_array_equal(run.array(name)[0][measured], getattr(record, name)[measured])
    np.testing.assert_array_equal(run.array("s")[0, 1:], record.s[:-1])  # the record has it after the tick
    np.testing.assert_array_equal(run.array("mode")[0], record.mode)
    assert pc.metrics(run)["contour_error_peak"][0] < 0.05


def test_a_drive_goes_on_in_a_log_and_leaves_the_loop_as_it_was():
    law = law_of()
    loop = ControlLoop(law, H, WIDE)
    first, second = (drive(loop, SimulatedArm(law), 0.1, settle=0.0) for _ in range(2))
    for record in (first, second):
        assert len(record.run().time) == len(record.t) == 51
    loop.recording = False
    with pytest.raises(InputError, match="recording"):
        drive(loop, SimulatedArm(law), 0.1, settle=0.0).run()
    assert not loop.recording


def test_torques_go_without_weight_to_an_arm_that_carries_its_own():
    law = law_of()
    arm = SimulatedArm(law, carries_weight=True)
    record = drive(ControlLoop(law, H, WIDE), arm, 0.2, settle=0.0)
    np.testing.assert_array_equal(arm.sent, record.tau - [law.robot.gravity(q) for q in record.q])
    assert np.abs(np.array(arm.sent) - record.tau).max() > 1.0


def test_a_lost_measurement_gives_finite_torques_also_to_an_arm_that_carries_its_own_weight():
    arm = SimulatedArm(law_of(), carries_weight=True, **{f"tick{k}": lambda arm: "lost" for k in range(50, 80)})
    loop = ControlLoop(law_of(), H, Envelope())
    record = drive(loop, arm, 0.2, settle=0.0)
    assert np.isfinite(arm.sent).all()
    assert np.isnan(record.q[49:79]).all()
    assert Mode.GRAVITY in record.mode
    assert record.status.mode == Mode.DAMP
    gravity_only = np.array(arm.sent)[record.mode == Mode.GRAVITY][-1]
    assert np.abs(gravity_only).max() == 0.0


def test_a_drive_ends_on_the_path_at_rest():
    law = law_of()
    arm = SimulatedArm(law)
    record = drive(ControlLoop(law, H), arm, 0.5)
    assert arm.finished == 1
    assert (record.status.mode, record.status.reason) == (Mode.HOLD, "the drive ended after 0.5 s")
    assert record.status.faults == {}  # the end is none
    assert np.abs(record.qd[-1]).max() < 1e-2 < np.abs(record.qd[250]).max()
    assert record.stopped == ""


def test_ctrl_c_ends_a_drive_in_the_same_way():
    arm = SimulatedArm(law_of(), tick50=interrupt)
    record = drive(ControlLoop(law_of(), H), arm, 100.0)
    assert arm.finished == 1
    assert record.t[-1] < 1.0
    assert (record.status.mode, record.status.reason) == (Mode.HOLD, "the drive ended by Ctrl-C")
    assert np.abs(record.qd[-1]).max() < 1e-2


def test_an_arm_that_stops_by_itself_leaves_a_loop_that_only_carries_weight():
    arm = SimulatedArm(law_of(), tick50=stop)
    loop = ControlLoop(law_of(), H)
    record = drive(loop, arm, 1.0)
    assert (record.stopped, len(record.t), arm.finished) == ("protective stop", 49, 1)
    assert (record.status.mode, record.status.reason) == (Mode.GRAVITY, "protective stop")
    assert record.status.faults == {"arm": 1}
    loop.step(arm.q[0], arm.qd[0], 1.0)
    assert loop.status.mode == Mode.DAMP  # measured again: braked, until it is resumed
    loop.resume()
    assert loop.status.mode == Mode.RUN


def test_a_drive_from_afar_is_refused_before_anything_moves():
    arm = SimulatedArm(law_of())
    arm.q = arm.q + 1.0
    with pytest.raises(ArmError, match="from the path, the tube is"):
        drive(ControlLoop(law_of(), H), arm, 1.0)
    assert (arm.reads, arm.sent, arm.finished) == (0, [], 1)


def test_an_arm_that_gives_no_measurement_is_an_error_and_torque_control_is_ended():
    arm = SimulatedArm(law_of(), **{f"tick{k}": lambda arm: "lost" for k in range(1, 101)})
    with pytest.raises(ArmError, match="no measurement"):
        drive(ControlLoop(law_of(), H), arm, 1.0)
    assert (arm.finished, arm.sent) == (1, [])


def test_an_arm_whose_clock_stands_does_not_keep_a_drive_for_ever():
    law = law_of()
    arm = SimulatedArm(law, **{f"tick{k}": lambda arm: "lost" for k in range(2, 5000)})
    record = drive(ControlLoop(law, H), arm, 0.5)
    assert len(record.t) <= (0.5 + 0.7) / H + 2
    assert record.status.mode == Mode.GRAVITY


@pytest.mark.parametrize("options", [{"duration": 0.0}, {"duration": np.nan}, {"duration": 1.0, "settle": -1.0}])
def test_times_are_checked_before_the_arm_is_read(options):
    arm = SimulatedArm(law_of())
    with pytest.raises(InputError):
        drive(ControlLoop(law_of(), H), arm, **options)
    assert arm.reads == 0


def test_garbage_is_collected_again_after_a_drive():
    collecting = []
    arm = SimulatedArm(law_of(), tick20=lambda arm: collecting.append(gc.isenabled()))
    drive(ControlLoop(law_of(), H), arm, 0.1)
    assert collecting == [False]
    assert gc.isenabled()


def test_what_is_no_arm_is_told_before_anything_moves():
    with pytest.raises(InputError, match="arm is a NoneType without carries_weight, locate"):
        drive(ControlLoop(law_of(), H), None, 1.0)
    with pytest.raises(InputError, match="expected a ControlLoop: ControlLoop"):
        drive(law_of(), SimulatedArm(law_of()), 1.0)
