"""The log of a control loop: what the loop did, no more and no less, even if its process is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import InputError, PathControlWarning, StorageError
from pathcontrol.hardware.sample_ring import SampleRing

ROBOT = pc.load_robot("cicese_2dof").with_friction(pc.no_friction(2))
EIGHT = pc.Lissajous([0.3, 0.3], [1, 2], speed=0.8, center=[0.2, 0.4])
H = 2.5e-3


def loop_of(law=None):
    law = pc.ExtendedMotionPlan(ROBOT, EIGHT, 400.0, 40.0, k=20.0) if law is None else law
    return pc.ControlLoop(law, H, pc.Envelope(torque=1e3, torque_rate=1e9, velocity=20.0, lower=-9.0, upper=9.0))


def replay(loop, run, begin=5.0):
    """The loop on the measurements of a run, at a clock of its own."""
    loop.start(run.array("q")[0, 0], run.array("qd")[0, 0], begin)
    for q, qd, t in zip(run.array("q")[0], run.array("qd")[0], run.time, strict=True):
        loop.step(q, qd, begin + t)


def simulate(law):
    start = np.asarray(EIGHT.q_d(np.array(0.0))) + np.array([0.05, 0.0])
    return pc.simulate(law, start, duration=0.6, progress=False)


@pytest.mark.parametrize("kind", ["plain", "overridden"])
@pytest.mark.parametrize("where", ["memory", "file"])
def test_the_log_of_a_loop_is_the_run_that_it_replays(kind, where, tmp_path):
    if where == "file":
        pytest.importorskip("mcap")
    law = pc.ExtendedMotionPlan(ROBOT, EIGHT, 400.0, 40.0, k=20.0)
    law = law if kind == "plain" else pc.SpeedOverride(law, [[0.2, 0.3], [0.4, 1.2]])
    run, loop = simulate(law), loop_of(law)
    with loop.record(tmp_path / "log.mcap" if where == "file" else None) as log:
        replay(loop, run)
    found = log.run()
    assert len(found.time) == len(run.time)
    np.testing.assert_allclose(found.time, run.time, atol=1e-9)
    for name in ("q", "qd", "tau", "tau_demand", "s"):
        assert (found.array(name) == run.array(name)).all(), name
    for name in ("e_p", "e_v"):  # the engine's path is a table, within 1e-9 of the path
        assert np.abs(found.array(name) - run.array(name)).max() < 1e-8, name
    assert np.abs(found.array("sdot") - run.array("sdot"))[:, :-1].max() < 0.05  # a mean over the period
    assert (found.data["mode"] == pc.Mode.RUN).all()
    before, after = pc.metrics(run), pc.metrics(found)
    for name in ("contour_error_rms", "gamma_distance_peak", "tau_peak"):
        assert before[name] == after[name]
    assert repr(found.task) == repr(run.task)


@pytest.mark.parametrize("where", ["memory", "file"])
def test_what_a_law_has_to_say_at_the_end_is_in_the_log(where, tmp_path):
    if where == "file":
        pytest.importorskip("mcap")
    law = pc.Learned(pc.Projection(ROBOT, EIGHT, 400.0, 40.0), nodes=16)
    loop, q = loop_of(law), EIGHT.q_d(np.array(0.0))
    with loop.record(tmp_path / "log.mcap" if where == "file" else None) as log:
        loop.start(q)
        for k in range(3):
            loop.step(q, np.zeros(2), k * H)
        z = loop.state
        law.recall(z).forgotten[...], law.recall(z).time[...] = 2.0, 0.004
        loop._plan._held.start_from(z, 3)
    run = log.run()
    assert run.array("forgotten").tolist() == [2]
    assert run.array("forgotten_time").tolist() == [0.004]


class Speechless(pc.ExtendedMotionPlan):
    """A law of a user that fails where it is asked for what it has to say."""

    def outcome(self, z):
        raise KeyError("laps")


@pytest.mark.parametrize("where", ["memory", "file"])
def test_a_law_that_fails_at_the_end_does_not_cost_the_log(where, tmp_path):
    if where == "file":
        pytest.importorskip("mcap")
    loop = loop_of(Speechless(ROBOT, EIGHT, 400.0, 40.0, k=20.0))
    log = loop.record(tmp_path / "log.mcap" if where == "file" else None)
    q = EIGHT.q_d(np.array(0.0))
    loop.start(q)
    for i in range(10):
        loop.step(q, np.zeros(2), i * H)
    with pytest.warns(PathControlWarning, match="no outcomes: the law raised KeyError: 'laps'"):
        assert len(log.run().time) == 10


def test_faults_are_in_the_log(tmp_path):
    law = pc.ExtendedMotionPlan(ROBOT, EIGHT, 400.0, 40.0, k=20.0)
    run, loop = simulate(law), loop_of(law)
    with loop.record() as log:
        loop.start(run.array("q")[0, 0], run.array("qd")[0, 0])
        for k, t in enumerate(run.time):
            q = run.array("q")[0, k]
            loop.step(None if 100 <= k < 120 else q, run.array("qd")[0, k], t)
    found = log.run()
    mode = found.array("mode")[0]
    assert len(found.time) == len(run.time)
    assert (mode[:105] == pc.Mode.RUN).all()
    assert (mode[106:120] == pc.Mode.GRAVITY).all()
    assert (mode[120:] == pc.Mode.DAMP).all()
    assert (found.array("q")[0, 100:120] == run.array("q")[0, 99]).all()  # the last good one


def test_lost_measurements_in_a_log_are_no_disturbance():
    """The log has the last good one in their place, which is no motion; the rest is the error of the cubic."""
    law = pc.ExtendedMotionPlan(ROBOT, EIGHT, 400.0, 40.0, k=20.0)
    loop, arm = loop_of(law), pc.Plant(ROBOT, H)
    q, qd = EIGHT.q_d(np.zeros(1)), np.zeros((1, 2))
    loop.start(q[0], qd[0])
    with loop.record() as log:
        for k in range(120):
            tau = loop.step(q[0] * (np.nan if k % 40 in (30, 31, 32) else 1.0), qd[0], k * H)
            q, qd = arm.advance(q, qd, tau[None])
    run = log.run()
    assert (np.diff(run.array("q")[0], axis=0) == 0).all(-1).sum() == 9
    assert np.abs(pc.momentum_observer(run)).max() < 0.05


def test_the_ring_loses_the_newest_and_never_waits_nor_grows():
    ring = SampleRing(2, 8)
    rows = ring._rows
    for k in range(20):
        ring.put(k, 0.0, 1.0, 0, *np.full((4, 2), k))
        assert ring._rows is rows
    assert ring.lost == 12
    assert ring.take()["time"].tolist() == list(range(8))
    assert not len(ring.take()["time"])
    for turn in range(5):  # around the ring
        for k in range(5):
            ring.put(10 * turn + k, 0.0, 1.0, 0, *np.full((4, 2), k))
        found = ring.take()
        assert found["time"].tolist() == [10 * turn + k for k in range(5)]
        assert found["tau"].tolist() == [[k, k] for k in range(5)]
    assert ring.lost == 12


def test_a_clock_that_is_set_back_ends_in_no_sample_twice():
    loop = loop_of()
    q = np.asarray(EIGHT.q_d(np.array(0.0)))
    with loop.record() as log:
        loop.start(q)
        for t in (0.0, H, 2 * H, H, 2 * H, 3 * H):
            loop.step(q, np.zeros(2), t)
    assert (np.diff(log.run().time) > 0).all()


def test_a_loop_that_starts_again_goes_on_in_its_log():
    loop, q = loop_of(), np.asarray(EIGHT.q_d(np.array(0.0)))
    with loop.record() as log:
        for _ in range(3):
            loop.start(q)
            for k in range(10):
                loop.step(q, np.zeros(2), k * H)
    np.testing.assert_allclose(log.run().time, np.arange(30) * H, atol=1e-12)


def test_the_log_of_a_drive_has_its_ticks_and_not_those_before():
    law = pc.ExtendedMotionPlan(ROBOT, EIGHT, 400.0, 40.0, k=20.0)
    plant, loop = pc.Plant(ROBOT, H), loop_of(law)

    class Simulated:
        carries_weight = False
        q, qd, reads = np.asarray(EIGHT.q_d(np.array(0.0)))[None], np.zeros((1, 2)), 0

        def locate(self):
            return pc.Measurement(self.q[0], self.qd[0], 0.0)

        def read(self):
            self.reads += 1
            return pc.Measurement(self.q[0], self.qd[0], 3.0 + H * self.reads)

        def write(self, tau):
            self.q, self.qd = plant.advance(self.q, self.qd, tau[None])

        def finish(self):
            pass

    with loop.record() as log:
        record = pc.drive(loop, Simulated(), 0.5, settle=0.2)
    run = log.run()
    assert (run.array("q")[0] == record.q).all()
    assert (run.array("tau")[0] == record.tau).all()
    assert (run.array("mode")[0] == record.mode).all()
    np.testing.assert_allclose(run.time, record.t, atol=1e-9)


_WRITES = """
import sys, time
import numpy as np
import pathcontrol as pc

robot = pc.load_robot("cicese_2dof").with_friction(pc.no_friction(2))
task = pc.Lissajous([0.3, 0.3], [1, 2], speed=0.8, center=[0.2, 0.4])
loop = pc.ControlLoop(pc.ExtendedMotionPlan(robot, task, 400.0, 40.0, k=20.0), 1e-3)
q = np.asarray(task.q_d(np.array(0.0)))
loop.start(q)
log = loop.record(sys.argv[1])
begin = time.monotonic()
for k in range(100_000):
    loop.step(q + 1e-6 * np.sin(k), np.zeros(2), 1e-3 * k)
    if k % 50 == 0:
        print(1e-3 * k, flush=True)
    time.sleep(max(0.0, begin + 1e-3 * k - time.monotonic()))
"""


def test_a_killed_process_loses_the_last_second_at_most(tmp_path):
    """The clock of the loop is that of the wall, or behind it: a busy machine only makes fewer samples."""
    pytest.importorskip("mcap")
    file = tmp_path / "log.mcap"
    process = subprocess.Popen([sys.executable, "-c", _WRITES, str(file)], stdout=subprocess.PIPE, text=True)
    for line in process.stdout:
        if float(line) > 1.5:
            process.kill()
            break
    said = [float(line), *map(float, process.stdout)][-1]
    assert process.wait() == -signal.SIGKILL
    with pytest.warns(PathControlWarning, match="has no end"):
        run = pc.Run.load(file)
    assert run.time[-1] > said - 1.0
    assert np.allclose(np.diff(run.time), 1e-3)
    assert repr(run.task) == repr(EIGHT)
    assert pc.metrics(run)["tau_peak"][0] > 0


def test_a_full_disk_ends_no_loop_and_is_told_at_the_end(tmp_path):
    pytest.importorskip("mcap")
    if not os.path.exists("/dev/full"):
        pytest.skip("this system has no /dev/full")
    link = tmp_path / "log.mcap"
    link.symlink_to("/dev/full")
    loop, q = loop_of(), np.asarray(EIGHT.q_d(np.array(0.0)))
    log = loop.record(link)
    loop.start(q)
    for k in range(400):
        loop.step(q, np.zeros(2), k * H)
        if k == 200:
            time.sleep(0.4)
    with pytest.raises(StorageError, match="not whole"):
        log.close()


def test_logs_have_a_name_that_says_what_they_are():
    loop = loop_of()
    with pytest.raises(InputError, match="mcap"):
        loop.record("log.csv")
    with pytest.raises(InputError, match="no step"):
        loop.record().run()


def test_an_endless_path_of_ones_own_is_kept_as_far_as_it_was_used(tmp_path):
    pytest.importorskip("mcap")

    class Spiral(pc.PathTask):
        n = 2

        def q_d(self, s):
            return np.stack([0.1 * np.cos(s), 0.1 * np.sin(s) + 0.01 * s], axis=-1)

        def theta(self, s):
            return 8.0 + 0.0 * s

    law = pc.ComputedTorque(ROBOT, Spiral(), 400.0, 40.0)
    loop = loop_of(law)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with loop.record(tmp_path / "log.mcap") as log:
            loop.start([0.1, 0.0])
            for k in range(250):
                loop.step([0.1, 0.0], [0.0, 0.0], k * H)
        run = log.run()
    s = run.array("s")[0]
    assert s[-1] > 4.0
    np.testing.assert_allclose(run.task.q_d(s), law.task.q_d(s), atol=1e-7)
