"""The closed loop in continuous time, for the theory: error-controlled integration, smoothed friction."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.errors import SimulationError
from pathcontrol.robot.model import RobotModel
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


def run_continuous(
    controller: Controller,
    plant_robot: RobotModel,
    mode: ContinuousTime,
    q: Array,
    qd: Array,
    duration: float,
    progress: bool,
) -> tuple[Array, dict[str, Array]]:
    """Times (T,) and arrays (rollout, T, …) of the continuous closed loop from (q, q̇), both (N, n)."""
    loop = ClosedLoop(controller, plant_robot, mode)
    start = np.concatenate([q, qd, controller.start(q, qd)], axis=-1)
    time = mode.output_period * np.arange(max(1, round(duration / mode.output_period)) + 1)
    with progress_bar("integrating", duration, progress) as update:

        def rate(t: float, y: Array) -> Array:
            update(t)
            return loop.rate(t, y.reshape(start.shape)).reshape(-1)

        # the integrator's norm averages over rollouts: tighten it so that each one alone keeps the tolerance
        share, band = np.sqrt(max(1, len(start))), start.shape[1] - 1
        solution = solve_ivp(
            rate,
            (0.0, time[-1]),
            start.reshape(-1),
            method="LSODA",
            t_eval=time,
            rtol=max(mode.rtol / share, 1e-13),
            atol=mode.atol / share,
            lband=band,
            uband=band,
        )
    if not solution.success or not np.isfinite(solution.y).all():
        raise SimulationError(f"the integrator gave up at t = {solution.t[-1]:.3g} s: {solution.message}")
    return time, _recorded(loop, time, solution.y.T.reshape(len(time), *start.shape))


def _recorded(loop: ClosedLoop, time: Array, states: Array) -> dict[str, Array]:
    """What a run holds, from the states (time, rollout, 2n + m)."""
    recorder = Recorder(len(time))
    for tick, (t, y) in enumerate(zip(time, states, strict=True)):
        q, qd, _ = loop.split(y)
        out, tau = loop.control(t, y)
        recorder.write(tick, q, qd, Reading(q, qd), out, tau)
    return recorder.arrays()
