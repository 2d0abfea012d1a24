"""The closed loop in continuous time, for the theory: error-controlled integration, smoothed friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.integrate import LSODA

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.errors import SimulationError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.finish import Finish
from pathcontrol.simulation.modes import ContinuousTime, torque_limits
from pathcontrol.simulation.recorder import Recorder
from pathcontrol.simulation.sensors import Reading


class ClosedLoop:
    """The vector field of arm and controller; a state is (q, q̇, z), flat, one rollout after the other."""

    def __init__(self, controller: Controller, plant_robot: RobotModel, mode: ContinuousTime) -> None:
        self.controller, self.robot, self.mode = controller, plant_robot, mode
        self._limits = torque_limits(mode, plant_robot)

    def split(self, y: Array) -> tuple[Array, Array, Array]:
        """q, q̇ and z of states (…, 2n + m)."""
        n = self.robot.n
        return y[..., :n], y[..., n : 2 * n], y[..., 2 * n :]

    def control(self, t: float, y: Array) -> tuple[ControlOutput, Array]:
        """What the law says, and the torque within its limits."""
        out = self.controller.law(t, *self.split(y))
        return out, out.tau if self._limits is None else np.clip(out.tau, -self._limits, self._limits)

    def rate(self, t: float, y: Array) -> Array:
        """dy/dt of states (N, 2n + m)."""
        q, qd, _ = self.split(y)
        out, tau = self.control(t, y)
        friction = self.robot.friction.smoothed(qd, self.mode.friction_width)
        return np.concatenate([qd, self.robot.forward_dynamics(q, qd, tau - friction), out.zdot], axis=-1)


class ContinuousArm:
    """The arm as a differential equation; controllers may take it over one after the other.

    Args:
        mode: how it is integrated.
        robot: the arm.
        q: joint positions it starts at [rad], (N, n).
        qd: joint velocities it starts with [rad/s], (N, n).
    """

    def __init__(self, mode: ContinuousTime, robot: RobotModel, q: Array, qd: Array) -> None:
        torque_limits(mode, robot)
        self.q, self.qd = q, qd
        self._mode, self._robot, self._period = mode, robot, mode.output_period

    def run(self, controller: Controller, duration: float, finish: Finish | None, progress: bool) -> dict[str, Array]:
        """What was recorded, (rollout, time, …), from here until ``finish`` says so, ``duration`` [s] at most."""
        loop, recorder = ClosedLoop(controller, self._robot, self._mode), Recorder()
        start = np.concatenate([self.q, self.qd, controller.start(self.q, self.qd)], axis=-1)
        time = self._period * np.arange(max(1, round(duration / self._period)) + 1)
        with progress_bar("integrating", duration, progress) as update:
            for t, y in zip(time, _solution(loop, start, time, update), strict=False):
                self.q, self.qd, _ = loop.split(y)
                out, tau = loop.control(t, y)
                recorder.write(self.q, self.qd, Reading(self.q, self.qd), out, tau)
                if finish is not None and finish(t, out.s, self.qd):
                    break
        return recorder.arrays()


def _solution(loop: ClosedLoop, start: Array, time: Array, update: Callable[[float], None]) -> Iterator[Array]:
    """States (N, 2n + m) at each of ``time``, no further integrated than they are asked for."""

    def rate(t: float, y: Array) -> Array:
        update(t)
        return loop.rate(t, y.reshape(start.shape)).reshape(-1)

    # the integrator's norm averages over rollouts: tighten it so that each one alone keeps the tolerance
    share, band = np.sqrt(max(1, len(start))), start.shape[1] - 1
    rtol, atol = max(loop.mode.rtol / share, 1e-13), loop.mode.atol / share
    solver = LSODA(rate, 0.0, start.reshape(-1), time[-1], rtol=rtol, atol=atol, lband=band, uband=band)
    yield start
    given = 1
    while given < len(time):
        message = solver.step()
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            raise SimulationError(f"the integrator gave up at t = {solver.t:.3g} s: {message}")
        known = int(np.searchsorted(time, solver.t, side="right"))
        if known > given:
            yield from solver.dense_output()(time[given:known]).T.reshape(-1, *start.shape)
            given = known
