"""Driving an arm by a control loop, from the first measurement to the end of the torque control."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._expect import expect
from pathcontrol.errors import ArmError, InputError
from pathcontrol.hardware.arm import Arm, Measurement
from pathcontrol.hardware.control_loop import ControlLoop, Status
from pathcontrol.hardware.loop_context import LoopContext
from pathcontrol.hardware.real_time import real_time
from pathcontrol.hardware.sample_ring import Moments, SampleRing
from pathcontrol.simulation.run import Run

_OF_AN_ARM = ("carries_weight", "locate", "read", "write", "finish")
ENDED = "the drive ended"  #: the begin of the reason for which a loop rests at the end of a drive
_WARM = 10
_FIRST = 100  # periods in which the first measurement must come


@dataclass(frozen=True, eq=False)
class DriveRecord:
    """The ticks of a drive, K of them, an array each.

    Attributes:
        t: time of the measurement [s], from 0, (K,); NaN where none came.
        q: measured joint positions [rad], (K, n).
        qd: measured joint velocities [rad/s], (K, n).
        tau: torques of the loop [N m], with those that carry the weight of the arm, (K, n).
        s: path parameter of the plan after the tick, (K,).
        mode: the :class:`Mode` of the loop, (K,).
        status: that of the loop at the end.
        stopped: why the arm stopped by itself, a sentence; empty where it did not.
        real_time: whether the loop had real-time priority.
        samples: what a log of the loop has, of which :meth:`run` is made.
        context: the law of the loop and its period.
    """

    t: Array
    q: Array
    qd: Array
    tau: Array
    s: Array
    mode: Array
    status: Status
    stopped: str
    real_time: bool
    samples: Moments
    context: LoopContext

    def run(self) -> Run:
        """Return the drive as a run, for metrics, figures and reports, as :meth:`LoopLog.run` does.

        Of a tick without a good measurement it has the last good one.
        """
        return self.context.make_run_of_moments(self.samples)


def drive(loop: ControlLoop, arm: Arm, duration: float, settle: float = 0.7) -> DriveRecord:
    """Drive an arm along the path of a loop's law, let the plan come to rest, and return what was measured.

    The loop starts where the arm is, before it is driven. A measurement that does not come in time is no number to the
    loop, which bridges it. The torques are those of the loop, without g(q) where the arm carries its own weight. Ctrl-C
    ends the drive early, in the same way: the plan comes to rest on its path before the torque control ends. Where the
    arm stops by itself the loop is stopped (:meth:`ControlLoop.stop`), and the record says why.

    Args:
        loop: the law behind its envelope.
        arm: a :class:`Franka`, a :class:`UR`, or whatever has the four methods of :class:`Arm`.
        duration: time along the path [s].
        settle: time for coming to rest at the end [s].

    Raises:
        ArmError: the arm gives no measurement to start with, or is out of the tube around the path or beyond a position
            limit; nothing is driven then.
        InputError: a time is not positive, or ``arm`` lacks a method of :class:`Arm`.
    """
    expect("loop", loop, ControlLoop)
    _expect_arm(arm)
    span = as_scalar("duration", duration, positive=True)
    rest = as_scalar("settle", settle, least=0.0)
    _warm_up(loop)
    driver = _Driver(loop, arm, span + rest)
    try:
        with real_time() as allowed:
            stopped = driver.drive(span, rest)
    finally:
        arm.finish()
        driver.close()
    return driver.record(stopped, allowed)


def _expect_arm(arm: Arm) -> None:
    """Check that an arm has all that a drive asks of it, before anything moves."""
    missing = [name for name in _OF_AN_ARM if not hasattr(arm, name)]
    if missing:
        raise InputError(
            f"arm is a {type(arm).__name__} without {', '.join(missing)}; expected a Franka, a UR, a MachineArm, or an "
            f"object of your own with {', '.join(_OF_AN_ARM)}: see Arm",
            argument="arm",
        )


def _warm_up(loop: ControlLoop) -> None:
    """Take steps that no arm sees: the first ones of a process last several periods, also those of a held plan."""
    task = loop.law.task
    q = np.asarray(task.q_d(np.array(task.s0)), dtype=np.float64).reshape(-1)
    loop.start(q)
    recording, loop.recording = loop.recording, False
    for k in range(2 * _WARM):
        if k == _WARM:
            loop.hold()
        loop.step(q, np.zeros_like(q), k * loop.period)
    loop.recording = recording


class _Driver:
    """A loop and an arm at work, and the rows of their record, made before the first tick."""

    def __init__(self, loop: ControlLoop, arm: Arm, longest: float) -> None:
        self._loop, self._arm = loop, arm
        self._k, self._start, self._elapsed = 0, 0.0, 0.0
        n = loop.law.robot.n
        self._none = Measurement(np.full(n, np.nan), np.full(n, np.nan), np.nan)
        joints = [(name, np.float64, (n,)) for name in ("q", "qd", "tau")]
        self._ring = SampleRing(n, self._ticks(longest))
        self._rows = np.zeros(self._ticks(longest), [("t", np.float64), *joints, ("s", np.float64), ("mode", np.int8)])
        self._rows.view(np.uint8).fill(0)  # or the system would give memory tick by tick, and make some late

    def drive(self, span: float, rest: float) -> str:
        """Drive for both times [s], and return why the arm stopped, or ""."""
        here = self._arm.locate()
        self._loop.start(here.q, here.qd)
        if self._loop.status.faults:
            raise ArmError(f"{self._loop.status.reason} (nothing was driven)")
        self._loop.fill(self._ring)
        first = self._read_first()
        self._start = first.t
        try:
            ended = f"{ENDED} after {span:g} s"
            try:
                self._tick(first)
                self._follow(span)
            except KeyboardInterrupt:  # the operator ends the drive, and the arm comes to rest
                ended = f"{ENDED} by Ctrl-C"
            self._loop.finish(ended)
            self._follow(self._elapsed + rest)
        except ArmError as error:
            self._loop.stop(str(error))
            return str(error)
        return ""

    def record(self, stopped: str, allowed: bool) -> DriveRecord:
        """Return what was driven."""
        rows = self._rows[: self._k]
        arrays = {name: rows[name].copy() for name in ("t", "q", "qd", "tau", "s", "mode")}
        context = LoopContext(self._loop.law, self._loop.period, self._loop.outcome)
        return DriveRecord(
            **arrays,
            status=self._loop.status,
            stopped=stopped,
            real_time=allowed,
            samples=self._ring.take(),
            context=context,
        )

    def close(self) -> None:
        """Let the loop keep no more samples."""
        self._ring.closed = True

    def _read_first(self) -> Measurement:
        """Return the first measurement."""
        for _ in range(_FIRST):
            if (measured := self._arm.read()) is not None:
                return measured
        raise ArmError(
            f"no measurement in {_FIRST} reads of the arm; is it connected, switched on and not stopped?", limit=_FIRST
        )

    def _follow(self, until: float) -> None:
        """Take ticks up to a time on the clock of the arm [s], or to as many as fill it where that clock stands."""
        most = min(self._ticks(until), len(self._rows))
        while self._elapsed < until and self._k < most:
            self._tick(self._arm.read() or self._none)

    def _tick(self, measured: Measurement) -> None:
        """Take a tick: step the loop, send its torques, and write the row."""
        q, qd, t = measured.q, measured.qd, measured.t - self._start
        tau = self._loop.step(q, qd, t)
        self._arm.write(tau - self._loop.gravity if self._arm.carries_weight else tau)
        status = self._loop.status
        self._rows[self._k] = t, q, qd, tau, status.s, status.mode
        self._k, self._elapsed = self._k + 1, max(self._elapsed, t)  # a time that is no number changes nothing

    def _ticks(self, time: float) -> int:
        """Return the number of ticks in a time [s]."""
        return int(np.ceil(time / self._loop.period - 1e-6)) + 1
