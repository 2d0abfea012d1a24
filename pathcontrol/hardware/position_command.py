"""Joint positions in place of torques: a path law for arms that take positions or velocities."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_joint_vector, as_scalar, freeze
from pathcontrol._milliseconds import LONGEST_LAG, as_period, question_time
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.law_gains import refuse_several_gains
from pathcontrol.control.wrappers.override_rule import Override, check_one_speed
from pathcontrol.control.wrappers.pace_rule import rate_bounds
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.errors import InputError
from pathcontrol.hardware.servo_model import ServoModel
from pathcontrol.hardware.start_check import find_start_fault, read_tube
from pathcontrol.hardware.wait_rule import WaitRule
from pathcontrol.robot.friction import FrictionLaw, Viscous, no_friction
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.plant import Plant
from pathcontrol.tasks.batch.task_batch import TaskBatch

_NO_LIMIT = 1e6  # rad/s: files without a limit give 0 or some huge number
_JUMP = 0.05  # rad, what a measurement may change beyond the velocity limits, as in an envelope
_PATIENCE = 5  # bad measurements in a row after which the plan is held
_SLOWEST = 1e-12  # rad/s, no division by 0
_WHOLE = 1e-9  # of a period, as which a rest counts as none


class PositionCommand:
    """A law for one arm as one call per period, from measured to commanded joint positions.

    For arms whose own controller tracks positions (``servoJ``, RSI, EGM, hobby servos) or velocities. A virtual arm
    does what the law asks of it, without the friction that the law does not compensate, and its position is the
    command. What the real arm does beside that, because a joint jams, or somebody holds it, is the deviation

        d = q − q̂,   q̂ the command behind the lag T of the servo, Tdq̂/dt = q_c − q̂,

    which is 0 in free motion whatever the lag. The law is asked at the arm that deviates, (q_m, q̇_m) = (q_c + d,
    q̇_c + ḋ), where it gives σ̇ and the acceleration a(q_m, q̇_m, σ), and the command follows

        q̈_c = a(q_m, q̇_m, σ) + ω²d + 2ωḋ.

    With d = 0 that is the law itself: the commands are the positions of :func:`simulate`, of an arm with the friction
    that the law compensates. As ‖d‖ grows to the ``tolerance`` the plan slows down and rests (:class:`WaitRule`), while
    a path law still moves σ to where the arm is: the arm waits on the path, at the place where it is held. When it is
    free the plan goes on from there, within its limits and without a jump.

    >>> command = PositionCommand(law, period=2e-3, lag=0.1)
    >>> command.start(q)
    >>> q_next = command.step(q)  # every period; to be reached at the next one

    Commands keep to the path and to the velocity limits by pacing: the virtual arm goes along its motion at a factor
    λ ≤ 1 of its time, the largest with |λq̇_c| ≤ v and, as far as λ̇ can, |λ²q̈_c + λ̇q̇_c| ≤ a. No step is larger than a
    velocity limit allows, in any case; none leaves the position limits of the arm.

    A measurement that is no number, or that jumps by more than 0.05 rad beyond a velocity limit, is bridged by the last
    deviation; after 5 of them in a row the plan is held, and what is farther than an arm comes in that time is bridged
    until :meth:`resume` or :meth:`start`.

    Args:
        law: a law of the library or of one's own, best a path law, with one task and one set of gains. One without a
            speed input gets one.
        period: time between two commands [s].
        lag: time constant T of the servo [s], a number or (n,); 0 for one that is where it was told to be.
        velocity: largest |q̇| of commands [rad/s], a number or (n,); of the URDF by default, where it has one.
        acceleration: largest |q̈| for pacing [rad/s²], a number or (n,); by default none.
        tolerance: ‖d‖ [rad] at which the plan rests; from half of it on it slows down. Choose it above what the arm
            deviates in free motion, because of noise or a lag that is not quite T.
        bandwidth: ω [rad/s], how stiffly the command stays by an arm that deviates.
        tube: distance from the path [rad] beyond which no arm starts, as commands would bring it there; inf for any.

    Attributes:
        law: the law with its speed input.
        q: the last command [rad], (n,).
        qd: its velocity [rad/s], (n,), for arms that take velocities.
        faults: number of measurements that were no numbers, or jumped.

    Raises:
        InputError: the law is for several rollouts, or an argument has another shape or sign.
    """

    def __init__(
        self,
        law: Controller,
        period: float = 2e-3,
        *,
        lag: ArrayLike = 0.0,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        tolerance: float = 0.01,
        bandwidth: float = 20.0,
        tube: float = 0.5,
    ) -> None:
        check_controller("law", law)
        if isinstance(law.task, TaskBatch) or any(np.ndim(getattr(law, name)) > 1 for name in law.gains):
            raise InputError(
                "the law is for several rollouts, expected one task and one set of gains", argument="law", value=law
            )
        refuse_several_gains(law)
        self._wait = WaitRule(as_scalar("tolerance", tolerance, positive=True))
        self.law = LawWrapper(law, self._wait).apart()  # bad measurements stop it beside its buttons
        self.period, robot = as_period("period", period), law.robot
        self._omega = as_scalar("bandwidth", bandwidth, positive=True)
        self._tube = read_tube(tube)
        lags = _spread("lag", lag, robot.n, least=0.0)
        question_time("lag", float(lags.max()), LONGEST_LAG)
        self._servo = ServoModel(lags, self.period)
        limit = np.where(
            (robot.limits.velocity > 0) & (robot.limits.velocity < _NO_LIMIT), robot.limits.velocity, np.inf
        )
        self._velocity = limit if velocity is None else _spread("velocity", velocity, robot.n)
        self._acceleration = None if acceleration is None else _spread("acceleration", acceleration, robot.n)
        limited = robot.limits.lower < robot.limits.upper
        self._lower = np.where(limited, robot.limits.lower, -np.inf)
        self._upper = np.where(limited, robot.limits.upper, np.inf)
        self._plant = Plant(robot.with_friction(_compensated_friction(law)), self.period)
        begin = np.asarray(law.task.q_d(np.array(law.task.s0)), dtype=np.float64).reshape(robot.n)
        rest = np.zeros(robot.n)
        self._start(begin, rest, np.atleast_2d(self.law.start(begin, rest)))
        self._started = False

    @property
    def s(self) -> float:
        """The path parameter of the plan."""
        return float(self._z[0, 0])

    @property
    def robot(self) -> RobotModel:
        """The arm."""
        return self.law.robot

    def start(self, q: ArrayLike, qd: ArrayLike | None = None) -> None:
        """Start with an arm at q [rad] and q̇ [rad/s], each (n,); at rest by default.

        Without a start, the first measurement is one.

        Raises:
            InputError: the arm is out of the ``tube`` around the path, or beyond a position limit.
        """
        position = as_joint_vector("q", q, self.robot.n)
        velocity = np.zeros(self.robot.n) if qd is None else as_joint_vector("qd", qd, self.robot.n)
        self.law.go()
        z = np.atleast_2d(self.law.start(position, velocity))
        away = float(np.linalg.norm(np.asarray(self.law.task.q_d(z[0, :1])).reshape(-1) - position))
        if fault := find_start_fault(self.robot, position, self._lower, self._upper, away, self._tube):
            raise InputError(fault, argument="q", value=position.tolist())
        self._start(position, velocity, z)

    def _start(self, q: Array, qd: Array, z: Array) -> None:
        """Start at (q, q̇), (n,) each, with the state z (1, m) of the law."""
        self.q, self.qd, self._z = q.copy(), qd.copy(), z
        self._before = self._now = self.q.copy(), self.qd.copy()  # of the virtual arm, a period apart
        self._passed, self._pace, self._ticks = 1.0, 1.0, 0  # share of that period, λ, periods of the virtual arm
        self._servo.start(self.q)
        self.faults, self._bad, self._started = 0, 0, True

    def step(self, q: Any) -> Array:
        """Return the position to be reached at the next period [rad], (n,), for the measured q [rad], (n,).

        The array is a new one each time. The first step is a start where :meth:`start` was not called, and raises as
        that does.
        """
        if not self._started:
            self.start(q)
        missed = min(self._bad, _PATIENCE)  # where the plan is held, no time brings a jump within reach
        reach = _JUMP + self._velocity * self.period * (missed + 1)
        self._watch(self._servo.expect(self.q).update(q, reach))
        self._pace = self._choose_pace()
        self._passed += self._pace
        if self._passed > 1.0 + _WHOLE:
            self._passed -= 1.0
            self._before, self._now = self._now, self._advance(*self._now)
        position, velocity = self._interpolate()
        most = self._velocity * self.period
        moved = self.q + np.minimum(np.maximum(position - self.q, -most), most)
        self.q = np.minimum(np.maximum(moved, self._lower), self._upper)
        self.qd = np.minimum(np.maximum(self._pace * velocity, -self._velocity), self._velocity)
        return self.q.copy()

    # --- the operator ---------------------------------------------------------------------------------------

    def hold(self) -> None:
        """Let the plan come to rest on its path and stay there; see :meth:`LawWrapper.hold`."""
        self.law.hold()

    def resume(self) -> None:
        """Let the plan go forward again; see :meth:`LawWrapper.resume`."""
        self._bad = 0
        self._servo.forget()
        self.law.go()
        self.law.resume()

    def override(self, value: Override) -> None:
        """Set how fast the plan goes when it is not held, as a factor from 0 to 2; see :meth:`LawWrapper.override`."""
        check_one_speed(value, self._ticks * self.period)
        self.law.override(value)

    def reverse(self) -> None:
        """Let the plan go back along its path; see :meth:`LawWrapper.reverse`."""
        self.law.reverse()

    # --- the virtual arm ------------------------------------------------------------------------------------

    def _watch(self, good: bool) -> None:
        """Count bad measurements, and hold the plan after several of them."""
        self._bad = 0 if good else self._bad + 1
        self.faults += not good
        if self._bad > _PATIENCE:
            self.law.stop()

    def _advance(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return position and velocity of the virtual arm a period later, (n,) each, and advance the plan."""
        h, (d, rate) = self.period, self._servo.deviation
        self._wait.deviation = float(np.sqrt(d @ d))
        there, speed = (q + d)[None], (qd + rate)[None]
        out = self.law.law(self._ticks * h, there, speed, self._z)
        later, faster = self._plant.advance(there, speed, out.tau)
        self._z, self._ticks = self.law.advance(self._z, out, h), self._ticks + 1
        pull = self._omega * (self._omega * d + 2 * rate)
        own = (later - there - h * speed)[0]  # what the acceleration of the law adds
        return q + h * qd + own + 0.5 * h**2 * pull, qd + (faster - speed)[0] + h * pull

    def _choose_pace(self) -> float:
        """Return λ of the next period."""
        change = self._now[1] - self._before[1]
        now = self._interpolate()[1]
        peak = np.maximum(np.abs(now), np.abs(now + self._pace * change))  # the second is the velocity that is next
        fastest = min(1.0, float((self._velocity / np.maximum(peak, _SLOWEST)).min()))
        rate = (fastest - self._pace) / self.period
        if self._acceleration is not None:
            own = self._pace**2 * change / self.period
            if now.any():
                least, most = rate_bounds(own, now, self._acceleration)
                rate = min(max(rate, float(least)), float(most)) if least <= most else min(float(most), 0.0)
        return min(max(self._pace + self.period * rate, 0.0), fastest)

    def _interpolate(self) -> tuple[Array, Array]:
        """Return position and velocity of the virtual arm at its present time, (n,) each: a cubic between states."""
        if abs(self._passed - 1.0) <= _WHOLE:
            return self._now
        (q, qd), (later, faster), x, h = self._before, self._now, self._passed, self.period
        chord = (later - q) / h
        curve = qd + faster - 2 * chord
        slope = 3 * chord - 2 * qd - faster
        return q + h * x * (qd + x * (slope + x * curve)), qd + x * (2 * slope + 3 * x * curve)


def _compensated_friction(law: Controller) -> FrictionLaw:
    """Return the friction that a law compensates."""
    if law.friction == "full":
        return law.robot.friction
    return Viscous(law.compensated) if law.friction == "viscous" else no_friction(law.robot.n)


def _spread(name: str, value: ArrayLike, n: int, least: float | None = None) -> Array:
    """Return a number or (n,) as (n,), above 0 or not below ``least``."""
    array = as_array(name, value)
    if array.shape not in ((), (n,)) or not ((array > 0) if least is None else (array >= least)).all():
        wanted = "greater than 0" if least is None else f"not below {least:g}"
        raise InputError(
            f"{name} = {array.tolist()}, expected a number or ({n},), {wanted}", argument=name, value=array
        )
    return freeze(np.broadcast_to(array, (n,)).copy())
