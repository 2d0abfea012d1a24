"""The sampled loop: measure, compute, hold."""

from __future__ import annotations

from collections import deque

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.errors import SimulationError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.modes import SampledLoop, torque_limits
from pathcontrol.simulation.plant import Plant
from pathcontrol.simulation.sensors import Reading

_CHECK_EVERY = 64  # ticks between looks at whether everything is still finite


class Recorder:
    """Arrays (time, rollout, …) filled a tick at a time, handed out as (rollout, time, …)."""

    def __init__(self, ticks: int) -> None:
        self._ticks = ticks
        self._arrays: dict[str, Array] = {}

    def write(self, tick: int, **values: Array) -> None:
        """Store the values of one tick."""
        if not self._arrays:
            self._arrays = {k: np.empty((self._ticks, *v.shape), dtype=v.dtype) for k, v in values.items()}
        for name, value in values.items():
            self._arrays[name][tick] = value

    def arrays(self) -> dict[str, Array]:
        """Everything stored, rollouts first."""
        return {name: np.moveaxis(array, 0, 1) for name, array in self._arrays.items()}


class Actuator:
    """Torque limits and the delay between measuring and acting."""

    def __init__(self, loop: SampledLoop, robot: RobotModel, shape: tuple[int, int]) -> None:
        self._limits = torque_limits(loop, robot)
        whole, fraction = divmod(loop.delay / loop.period, 1.0)
        late = round(fraction * loop.period, 15)
        self._queue = deque([np.zeros(shape)] * (int(whole) + (late > 0)))
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
            _record(recorder, tick, q, qd, reading, out, torques[0])
            z = controller.advance(z, out, loop.period)
            q, qd = _hold(plants, torques, loop.substeps, q, qd)
            if tick % _CHECK_EVERY == 0:
                _check_finite(tick * loop.period, q, qd)
                update(tick)
    _check_finite(ticks * loop.period, q, qd)
    return loop.period * np.arange(ticks + 1), recorder.arrays()


def _hold(plants: list[Plant], torques: list[Array], substeps: int, q: Array, qd: Array) -> tuple[Array, Array]:
    for plant, tau in zip(plants, torques, strict=True):
        for _ in range(substeps):
            q, qd = plant.advance(q, qd, tau)
    return q, qd


def _record(
    recorder: Recorder, tick: int, q: Array, qd: Array, reading: Reading, out: ControlOutput, tau: Array
) -> None:
    recorder.write(
        tick,
        q=q,
        qd=qd,
        q_measured=reading.q,
        qd_measured=reading.qd,
        tau_demand=out.tau,
        tau=tau,
        s=out.s,
        sdot=out.sdot,
        e_p=out.e_p,
        e_v=out.e_v,
        regular=out.regular,
    )


def _check_finite(time: float, q: Array, qd: Array) -> None:
    lost = ~(np.isfinite(q) & np.isfinite(qd)).all(-1)
    if lost.any():
        raise SimulationError(
            f"rollout {int(np.argmax(lost))} diverged before t = {time:.3g} s; lower the gains or shorten the period"
        )
