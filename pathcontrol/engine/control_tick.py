"""A control law for one arm as one call per period, as a control loop on hardware needs it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from ctypes import addressof

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array, as_scalar, check_whole
from pathcontrol._milliseconds import as_period
from pathcontrol.control.base import Controller, ControlOutput, check_controller
from pathcontrol.control.law_gains import refuse_several_gains
from pathcontrol.control.wrappers.override_rule import Override, check_one_speed
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.engine.library import load_library
from pathcontrol.engine.run_settings import GAINS, add_law
from pathcontrol.engine.structs import Memory, Setup, Tick, address_of
from pathcontrol.errors import EngineError, InputError, TaskError
from pathcontrol.tasks.batch.task_batch import TaskBatch


class ControlTick:
    """A control law for one arm, with the state of its plan, as one call without allocation.

    >>> tick = ControlTick(law, period=2.5e-3)
    >>> tick.start(q, qd)
    >>> tau = tick(q, qd)  # every period

    It computes what ``law.law`` and ``law.advance`` do, without torque limits. The next call writes the returned array
    anew; copy it to keep it.

    Computed torque, PD+, Slotine and Li's law, the extended motion plan and projection are compiled, with their
    observers and wrappers; other laws are run in Python, with the same torques. A law that is wrapped, by
    :class:`SpeedOverride` or another :class:`LawWrapper`, has the methods of its speed input: :meth:`hold`,
    :meth:`resume`, :meth:`override` and :meth:`reverse` act at the next call. An observer takes the returned torques
    to act up to the next call, within the effort limits of its robot, unless :meth:`act` says which do; so does a law
    of one's own that remembers its torque. A compiled tick keeps the gains, the arm and the task of the law as they are
    when it is made; speed inputs may change.

    Args:
        law: any law with one task, and gains for one arm.
        period: control period [s].

    Attributes:
        s: path parameter of the plan.

    Raises:
        EngineError: the arm or the task of a law of the library is beyond the compiled engine, or that is not
            installed.
        InputError: the law is for several rollouts.
    """

    def __init__(self, law: Controller, period: float) -> None:
        check_controller("law", law)
        gains = [law.observer_hz, *(getattr(law, name) for name in law.gains)]
        if isinstance(law.task, TaskBatch) or any(np.ndim(gain) > 1 for gain in gains):
            raise InputError(
                "the law is for several rollouts, expected one task and one set of gains", argument="law", value=law
            )
        refuse_several_gains(law)
        self.law, self._period = law, as_period("period", period)
        self._tick = _make_tick(law, self._period)
        self.start(np.zeros(law.robot.n) if law.start_at == "s0" else law.task.q_d(np.array(law.task.s0)))

    @property
    def s(self) -> float:
        """The path parameter of the plan at the next call."""
        return self._tick.s

    def start(self, q: ArrayLike, qd: ArrayLike | None = None) -> None:
        """Start again with an arm at q [rad] and q̇ [rad/s], each (n,); at rest by default."""
        n = self.law.robot.n
        position = as_joint_array("q", q, n)
        velocity = np.zeros(n) if qd is None else as_joint_array("qd", qd, n)
        self._tick.start(self.law.start(position, velocity))

    @property
    def state(self) -> Array:
        """The state z of the law at the next call, (m,)."""
        return self._tick.state

    @property
    def ticks(self) -> int:
        """The number of periods for which the law has run at the next call, which is its time."""
        return self._tick.ticks

    def start_from(self, state: ArrayLike, ticks: int = 0) -> None:
        """Start again from a ``state`` of the law, (m,), as :attr:`state` gives it.

        Args:
            state: z.
            ticks: number of periods for which the law has run, where its time goes on.

        Raises:
            InputError: the state has another length than that of this law, or ``ticks`` is no whole number.
        """
        check_whole("ticks", ticks, 0)
        z, expected = np.array(state, dtype=np.float64), self.state.shape
        if z.shape != expected:
            raise InputError(
                f"state has the shape {z.shape}, expected {expected}: a state of this law",
                argument="state",
                value=z.shape,
                limit=expected,
            )
        observer = self.law.inner.observer if isinstance(self.law, LawWrapper) else self.law.observer
        if observer is not None and observer.has_seen(z[1 : 1 + observer.size]):  # its last tick is a period ago
            z[observer.size] = (ticks - 1) * self._period
        self._tick.start(z, ticks)

    def __call__(self, q: Array, qd: Array) -> Array:
        """Return the torques [N m], (n,), for measured q [rad] and q̇ [rad/s]; advance the plan by a period."""
        return self._tick(q, qd)

    def act(self, tau: ArrayLike) -> None:
        """Tell the law the torques that act up to the next call [N m], (n,), where others were returned.

        So what a limit or a drive takes away is no disturbance to its observer, and a law of one's own advances with
        the torque that acts. Others need no telling.
        """
        if self._tick.listens:
            self._tick.act(as_joint_array("tau", tau, self.law.robot.n).copy())

    def wait(self, time: float) -> None:
        """Tell the law's observer that the next call comes ``time`` [s] later than a period after this one.

        It comes earlier where that is below 0, by a period at most. The torques act on meanwhile. The plan waits, as it
        goes on by a period at each call.

        Raises:
            InputError: it would come before this one.
        """
        if self.law.observer is not None:
            self._tick.wait(as_scalar("time", time, least=-self._period))

    def hold(self) -> None:
        """Let the plan come to rest on its path and stay there; see :meth:`LawWrapper.hold`."""
        self._wrapper().hold()

    def resume(self) -> None:
        """Let the plan go forward again; see :meth:`LawWrapper.resume`."""
        self._wrapper().resume()

    def override(self, value: Override) -> None:
        """Set how fast the plan goes when it is not held, as a factor from 0 to 2; see :meth:`LawWrapper.override`."""
        law = self._wrapper()
        check_one_speed(value, self._tick.time)
        law.override(value)

    def reverse(self) -> None:
        """Let the plan go back along its path; see :meth:`LawWrapper.reverse`."""
        self._wrapper().reverse()

    def _wrapper(self) -> LawWrapper:
        """Return the law, which must have a speed input."""
        if not isinstance(self.law, LawWrapper):
            name = type(self.law).__name__
            raise InputError(
                f"{name} has no speed input; wrap it: ControlTick(SpeedOverride(law), {self._period:g})", value=self.law
            )
        return self.law


class _CompiledTick:
    """A tick in the compiled engine."""

    def __init__(self, law: Controller, period: float) -> None:
        self._memory, self._setup, self._period, self.ticks = Memory(), Setup(), period, 0
        self._setup.period, self._observer = period, law.observer
        self._rules = add_law(self._setup, law, self._memory)
        with suppress(TaskError):  # of a path that can be passed in one direction only
            self._rules.prepare_to_go_back()  # now: an operator may ask for it between two ticks
        n = law.robot.n
        self._io, self._state = np.zeros(3 * n + 1), np.zeros(self._setup.memory)
        self._q, self._qd, self._tau = self._io[:n], self._io[n : 2 * n], self._io[2 * n + 1 :]
        self._most = _effort_bounds(law)
        self._function: Callable[..., object] = load_library().pathcontrol_control_tick
        places = {"io": self._io, "memory": self._state, "most": self._most}
        self._call = Tick(setup=addressof(self._setup), **{name: address_of(array) for name, array in places.items()})
        self._address = addressof(self._call)
        self._returned = np.zeros(n)  # by the last call; who asked may write into what it got
        self._told: Array | None = None  # the torques that act since the last call, where it was told

    @property
    def s(self) -> float:
        """The path parameter of the plan at the next call."""
        return float(self._io[len(self._q) * 2])

    @property
    def time(self) -> float:
        """The time of the law at the next call [s]."""
        return self.ticks * self._period

    @property
    def state(self) -> Array:
        """The state z (m,)."""
        return np.append(self.s, self._state)

    @property
    def listens(self) -> bool:
        """True where the law asks which torques act."""
        return self._observer is not None

    def act(self, tau: Array) -> None:
        """Let the torques (n,) act up to the next call."""
        assumed = np.clip(self._returned, -self._most, self._most) if self._told is None else self._told
        if self._observer is not None:
            self._observer.correct(self._state, tau - assumed)
        self._told = tau

    def wait(self, time: float) -> None:
        """Let ``time`` [s] more than a period pass up to the next call."""
        if self._observer is not None:
            self._observer.wait(self._state, time)

    def start(self, z: Array, ticks: int = 0) -> None:
        """Start with the state z (m,) after a number of periods."""
        self._io[len(self._q) * 2], self._state[:], self.ticks = z[..., 0].item(), z[..., 1:], ticks
        self._told = None

    def __call__(self, q: Array, qd: Array) -> Array:
        """Return the torques, and advance."""
        self._q[:], self._qd[:] = q, qd
        if self._setup.memory:  # else nothing depends on time
            self._listen()
        self._function(self._address)
        if self._observer is not None:
            self._returned[:] = self._tau
        self.ticks, self._told = self.ticks + 1, None
        return self._tau

    def _listen(self) -> None:
        """Set the time of the tick, and what operators ask for at it."""
        self._call.t = self.time
        self._asked = self._rules.ask(np.array([self._call.t]), 1)  # kept alive for the call
        self._call.inputs = address_of(self._asked)


def _make_tick(law: Controller, period: float) -> _PythonTick | _CompiledTick:
    """Return a compiled tick where the law is one that can be compiled, else one in Python.

    Raises:
        EngineError: the arm or the task of a law without wrapper and observer is beyond the engine.
    """
    if type(law) in GAINS and law.observer is None:
        return _CompiledTick(law, period)
    try:
        return _CompiledTick(law, period)
    except EngineError:
        return _PythonTick(law, period)


def _effort_bounds(law: Controller) -> Array:
    """Return the effort limits of a law's robot [N m], (n,), ∞ where it states none."""
    effort = law.robot.limits.effort
    return np.where(effort > 0, effort, np.inf)  # some robots state 0


class _PythonTick:
    """A tick of a law in Python."""

    listens = True  # whatever it remembers of its torque

    def __init__(self, law: Controller, period: float) -> None:
        self._law, self._period, self.ticks = law, period, 0
        self._z, self._waited = np.zeros((1, 1)), 0.0
        self._last: tuple[Array, ControlOutput] | None = None  # state and output of the last call
        self._tau, self._most = np.zeros(law.robot.n), _effort_bounds(law)

    @property
    def s(self) -> float:
        """The path parameter of the plan at the next call."""
        return float(self._z[0, 0])

    @property
    def time(self) -> float:
        """The time of the law at the next call [s]."""
        return self.ticks * self._period

    @property
    def state(self) -> Array:
        """The state z (m,)."""
        return self._z[0].copy()

    def act(self, tau: Array) -> None:
        """Let the torques (n,) act up to the next call: the law advances with them."""
        if self._last is None or (tau == self._last[1].tau[0]).all():
            return
        z, out = self._last
        self._advance(z, out._replace(tau=tau[None]))
        self._delay(self._waited)

    def wait(self, time: float) -> None:
        """Let ``time`` [s] more than a period pass up to the next call."""
        self._waited += time
        self._delay(time)

    def start(self, z: Array, ticks: int = 0) -> None:
        """Start with the state z (m,) after a number of periods."""
        self._z, self.ticks, self._last = np.atleast_2d(z), ticks, None

    def __call__(self, q: Array, qd: Array) -> Array:
        """Return the torques, and advance."""
        position, velocity = np.array(q, dtype=np.float64)[None], np.array(qd, dtype=np.float64)[None]
        out = self._law.law(self.ticks * self._period, position, velocity, self._z)
        self._waited, self.ticks = 0.0, self.ticks + 1
        self._advance(self._z, out._replace(tau=np.clip(out.tau, -self._most, self._most)))
        self._tau[:] = out.tau[0]
        return self._tau

    def _advance(self, z: Array, out: ControlOutput) -> None:
        """Take the state z (1, m) of the last call over a period, in which ``out.tau`` acts."""
        self._z, self._last = self._law.advance(z, out, self._period), (z, out)

    def _delay(self, time: float) -> None:
        """Let the law's observer know of ``time`` [s] more."""
        if self._law.observer is not None and time:
            self._z = self._z.copy()
            self._law.observer.wait(self._z[0, 1:], time)
