"""The sampled loop: measure, compute, hold."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller
from pathcontrol.simulation.arm.changing_arm import ChangingArm
from pathcontrol.simulation.arm.disturbance import list_terms
from pathcontrol.simulation.arm.dropout import Dropouts
from pathcontrol.simulation.arm.noise import NoiseSource
from pathcontrol.simulation.arm.plant import Plant, Walls
from pathcontrol.simulation.arm.sensors import Reading
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.divergence import Divergence
from pathcontrol.simulation.finish import Finish
from pathcontrol.simulation.loops import Arm, Outside, SampledLoop, check_rows, torque_limits
from pathcontrol.simulation.lossy_line import LossyLine
from pathcontrol.simulation.recorder import Recorder
from pathcontrol.simulation.seam import Left, start_next

_UPDATE_EVERY = 64  # ticks between updates of the progress bar


class Stepper(Protocol):
    """The interface of a simulated arm that advances a step at a time."""

    step: float

    def advance(
        self, q: Array, qd: Array, tau: Array, held: NDArray[np.bool_] | None = None, walls: Walls | None = None
    ) -> tuple[Array, Array]:
        """Return (q, q̇) one step later under the constant torque ``tau``, with ``held`` joints and ``walls``."""


class Actuator:
    """Torque limits and the delay between measuring and acting.

    Attributes:
        limits: torque limits [N m], (1, n) or (N, n), or None.
        waiting: number of torques that are computed but do not act yet.
    """

    def __init__(self, loop: SampledLoop, robot: Arm, shape: tuple[int, int]) -> None:
        limits = torque_limits(loop, robot)
        check_rows(limits, "torque_limits", shape[0])
        # no limit is the largest number, of which a disturbance may leave nothing; inf · 0 is none
        self.limits = None if limits is None else np.atleast_2d(np.minimum(limits, np.finfo(np.float64).max))
        self._limits = None if self.limits is None else (-self.limits, self.limits)
        whole, late = split_delay(loop.delay, loop.period)
        self.waiting = whole + (late > 0)
        self._queue = deque([np.zeros(shape)] * self.waiting)
        self._parts = [late, loop.period - late] if late else [loop.period]

    @property
    def parts(self) -> list[float]:
        """The parts of a period [s] during which the torque is constant."""
        return self._parts

    def clip(self, tau: Array) -> Array:
        """Return ``tau`` within the limits."""
        if self._limits is None:
            return tau
        least, most = self._limits
        return np.minimum(np.maximum(tau, least), most)

    def torques(self, tau: Array) -> list[Array]:
        """Return the torque in each part of the period that begins with ``tau``."""
        return [*self._queue, tau][: len(self._parts)]

    def mean(self, torques: Sequence[Array]) -> Array:
        """Return the mean over a period of the torques in its parts."""
        if len(torques) == 1:
            return torques[0]
        first, last = self._parts
        return (first * torques[0] + last * torques[1]) / (first + last)

    def hold(self, tau: Array) -> None:
        """End the period that began with ``tau``."""
        self._queue.append(tau)
        self._queue.popleft()


class SampledArm:
    """The arm behind its sensors and actuators; controllers may take it over one after the other, at a tick.

    Args:
        loop: the control computer.
        robot: the arm, or one for each rollout.
        q: joint positions it starts at [rad], (N, n).
        qd: joint velocities it starts with [rad/s], (N, n).
        outside: its disturbance, and the number of the first rollout, for its noise.
        plant: makes the stepper of a robot for a step [s].

    Attributes:
        divergence: which rollouts have diverged, at the time since the present controller took over.
        law_outcome: what the last controller has to say of each rollout, see :meth:`Controller.outcome`.
    """

    def __init__(
        self,
        loop: SampledLoop,
        robot: Arm,
        q: Array,
        qd: Array,
        outside: Outside,
        plant: Callable[[Arm, float], Stepper] = Plant,
    ) -> None:
        self.q, self.qd, self._period, self._substeps = q, qd, loop.period, loop.substeps
        self._sensors, self._actuator = loop.sensors(robot), Actuator(loop, robot, q.shape)
        check_rows(self._sensors.resolution, "encoders", len(q))
        self._make_plant, self._robot = plant, robot
        self._plants = self._make_plants(robot)
        self._changing = ChangingArm(robot, outside.disturbance, loop.period)
        self._noise = None if loop.noise is None else NoiseSource(loop.noise, q.shape, outside.first)
        self._reading = self._sensors.start(*self._add_noise())
        self._reading = self._sensors.read(*self._add_noise(), self._reading)
        self._disturbance, self._ticks = outside.disturbance, 0
        self._walls = [term for term in list_terms(outside.disturbance) if isinstance(term, Wall)]
        self._line = LossyLine(Dropouts(outside.disturbance, loop.period, outside.first, len(q)), self._reading)
        self._left: Left | None = None
        self.law_outcome: dict[str, Array] = {}
        self.divergence = Divergence(q, qd)

    def run(
        self, controller: Controller, duration: float, finish: Finish | None, progress: bool, z: Array | None = None
    ) -> dict[str, Array]:
        """Return the record, (rollout, time, …), from here until ``finish`` ends it, ``duration`` [s] at most.

        ``z`` is the state that the law starts with, where that is known already.
        """
        ticks = max(1, round(duration / self._period))
        recorder, lost = Recorder(len(self.q), controller.robot.n, ticks + 1), Divergence(self.q, self.qd)
        first = z = start_next(controller, self.q, self.qd, self._left) if z is None else z
        self.divergence = lost
        # a rollout that diverges may overflow in the step before
        with progress_bar("simulating", ticks, progress) as update, np.errstate(over="ignore", invalid="ignore"):
            for tick in range(ticks + 1):
                t = tick * self._period
                lost.check_state(t, self.q, self.qd)
                if lost.any:
                    self._hold_lost(lost)
                    z = lost.replace_lost(z, first)
                reading = self._line.receive(self._ticks, self._reading)
                out = self._line.send(controller.law(t, reading.q, reading.qd, z), begins=tick == 0)
                lost.check_torque(t, out.tau)
                tau = self._actuator.clip(out.tau)
                if lost.any:
                    tau = lost.replace_lost(tau, 0.0)
                torques = [self._weaken(one) for one in self._actuator.torques(tau)]
                recorder.write(self.q, self.qd, reading, out, torques[0])
                if tick % _UPDATE_EVERY == 0:
                    update(tick)
                if tick == ticks or lost.all:
                    break
                if finish is not None and finish(t, out.s, self.qd, lost.lost):
                    break
                acting = out._replace(tau=self._actuator.mean(torques))
                z = self._line.keep(z, controller.advance(z, acting, self._period))
                self._advance(torques)
                self._actuator.hold(tau)
        self._left, self.law_outcome = Left(controller, z, t), controller.outcome(z)
        arrays = recorder.arrays()
        lost.erase(arrays, self._period * np.arange(arrays["s"].shape[1]))
        return arrays

    def _hold_lost(self, lost: Divergence) -> None:
        """Put lost rollouts, and their readings, back to their initial states."""
        self.q, self.qd = lost.reset_lost(self.q, self.qd)
        self._reading = Reading(*lost.reset_lost(*self._reading))
        self._line.reset(lost)

    def _advance(self, torques: Sequence[Array]) -> None:
        """Advance by one period, with the torque of each part of it."""
        t, arm = self._ticks * self._period, self._changing.at(self._ticks)
        if arm is not self._robot:
            self._robot, self._plants = arm, self._make_plants(arm)
        self.qd = self._changing.strike(self._ticks, self.q, self.qd)
        for plant, acting in zip(self._plants, torques, strict=True):
            for _ in range(self._substeps):
                pushed, held, middle = acting, None, t + 0.5 * plant.step
                walls = [(wall, wall.stands(middle, len(self.q))) for wall in self._walls]
                if self._disturbance is not None:
                    pushed = acting + self._disturbance.torque(middle, self.q, self.qd)
                    held = self._disturbance.held_joints(middle, self.q)
                    held = None if held is None else np.asarray(held, dtype=bool)
                self.q, self.qd = plant.advance(self.q, self.qd, pushed, held, walls)
                t += plant.step
        self._ticks += 1
        self._reading = self._sensors.read(*self._add_noise(), self._reading)

    def _make_plants(self, robot: Arm) -> list[Stepper]:
        """Return the steppers of an arm for the parts of a period."""
        return [self._make_plant(robot, part / self._substeps) for part in self._actuator.parts]

    def _weaken(self, tau: Array) -> Array:
        """Return torques (N, n) within what a disturbance leaves of the limits in this period."""
        middle = (self._ticks + 0.5) * self._period
        share = None if self._disturbance is None else self._disturbance.torque_factor(middle)
        if share is None or self._actuator.limits is None:
            return tau
        limits = self._actuator.limits * share
        return np.minimum(np.maximum(tau, -limits), limits)

    def _add_noise(self) -> tuple[Array, Array]:
        """Return positions and velocities (N, n) with noise, as the sensors get them."""
        return (self.q, self.qd) if self._noise is None else self._noise.add_noise(self.q, self.qd)


def split_delay(delay: float, period: float) -> tuple[int, float]:
    """Split ``delay`` into whole periods and a rest below one, ignoring rounding."""
    whole = round(delay / period)
    if abs(delay / period - whole) < 1e-9:
        return whole, 0.0
    whole = int(delay // period)
    return whole, delay - whole * period
