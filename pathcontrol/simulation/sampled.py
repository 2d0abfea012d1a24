"""The sampled loop: measure, compute, hold."""

from __future__ import annotations

from collections import deque

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller
from pathcontrol.errors import SimulationError
from pathcontrol.robot.model import RobotModel
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
        """The torque in each part of this period, when ``tau`` has just been computed."""
        self._queue.append(tau)
        late = len(self._parts) > 1
        acting = [self._queue[0], self._queue[1]] if late else [self._queue[0]]
        self._queue.popleft()
        return acting


def run_sampled(
    controller: Controller,
    plant_robot: RobotModel,
    loop: SampledLoop,
    q: Array,
    qd: Array,
    duration: float,
    progress: bool,
) -> tuple[Array, dict[str, Array]]:
    """Times (T,) and recorded arrays (rollout, T, …) of the sampled loop from (q, q̇), both (N, n)."""
    ticks = max(1, round(duration / loop.period))
    sensors, actuator, recorder = (
        loop.sensors(plant_robot),
        Actuator(loop, plant_robot, q.shape),
        Recorder(ticks + 1),
    )
    plants = [Plant(plant_robot, part / loop.substeps) for part in actuator.parts]
    reading, z = sensors.start(q, qd), controller.start(q, qd)
    # a rollout that diverges overflows first; that is looked for below
    with progress_bar("simulating", ticks, progress) as update, np.errstate(over="ignore", invalid="ignore"):
        for tick in range(ticks + 1):
            reading = sensors.read(q, qd, reading)
            out = controller.law(tick * loop.period, reading.q, reading.qd, z)
            torques = actuator.torques(actuator.limited(out.tau))
            recorder.write(tick, q, qd, reading, out, torques[0])
            z = controller.advance(z, out, loop.period)
            q, qd = _hold(plants, torques, loop.substeps, q, qd)
            if tick % _CHECK_EVERY == 0:
                _check_finite(tick * loop.period, q, qd, out.tau)
                update(tick)
    _check_finite(ticks * loop.period, q, qd, out.tau)
    return loop.period * np.arange(ticks + 1), recorder.arrays()


def _hold(plants: list[Plant], torques: list[Array], substeps: int, q: Array, qd: Array) -> tuple[Array, Array]:
    for plant, tau in zip(plants, torques, strict=True):
        for _ in range(substeps):
            q, qd = plant.advance(q, qd, tau)
    return q, qd


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
