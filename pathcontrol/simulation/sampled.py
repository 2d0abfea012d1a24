"""The sampled loop: measure, compute, hold."""

from __future__ import annotations

from collections import deque

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller
from pathcontrol.errors import SimulationError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.finish import Finish
from pathcontrol.simulation.modes import SampledLoop, torque_limits
from pathcontrol.simulation.plant import Plant
from pathcontrol.simulation.recorder import Recorder

_CHECK_EVERY = 64  # ticks between looks at whether everything is still finite
_ABSURD = 1e6  # rad and rad/s, beyond any arm


class Actuator:
    """Torque limits and the delay between measuring and acting."""

    def __init__(self, loop: SampledLoop, robot: RobotModel, shape: tuple[int, int]) -> None:
        self._limits = torque_limits(loop, robot)
        whole, late = _periods_and_rest(loop.delay, loop.period)
        self._queue = deque([np.zeros(shape)] * (whole + (late > 0)))
        self._parts = [late, loop.period - late] if late else [loop.period]

    @property
    def parts(self) -> list[float]:
        """The parts of a period [s] during which the torque is constant."""
        return self._parts

    def limited(self, tau: Array) -> Array:
        """``tau`` within the limits."""
        return tau if self._limits is None else np.clip(tau, -self._limits, self._limits)

    def torques(self, tau: Array) -> list[Array]:
        """The torque in each part of a period at whose begin ``tau`` is computed."""
        return [*self._queue, tau][: len(self._parts)]

    def hold(self, tau: Array) -> None:
        """The period is over at whose begin ``tau`` was computed."""
        self._queue.append(tau)
        self._queue.popleft()


class SampledArm:
    """The arm behind its sensors and actuators; controllers may take it over one after the other, at a tick.

    Args:
        loop: the control computer.
        robot: the arm.
        q: joint positions it starts at [rad], (N, n).
        qd: joint velocities it starts with [rad/s], (N, n).
    """

    def __init__(self, loop: SampledLoop, robot: RobotModel, q: Array, qd: Array) -> None:
        self.q, self.qd, self._period, self._substeps = q, qd, loop.period, loop.substeps
        self._sensors, self._actuator = loop.sensors(robot), Actuator(loop, robot, q.shape)
        self._plants = [Plant(robot, part / loop.substeps) for part in self._actuator.parts]
        self._reading = self._sensors.read(q, qd, self._sensors.start(q, qd))

    def run(self, controller: Controller, duration: float, finish: Finish | None, progress: bool) -> dict[str, Array]:
        """What was recorded, (rollout, time, …), from here until ``finish`` says so, ``duration`` [s] at most."""
        ticks, recorder = max(1, round(duration / self._period)), Recorder()
        z = controller.start(self.q, self.qd)
        # a rollout that diverges overflows first; that is looked for below
        with progress_bar("simulating", ticks, progress) as update, np.errstate(over="ignore", invalid="ignore"):
            for tick in range(ticks + 1):
                t, reading = tick * self._period, self._reading
                out = controller.law(t, reading.q, reading.qd, z)
                tau = self._actuator.limited(out.tau)
                recorder.write(self.q, self.qd, reading, out, self._actuator.torques(tau)[0])
                ended = tick == ticks or (finish is not None and finish(t, out.s, self.qd))
                if ended or tick % _CHECK_EVERY == 0:
                    _check_finite(t, self.q, self.qd, out.tau)
                    update(tick)
                if ended:
                    break
                z = controller.advance(z, out, self._period)
                self._advance(tau)
        return recorder.arrays()

    def _advance(self, tau: Array) -> None:
        """One period on, when ``tau`` was computed at its begin."""
        for plant, acting in zip(self._plants, self._actuator.torques(tau), strict=True):
            for _ in range(self._substeps):
                self.q, self.qd = plant.advance(self.q, self.qd, acting)
        self._actuator.hold(tau)
        self._reading = self._sensors.read(self.q, self.qd, self._reading)


def _periods_and_rest(delay: float, period: float) -> tuple[int, float]:
    """``delay`` as whole periods and a rest below one; rounding makes no rest."""
    whole = round(delay / period)
    if abs(delay / period - whole) < 1e-9:
        return whole, 0.0
    whole = int(delay // period)
    return whole, delay - whole * period


def _check_finite(time: float, q: Array, qd: Array, tau: Array) -> None:
    lost = ~((np.abs(q) < _ABSURD) & (np.abs(qd) < _ABSURD)).all(-1)
    if lost.any():
        raise SimulationError(
            f"rollout {int(np.argmax(lost))} diverged before t = {time:.3g} s; lower the gains or shorten the period"
        )
    lost = ~np.isfinite(tau).all(-1)
    if lost.any():
        raise SimulationError(
            f"the law asks rollout {int(np.argmax(lost))} for torques that are no numbers before t = {time:.3g} s; "
            "look for a NaN in the task, q_d or ϑ, near where the arm is"
        )
