"""The plan of a control loop, which can be held and resumed whatever its law."""

from __future__ import annotations

import warnings

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.speed_override import SpeedOverride
from pathcontrol.control.wrappers.wrapper import LawWrapper
from pathcontrol.engine.control_tick import ControlTick
from pathcontrol.errors import EngineError, PathControlWarning, TaskError

_FULL = 1e-9  # of the speed that may be missing when the law goes on without the speed input


class HeldPlan:
    """A law that runs by itself while nothing holds it, compiled where it can be, and else with a speed input.

    Args:
        law: the law; one that is wrapped, or has an observer, always keeps its speed input.
        period: control period [s].
    """

    def __init__(self, law: Controller, period: float) -> None:
        self._law = law
        self._wrapper = law.apart() if isinstance(law, LawWrapper) else SpeedOverride(law)
        self._held = ControlTick(self._wrapper, period)
        self._free = None if isinstance(law, LawWrapper) or law.observer is not None else _make_free_tick(law, period)
        self._tick = self._free or self._held

    @property
    def s(self) -> float:
        """The path parameter of the plan."""
        return self._tick.s

    @property
    def factor(self) -> float:
        """The factor of its speed at which the plan goes."""
        return 1.0 if self._tick is self._free else float(self._wrapper.split(self._held.state)[-1][0])

    @property
    def state(self) -> Array:
        """The state z of the law, (m,), without that of a speed input which it does not have itself."""
        state = self._tick.state
        return state if self._tick is self._free or isinstance(self._law, LawWrapper) else state[:-2]

    @property
    def outcome(self) -> dict[str, Array]:
        """The outcome of the law up to now, see :meth:`Controller.outcome`."""
        return self._law.outcome(self.state[None])

    def start(self, q: Array, qd: Array) -> None:
        """Start with an arm at (q, q̇), (n,), at the speed that the operator asks for."""
        self._wrapper.go()
        self._held.start(q, qd)
        if self._free is not None:
            self._free.start_from(self._held.state[:-2])  # what is before the state of the speed input
        self._tick = self._free or self._held

    def tick(self, q: Array, qd: Array) -> Array:
        """Return the torques of the law, (n,), and advance its plan by a period."""
        tau = self._tick(q, qd)
        if self._tick is not self._free and self._free is not None:
            self._leave_speed_input(self._free)
        return tau

    def act(self, tau: Array) -> None:
        """Say which torques act up to the next tick [N m], (n,), see :meth:`ControlTick.act`."""
        self._tick.act(tau)

    def wait(self, time: float) -> None:
        """Say that a period took ``time`` [s] more, see :meth:`ControlTick.wait`."""
        self._tick.wait(time)

    def hold(self) -> None:
        """Let the plan come to rest on the path."""
        if self._tick is self._free and self._free is not None:
            self._held.start_from(np.concatenate([self._free.state, [1.0, 0.0]]), self._free.ticks)
            self._tick = self._held
        self._wrapper.stop()

    def resume(self) -> None:
        """Let the plan go on, as the operator asks for."""
        self._wrapper.go()

    def restart(self, q: Array, qd: Array) -> None:
        """Begin at the point of the path that is nearest to the arm, at rest, with what the law has learned.

        Raises:
            TaskError: the path does not say which point is nearest.
        """
        own, *speeds = self._wrapper.split(self._wrapper.start(q, qd))
        before = self._tick.state
        if np.isfinite(before).all():
            before = before if self._tick is self._free else self._wrapper.split(before)[0]
            own = self._wrapper.inner.recollect(own, before)
        own[0] = self._law.task.sigma_bar(q)
        if not np.isfinite(own[0]):
            raise TaskError(
                f"sigma_bar({q.tolist()}) = {own[0]}, expected the path parameter of the nearest point", value=q
            )
        for speed in speeds:
            speed[0] = 0.0
        self._held.start_from(np.concatenate([own, *speeds]), self._tick.ticks)
        self._tick = self._held

    def distance(self, q: Array) -> float:
        """Return ‖q_d(s) − q‖ [rad] of an arm at q (n,)."""
        away = np.asarray(self._law.task.q_d(np.array(self.s))).reshape(q.shape) - q
        return float(np.sqrt(away @ away))

    def _leave_speed_input(self, free: ControlTick) -> None:
        """Go on without the speed input where the plan has its full speed again."""
        state = self._held.state
        if abs(state[-2] - 1.0) < _FULL and abs(state[-1]) < _FULL:
            free.start_from(state[:-2], self._held.ticks)
            self._tick = free


def _make_free_tick(law: Controller, period: float) -> ControlTick | None:
    """Return the tick of a law by itself, None where that is beyond the engine."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PathControlWarning)  # the tick with the speed input has said it
            return ControlTick(law, period)
    except EngineError:
        return None
