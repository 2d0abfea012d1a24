"""The closed loop as a map of its whole state, smooth enough to be differentiated."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import Controller
from pathcontrol.control.learning.learning_law import LearningLaw
from pathcontrol.control.mpc.path_mpc import PathMPC
from pathcontrol.control.wrappers.wrapper import LawWrapper, unwrap
from pathcontrol.errors import InputError
from pathcontrol.robot.friction import viscous_of
from pathcontrol.simulation.arm.plant import Plant
from pathcontrol.simulation.arm.sensors import Reading
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.simulation.sampled import split_delay


class ContinuousMap:
    """The rate of the state (q, q̇, z) in continuous time.

    Of the memory of a momentum observer r₁ − Kp and r are states; the rest is of ticks, and left out.
    """

    def __init__(self, law: Controller) -> None:
        _refuse_jumps(law)
        self._law, self._robot, self._n = law, law.robot, law.robot.n
        self._of_ticks = np.zeros((1, 2 * self._n + 1))
        self._viscous = np.atleast_2d(viscous_of(law.robot.friction))[0]

    def on_path(self, s: Array) -> Array:
        """Return the states on the path, (k, D), at s (k,)."""
        point = self._law.task.at(s)
        z = np.array(self._law.start(point.q_d, point.velocity), dtype=np.float64)
        z[:, 0] = s
        if (observer := self._law.observer) is not None:
            z[:, 1 : 1 + self._n] = -observer.gain * self._robot.momentum(point.q_d, point.velocity)
            self._of_ticks[:, -1] = z[0, observer.size]
        return np.concatenate([point.q_d, point.velocity, self._leave_out_ticks(z)], axis=-1)

    def __call__(self, x: Array) -> Array:
        """Return ẋ at states x, (k, D)."""
        q, qd, z = x[:, : self._n], x[:, self._n : 2 * self._n], x[:, 2 * self._n :]
        if self._law.observer is not None:
            known, own = z[:, : 1 + 2 * self._n], z[:, 1 + 2 * self._n :]
            z = np.concatenate([known, np.repeat(self._of_ticks, len(x), axis=0), own], axis=-1)
        out = self._law.law(0.0, q, qd, z)
        qdd = self._robot.forward_dynamics(q, qd, out.tau - self._viscous * qd)
        return np.concatenate([qd, qdd, self._leave_out_ticks(self._law.rate(out))], axis=-1)

    def _leave_out_ticks(self, z: Array) -> Array:
        """Return states or rates of the law, (k, m), without what its observer remembers of the last tick."""
        if (observer := self._law.observer) is None:
            return z
        return np.delete(z, np.arange(1 + 2 * self._n, 1 + observer.size), axis=-1)


class TickMap:
    """The state one period later in a sampled loop: (q, q̇, z, the last reading, the torques that wait).

    The time in the memory of a momentum observer counts from the tick, so that the map is the same at each.

    Raises:
        InputError: something of the loop has no derivative.
    """

    def __init__(self, law: Controller, loop: SampledLoop) -> None:
        _refuse_jumps(law)
        for name, what in (("encoders", loop.encoders), ("noise", loop.noise), ("torque_limits", loop.torque_limits)):
            if what is not False and what is not None:
                raise InputError(f"a loop with {name} has no derivative; leave {name} out", argument="loop", value=name)
        self.period, self._law, self._n = loop.period, law, law.robot.n
        self._sensors, self._substeps = loop.sensors(law.robot), loop.substeps
        whole, late = split_delay(loop.delay, loop.period)
        self._waiting = whole + (late > 0)
        self._parts = [late, loop.period - late] if late else [loop.period]
        self._plants = [Plant(law.robot, part / loop.substeps) for part in self._parts]
        self._reads = loop.velocity == "difference" or loop.filter_hz is not None

    def parameter(self, x: Array) -> Array:
        """Return s of states x, (k,)."""
        return x[:, 2 * self._n]

    def position(self, x: Array) -> Array:
        """Return q of states x, (k, n)."""
        return x[:, : self._n]

    def on_path(self, s: Array) -> Array:
        """Return states on the path at s (k,), (k, D), with torques that hold the arm against its weight."""
        point = self._law.task.at(s)
        q, qd = point.q_d, point.velocity
        z = np.array(self._law.start(q, qd), dtype=np.float64)
        z[:, 0] = s
        z = self._date_memory(z, -self.period)
        waiting = [self._law.robot.gravity(q)] * self._waiting
        reading = [q, qd] if self._reads else []
        return np.concatenate([q, qd, z, *reading, *waiting], axis=-1)

    def __call__(self, x: Array) -> Array:
        """Return the states after a period, (k, D)."""
        n = self._n
        after = x.shape[1] - n * (self._waiting + 2 * self._reads)
        q, qd, z, rest = x[:, :n], x[:, n : 2 * n], x[:, 2 * n : after], x[:, after:]
        seen = Reading(rest[:, :n], rest[:, n : 2 * n]) if self._reads else Reading(q, qd)
        queue = [rest[:, i : i + n] for i in range(2 * n * self._reads, rest.shape[1], n)]
        out = self._law.law(0.0, seen.q, seen.qd, z)
        queue.append(out.tau)
        acting = queue[: len(self._parts)]
        share = np.array(self._parts) / self.period
        mean = sum(part * tau for part, tau in zip(share, acting, strict=True))
        z = self._date_memory(self._law.advance(z, out._replace(tau=mean), self.period), -self.period)
        for plant, tau in zip(self._plants, acting, strict=True):
            for _ in range(self._substeps):
                q, qd = plant.advance(q, qd, tau)
        reading = list(self._sensors.read(q, qd, seen)) if self._reads else []
        return np.concatenate([q, qd, z, *reading, *queue[1:]], axis=-1)

    def _date_memory(self, z: Array, time: float) -> Array:
        """Return the state of the law, (k, m), the last tick of its observer at a time [s] from this one."""
        if self._law.observer is not None:
            z = z.copy()
            z[:, self._law.observer.size] = time
        return z


def _refuse_jumps(law: Controller) -> None:
    """Check that a law neither learns nor optimises."""
    if isinstance(unwrap(law), PathMPC):
        raise InputError(
            "PathMPC solves an optimisation at each tick, to a tolerance and with torque limits, which leaves no "
            "derivative to rely on; without limits its deviations decay with (Q/R)^¼ and its speed with √(W/R_s)",
            argument="law",
            value=law,
        )
    if isinstance(law, LawWrapper) and isinstance(law.inner, LearningLaw):
        raise InputError(
            "what a law learns changes at once at the end of a lap, which has no derivative; give the law inside: a "
            "feedforward that is learned moves no multiplier",
            argument="law",
            value=law,
        )
