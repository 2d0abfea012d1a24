"""The control loop of a real arm: a law behind a safety envelope, which never raises and never jumps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_vector, as_scalar
from pathcontrol._expect import expect
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.pace_rule import PaceRule
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.errors import warn
from pathcontrol.hardware.envelope import Envelope
from pathcontrol.hardware.held_plan import HeldPlan
from pathcontrol.hardware.loop_log import LoopLog
from pathcontrol.hardware.measurements import Screen
from pathcontrol.hardware.sample_ring import SampleRing
from pathcontrol.hardware.start_check import find_start_fault, name_units

_CLOCK = 1e-3  # share of a period up to which a step is in time: clocks are rounded
_FAR = 2.0  # tubes from the path, from which holding on it is no help


class Mode(IntEnum):
    """The modes of a control loop, the gravest last."""

    RUN = 0
    HOLD = 1
    DAMP = 2
    GRAVITY = 3


class Status(NamedTuple):
    """The state of a control loop.

    Attributes:
        mode: ``RUN`` follows the path; ``HOLD`` stays on it; ``DAMP`` brakes all joints, τ = g(q) − Dq̇; ``GRAVITY``
            carries the weight of the arm at its last known posture, τ = g(q).
        reason: why, in a sentence; empty while it runs.
        faults: how often each kind of fault occurred: ``measurement``, ``deadline``, ``motion``, ``tube``, ``law``,
            ``start``; ``operator`` and ``arm`` where it was held, or stopped by the arm.
        saturated: whether the last torque was limited, by itself or by its rate.
        ticks: number of steps.
        s: path parameter of the plan.
    """

    mode: Mode
    reason: str
    faults: Mapping[str, int]
    saturated: bool
    ticks: int
    s: float


class ControlLoop:
    """A control law for one arm as one call per period, with a safety envelope around it.

    >>> loop = ControlLoop(law, period=1e-3)
    >>> loop.start(q, qd, t)
    >>> tau = loop.step(q, qd, t)  # every period

    Within the envelope the torques are those of :class:`ControlTick`, to the last bit. Beyond it the loop reacts and
    says why in :attr:`status`; each reaction lasts until :meth:`resume`, and a worse one takes over:

    - Torques are limited, and their rate, always. Nothing else follows from that.
    - A bad measurement (no number, out of order, repeated, frozen, a jump) is bridged by the last torque; after
      ``patience`` of them in a row only gravity is compensated, and when they are good again the arm is damped.
    - A late step is counted; after a gap of ``lost`` periods the plan is held on the path.
    - Out of the tube around the path the plan is held; at twice the distance the arm is damped.
    - A joint beyond its velocity limit, or too near to a position limit to be braked before it, is damped.
    - A law that raises, or returns no numbers, is damped.
    - An arm that starts, or goes on, out of the tube or beyond a position limit is damped: no law draws it from afar.

    Args:
        law: the law, with one task and one set of gains.
        period: control period [s].
        envelope: the limits; what it does not say is taken from the law's robot.

    Raises:
        InputError: a limit is missing, or the law is for several rollouts.
    """

    def __init__(self, law: Controller, period: float, envelope: Envelope | None = None) -> None:
        expect("law", law, Controller)
        self.law, self.period = law, as_scalar("period", period, positive=True)
        limits = Envelope() if envelope is None else envelope
        expect("envelope", limits, Envelope)
        self.envelope = limits.complete(law.robot)
        _question_pace(law, self.envelope.torque)
        self._plan = HeldPlan(law, self.period)
        self._damping = self._find_damping()
        self._rings: tuple[SampleRing, ...] = ()
        self.recording = True  # False for steps that are not to be in the log
        n = law.robot.n
        posture = law.task.q_d(np.array(law.task.s0, dtype=np.float64))
        self.start(np.asarray(posture, dtype=np.float64).reshape(n))
        self._started, self._mode, self._reason = False, Mode.DAMP, "it has not been started"
        self._faults.clear()

    def start(self, q: ArrayLike, qd: ArrayLike | None = None, t: float = 0.0, tau: ArrayLike | None = None) -> None:
        """Start again with an arm at q [rad] and q̇ [rad/s], each (n,), at time t [s].

        Out of the tube around the path, or beyond a position limit, the arm is damped, and :attr:`status` says why.
        Without a start, the first good measurement is one.

        Args:
            q: joint positions.
            qd: joint velocities; at rest by default.
            t: time on the clock that :meth:`step` is given.
            tau: the torques that act already [N m], (n,), which the first follow by their rate; by default those that
                carry the weight of the arm.
        """
        n = self.law.robot.n
        position = as_joint_vector("q", q, n)
        velocity = np.zeros(n) if qd is None else as_joint_vector("qd", qd, n)
        acting = self.law.robot.gravity(position) if tau is None else as_joint_vector("tau", tau, n)
        begin = as_scalar("t", t)
        self._plan.start(position, velocity)
        for ring in self._rings:
            ring.restart(begin, self.period)
        self._screen = Screen(self.envelope, position, velocity, begin - self.period)
        self._tau = np.minimum(np.maximum(acting, -self.envelope.torque), self.envelope.torque)
        self._mode, self._reason, self._faults = Mode.RUN, "", Counter[str]()
        self._bad, self._ticks, self._saturated, self._started = 0, 0, False, True
        if fault := self._find_start_fault():
            self._react(Mode.DAMP, "start", fault)

    @property
    def status(self) -> Status:
        """The state of the loop: its mode, and the reason for it."""
        return Status(self._mode, self._reason, dict(self._faults), self._saturated, self._ticks, self._plan.s)

    @property
    def state(self) -> Array:
        """The state z of the law at the next step, (m,); ``law.observed_torque(loop.state)`` is what pushes the arm."""
        return self._plan.state

    @property
    def outcome(self) -> dict[str, Array]:
        """The outcome of the law up to now, (1,) each, see :meth:`Controller.outcome`."""
        return self._plan.outcome

    @property
    def gravity(self) -> Array:
        """The torques that carry the arm at its last good measurement, g(q) [N m], (n,)."""
        return self.law.robot.gravity(self._screen.q)

    def step(self, q: Any, qd: Any, t: Any) -> Array:
        """Return the torques [N m], (n,), for measured q [rad] and q̇ [rad/s] at time t [s]; it never raises.

        The array is a new one each time.
        """
        if not self._started:
            self._start_unasked(q, qd, t)
        self._ticks += 1
        plan = (self._plan.s, self._plan.factor) if self._rings else (0.0, 1.0)
        try:
            wanted = self._decide(q, qd, t)
        except Exception as error:  # whatever a law of one's own raises, the arm must not fall
            self._react(Mode.DAMP, "law", f"the law raised {type(error).__name__}: {error}")
            wanted = self._brake()
        self._tau = limited = self.envelope.clip(wanted, self._tau, self.period)
        self._saturated = bool((limited != wanted).any())
        if self._mode < Mode.DAMP and not self._bad:
            self._tell(limited)
        if self._rings and self.recording:
            t = self._screen.t + self._bad * self.period
            for ring in self._rings:
                ring.put(t, *plan, self._mode, self._screen.q, self._screen.qd, wanted, limited)
        return limited.copy()

    def record(self, path: str | Path | None = None) -> LoopLog:
        """Return a log of all steps from now on, as an MCAP file ``NAME.mcap`` or in memory.

        >>> with loop.record("arm.mcap") as log:
        ...     drive(loop, arm, duration=10.0)
        >>> run = log.run()

        Raises:
            InputError: the name does not end with ``.mcap``.
            MissingExtraError: a file is to be written, and the extra ``mcap`` is not installed.
            StorageError: the file cannot be written.
        """
        log = LoopLog(self.law, self.period, path, lambda: self.outcome)
        self.fill(log.ring)
        return log

    def fill(self, ring: SampleRing) -> None:
        """Put a sample of all steps from now on into a ``ring``, until it is closed."""
        self._rings = (*(one for one in self._rings if not one.closed), ring)

    # --- the operator ---------------------------------------------------------------------------------------

    def hold(self) -> None:
        """Let the plan come to rest on the path and stay there."""
        self._react(Mode.HOLD, "operator", "held by the operator")

    def finish(self, reason: str) -> None:
        """Let the plan come to rest on the path and stay there, at the end of a drive, which is no fault."""
        if self._mode < Mode.HOLD:
            self._mode, self._reason = Mode.HOLD, reason
            self._plan.hold()

    def stop(self, reason: str) -> None:
        """Carry only the weight of the arm, because it has stopped by itself or cannot be reached, for a ``reason``."""
        self._react(Mode.GRAVITY, "arm", reason)

    def resume(self) -> None:
        """Go on along the path from where the arm is, from rest, after any reaction; it never raises.

        Where the law cannot start there the arm is damped, or stays so, and :attr:`status` says why. Out of the tube
        around the path, or beyond a position limit, it stays as it is.
        """
        if not self._started:
            return
        try:
            if self._mode >= Mode.DAMP:
                self._plan.restart(self._screen.q, self._screen.qd)
            if fault := self._find_start_fault():
                self._faults["start"] += 1
                self._reason = fault if self._mode > Mode.RUN else ""
                return
            self._plan.resume()
        except Exception as error:  # a loop that resumes on its own must not end, and the arm must not fall
            self._faults["law"] += 1
            self._mode = max(self._mode, Mode.DAMP)
            self._reason = f"the law cannot go on: {type(error).__name__}: {error}"
            return
        self._mode, self._reason, self._bad = Mode.RUN, "", 0

    # --- decisions ------------------------------------------------------------------------------------------

    def _start_unasked(self, q: Any, qd: Any, t: Any) -> None:
        """Start where a good measurement is, of an arm that nobody started; a hold or a stop from before lasts."""
        if (measured := self._screen.read(q, qd, t)) is None:
            return
        before, reason = self._faults, self._reason
        try:
            self.start(*measured)
        except Exception as error:  # step never raises
            self._started, self._screen = True, Screen(self.envelope, *measured[:2], measured[2] - self.period)
            self._react(Mode.DAMP, "law", "")
            self._reason = f"the law cannot start: {type(error).__name__}: {error}"
        if before["operator"]:
            self.hold()
        if before["arm"]:
            self.stop(reason)

    def _find_start_fault(self) -> str:
        """Return the sentence on an arm that is where no law is to start, or ""."""
        q, limits = self._screen.q, self.envelope
        away = 0.0 if limits.tube == np.inf else self._plan.distance(q)
        return find_start_fault(self.law.robot, q, limits.lower, limits.upper, away, limits.tube)

    def _decide(self, q: Any, qd: Any, t: Any) -> Array:
        """Return the torques that are wanted."""
        before = self._screen.t
        if fault := self._screen.take(q, qd, t):
            return self._bridge(fault)
        self._bad = 0
        self._check_time(self._screen.t - before)
        if fault := self.envelope.find_motion_fault(self._screen.q, self._screen.qd):
            self._react(Mode.DAMP, "motion", fault)
        if self._mode >= Mode.DAMP:
            self._mode = Mode.DAMP  # measurements are good again
            return self._brake()
        return self._follow()

    def _bridge(self, fault: str) -> Array:
        """Return the torques without a measurement: the last ones, or after a while those that carry the weight."""
        self._bad += 1
        self._faults["measurement"] += 1
        if self._bad > self.envelope.patience:
            self._mode, self._reason = Mode.GRAVITY, fault
        return self.gravity if self._mode >= Mode.DAMP else self._tau

    def _check_time(self, gap: float) -> None:
        """Tell observers how long the last torque acted, count a late step, and hold the plan after a long gap [s]."""
        if abs(gap - self.period) > _CLOCK * self.period:
            self._plan.wait(gap - self.period)
        if gap > self.envelope.late * self.period:
            self._faults["deadline"] += 1
        if gap > self.envelope.lost * self.period:
            self._react(Mode.HOLD, "deadline", f"no step for {gap:.3g} s")

    def _follow(self) -> Array:
        """Return the torques of the law, or of braking where these are no numbers or the arm is far from its path."""
        tau = self._plan.tick(self._screen.q, self._screen.qd)
        self._check_tube()
        if not np.isfinite(tau).all():
            self._react(Mode.DAMP, "law", "the law gave torques that are no numbers")
        return self._brake() if self._mode >= Mode.DAMP else tau

    def _tell(self, tau: Array) -> None:
        """Tell the law which torques act up to the next step [N m], (n,)."""
        try:
            self._plan.act(tau)
        except Exception as error:  # a law of one's own advances with them
            self._react(Mode.DAMP, "law", f"the law raised {type(error).__name__}: {error}")

    def _check_tube(self) -> None:
        """React to an arm that leaves the tube around its path."""
        if self.envelope.tube == np.inf:
            return
        away, tube = self._plan.distance(self._screen.q), self.envelope.tube
        if away > tube:
            mode, unit = Mode.DAMP if away > _FAR * tube else Mode.HOLD, name_units(self.envelope.units)
            self._react(mode, "tube", f"the arm is {away:.3g} {unit} from its path, its tube is {tube:g}")

    def _react(self, mode: Mode, kind: str, reason: str) -> None:
        """Take a reaction, unless a worse one is taken already."""
        self._faults[kind] += 1
        if mode <= self._mode:
            return
        self._mode, self._reason = mode, reason
        if mode == Mode.HOLD:
            self._plan.hold()

    def _brake(self) -> Array:
        """Return g(q) − Dq̇ at the last good measurement, (n,)."""
        return self.gravity - self._damping * self._screen.qd

    def _find_damping(self) -> Array:
        """Return D [N m s/rad], (n,): the torque limit at the velocity limit, or less where that would ring."""
        robot = self.law.robot
        M = robot.mass_matrix(np.asarray(self.law.task.q_d(np.array(self.law.task.s0))).reshape(robot.n))
        lightest = 1.0 / np.linalg.inv(M).diagonal()
        return np.minimum(self.envelope.torque / self.envelope.velocity, 0.3 * lightest / self.period)


def _question_pace(law: Controller, torque: Array) -> None:
    """Warn of a pace that counts on more than the ``torque`` that an envelope lets through [N m], (n,)."""
    for rule in law.rules if isinstance(law, LawWrapper) else ():
        if isinstance(rule, PaceRule) and (beyond := rule.torque > torque).any():
            i = int(beyond.argmax())
            unit = "N m" if law.robot.position_units[i] == "rad" else "N"
            warn(
                f"the pace counts on {rule.torque[i]:g} {unit} at {law.robot.joint_names[i]}, the envelope lets "
                f"{torque[i]:g} through, and the arm may leave its path; give Paced(law, "
                f"torque_limits={torque.tolist()})"
            )
