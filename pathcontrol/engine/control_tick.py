"""A control law for one arm as one compiled call per period, as a control loop on hardware needs it."""

from __future__ import annotations

from ctypes import addressof

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array, as_scalar
from pathcontrol.control.base import Controller
from pathcontrol.engine.library import load_library
from pathcontrol.engine.run_settings import add_law
from pathcontrol.engine.structs import Memory, Setup
from pathcontrol.errors import InputError
from pathcontrol.tasks.batch.task_batch import TaskBatch


class ControlTick:
    """A law of the library for one arm, with the state of its plan, as one call without allocation.

    >>> tick = ControlTick(law, period=2.5e-3)
    >>> tick.start(q, qd)
    >>> tau = tick(q, qd)  # every period

    It computes what ``law.law`` and ``law.advance`` do, without torque limits. The next call writes the returned array
    anew; copy it to keep it.

    Args:
        law: one of the five laws of the library, with one task and gains for one arm.
        period: control period [s].

    Attributes:
        s: path parameter of the plan.

    Raises:
        EngineError: the law, its arm or task is beyond the compiled engine, or that is not installed.
        InputError: the law is for several rollouts.
    """

    def __init__(self, law: Controller, period: float) -> None:
        if isinstance(law.task, TaskBatch) or any(np.ndim(getattr(law, gain)) > 1 for gain in law.gains):
            raise InputError("the law is for several rollouts, expected one task and one set of gains")
        self.law, self._memory, self._setup = law, Memory(), Setup()
        self._setup.period = as_scalar("period", period, positive=True)
        add_law(self._setup, law, self._memory)
        n = law.robot.n
        self._io = np.zeros(3 * n + 1)
        self._q, self._qd, self._tau = self._io[:n], self._io[n : 2 * n], self._io[2 * n + 1 :]
        self._function = load_library().pathcontrol_control_tick
        self._arguments = addressof(self._setup), self._io.ctypes.data
        self.start(np.zeros(n) if law.start_at == "s0" else law.task.q_d(np.array(law.task.s0)))

    @property
    def s(self) -> float:
        """The path parameter of the plan at the next call."""
        return float(self._io[len(self._q) * 2])

    def start(self, q: ArrayLike, qd: ArrayLike | None = None) -> None:
        """Start again with an arm at q [rad] and q̇ [rad/s], each (n,); at rest by default."""
        n = self.law.robot.n
        position = as_joint_array("q", q, n)
        velocity = np.zeros(n) if qd is None else as_joint_array("qd", qd, n)
        self._io[2 * n] = self.law.start(position, velocity)[..., 0]

    def __call__(self, q: Array, qd: Array) -> Array:
        """Return the torques [N m], (n,), for measured q [rad] and q̇ [rad/s]; advance the plan by a period."""
        self._q[:], self._qd[:] = q, qd
        self._function(*self._arguments)
        return self._tau
