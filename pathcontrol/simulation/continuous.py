"""The closed loop in continuous time, for the theory: error-controlled integration, smoothed friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._progress import progress_bar
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.simulation.arm.disturbance import Disturbance, jump_times
from pathcontrol.simulation.arm.sensors import Reading
from pathcontrol.simulation.divergence import CRAWLED, NO_NUMBERS, STOPPED, Divergence, is_bounded
from pathcontrol.simulation.finish import Finish
from pathcontrol.simulation.loops import Arm, ContinuousTime, Outside, check_rows, torque_limits
from pathcontrol.simulation.recorder import Recorder
from pathcontrol.simulation.seam import Left, start_next

if TYPE_CHECKING:
    from scipy.integrate import LSODA

_WATCHED = 2000  # steps of the integrator over which its progress is measured
_SHORTEST = 1e-6  # s, the mean step of so many below which a run is given up: a second of it would take minutes
_MOST_WORK = 400_000  # evaluations of the closed loop that a simulated second may take, half a minute or more


class ClosedLoop:
    """The vector field of arm and controller; a state is (q, q̇, z), flat, one rollout after the other."""

    def __init__(
        self, controller: Controller, plant_robot: Arm, mode: ContinuousTime, push: _SteadyDisturbance | None = None
    ) -> None:
        self._push = push
        self.controller, self.robot, self.mode = controller, plant_robot, mode
        self._limits = torque_limits(mode, plant_robot)

    def split(self, y: Array) -> tuple[Array, Array, Array]:
        """Return q, q̇ and z of states (…, 2n + m)."""
        n = self.robot.n
        return y[..., :n], y[..., n : 2 * n], y[..., 2 * n :]

    def control(self, t: float, y: Array) -> tuple[ControlOutput, Array]:
        """Return the output of the law, and the torque within its limits."""
        out = self.controller.law(t, *self.split(y))
        return out, out.tau if self._limits is None else np.clip(out.tau, -self._limits, self._limits)

    def absolute_tolerance(self, y: Array) -> Array:
        """Return the absolute tolerance of each number of states, (N, 2n + m), which begin at y.

        The memory of an observer is torques, r₁ − Kp of a size that makes an error of ``rtol`` of it larger by orders
        than ``atol``; to follow that error with the smaller tolerance of r would take a hundred times the steps. So
        both are kept to ``rtol`` of K diag M at 1 rad/s, which is an acceleration of K ``rtol``.
        """
        tolerance = np.full(y.shape, self.mode.atol)
        if (observer := self.controller.observer) is not None:
            n, mass = self.robot.n, observer.robot.mass_matrix(self.split(y)[0])
            torque = np.maximum(self.mode.rtol * observer.gain * np.diagonal(mass, axis1=-2, axis2=-1), self.mode.atol)
            tolerance[..., 2 * n + 1 : 4 * n + 1] = np.concatenate([torque, torque], axis=-1)
        return tolerance

    def rate(self, t: float, y: Array) -> Array:
        """Return dy/dt of states (N, 2n + m)."""
        q, qd, _ = self.split(y)
        out, tau = self.control(t, y)
        zdot = self.controller.rate(out._replace(tau=tau))
        friction = self.robot.friction.smoothed(qd, self.mode.friction_width)
        if self._push is not None:
            tau = tau + self._push(t, q, qd)
        return np.concatenate([qd, self.robot.forward_dynamics(q, qd, tau - friction), zdot], axis=-1)


class ContinuousArm:
    """The arm as a differential equation; controllers may take it over one after the other.

    Args:
        mode: settings of the integrator.
        robot: the arm, or one for each rollout.
        q: joint positions it starts at [rad], (N, n).
        qd: joint velocities it starts with [rad/s], (N, n).
        outside: its disturbance.

    Attributes:
        divergence: which rollouts have diverged, at the time since the present controller took over.
        law_outcome: what the last controller has to say of each rollout, see :meth:`Controller.outcome`.
    """

    def __init__(self, mode: ContinuousTime, robot: Arm, q: Array, qd: Array, outside: Outside) -> None:
        check_rows(torque_limits(mode, robot), "torque_limits", len(q))
        self.q, self.qd = q, qd
        self._mode, self._robot, self._period = mode, robot, mode.output_period
        self._disturbance, self._began = outside.disturbance, 0.0
        self._left: Left | None = None
        self.law_outcome: dict[str, Array] = {}
        self.divergence = Divergence(q, qd)

    def run(
        self, controller: Controller, duration: float, finish: Finish | None, progress: bool, z: Array | None = None
    ) -> dict[str, Array]:
        """Return the record, (rollout, time, …), from here until ``finish`` ends it, ``duration`` [s] at most.

        ``z`` is the state that the law starts with, where that is known already.
        """
        push = None if self._disturbance is None else _SteadyDisturbance(self._disturbance, self._began)
        time = self._period * np.arange(max(1, round(duration / self._period)) + 1)
        loop = ClosedLoop(controller, self._robot, self._mode, push)
        recorder = Recorder(len(self.q), self._robot.n, len(time))
        lost = self.divergence = Divergence(self.q, self.qd)
        z = start_next(controller, self.q, self.qd, self._left) if z is None else z
        start = np.concatenate([self.q, self.qd, z], axis=-1)
        with progress_bar("integrating", duration, progress) as update:
            for t, y in zip(time, _Solution(loop, start, lost, push).at(time, update), strict=False):
                self.q, self.qd, z = loop.split(y)
                out, tau = loop.control(t, y)
                recorder.write(self.q, self.qd, Reading(self.q, self.qd), out, tau)
                lost.check_torque(t, out.tau)
                if lost.all or (finish is not None and finish(t, out.s, self.qd, lost.lost)):
                    break
        arrays = recorder.arrays()
        lost.erase(arrays, time)
        self._began, self._left = self._began + t, Left(controller, z, float(t))
        self.law_outcome = controller.outcome(z)
        return arrays


class _SteadyDisturbance:
    """A disturbance in the time since a controller took over; up to a jump it keeps its value from before it."""

    def __init__(self, disturbance: Disturbance, began: float) -> None:
        self._disturbance, self._began, self._before = disturbance, began, np.inf

    def __call__(self, t: float, q: Array, qd: Array) -> Array:
        return self._disturbance.torque(self._began + min(t, self._before), q, qd)

    def until_next_jump(self, t: float, end: float) -> float:
        """Return the time of the next jump after t [s], or ``end``; until then the value before the jump counts."""
        after = jump_times(self._disturbance) - self._began
        after = after[(after > t) & (after < end)]
        self._before = float(np.nextafter(after.min(), -np.inf)) if after.size else np.inf
        return float(after.min()) if after.size else end


class _Solution:
    """The states of a batch over time; diverged rollouts are taken out, and the others continue from there.

    Args:
        loop: the vector field.
        start: the state it starts from, (N, 2n + m).
        lost: which rollouts have diverged.
        push: its disturbance.
    """

    def __init__(self, loop: ClosedLoop, start: Array, lost: Divergence, push: _SteadyDisturbance | None) -> None:
        self._push = push
        self._loop, self._start, self._lost = loop, start, lost
        self._steps, self._since = 0, 0.0  # when the present count of steps began
        self._work, self._second = 0, 0.0  # evaluations, and the begin of the second in which they are counted
        self._odd = lost.lost  # rows whose rate was not finite in the last step
        # the integrator's norm averages over rollouts: tighten it so that each one alone keeps the tolerance
        share, band = np.sqrt(max(1, len(start))), start.shape[1] - 1
        rtol, atol = max(loop.mode.rtol / share, 1e-13), loop.absolute_tolerance(start).reshape(-1) / share
        self._settings = {"rtol": rtol, "atol": atol, "lband": band, "uband": band}

    def at(self, time: Array, update: Callable[[float], None]) -> Iterator[Array]:
        """Yield states (N, 2n + m) at each of ``time``; integrate no further than they are requested."""
        from scipy.integrate import LSODA  # sampled loops do not need it

        t, y, given = 0.0, self._start, 1
        yield self._start
        while given < len(time) and not self._lost.all:
            end = time[-1] if self._push is None else self._push.until_next_jump(t, time[-1])
            solver = LSODA(lambda t, y: self._rate(t, y, update), t, y.reshape(-1), end, **self._settings)
            while given < len(time) and solver.status == "running":
                t, y, self._odd = solver.t, solver.y.copy(), self._lost.lost
                solver.step()
                crawls = self._is_crawling(solver.t)
                if crawls or self._has_failed(solver):
                    self._work = 0  # the others have a budget of their own
                    self._remove_culprits(t, solver.y, y, CRAWLED if crawls else STOPPED)
                    y = self._lost.replace_lost(y.reshape(self._start.shape), self._start)
                    break
                known = int(np.searchsorted(time, solver.t, side="right"))
                if known > given:
                    yield from solver.dense_output()(time[given:known]).T.reshape(-1, *self._start.shape)
                    given = known
                t, y = solver.t, solver.y

    def _rate(self, t: float, y: Array, update: Callable[[float], None]) -> Array:
        """Return the flat rate of all rollouts, 0 for lost ones."""
        update(t)
        self._work += 1
        rate = self._loop.rate(t, y.reshape(self._start.shape))
        if not np.isfinite(np.vdot(rate, rate)):
            self._odd = self._odd | ~np.isfinite(rate).all(-1)
        return (self._lost.replace_lost(rate, 0.0) if self._lost.any else rate).reshape(-1)

    def _is_crawling(self, t: float) -> bool:
        """Return whether the last steps, up to t [s], made hardly any progress for the work done."""
        if self._work > _MOST_WORK:
            return True
        if t - self._second >= 1.0:
            self._work, self._second = 0, t
        self._steps += 1
        if self._steps < _WATCHED:
            return False
        crawls = t - self._since < _WATCHED * _SHORTEST
        self._steps, self._since = 0, t
        return crawls

    def _has_failed(self, solver: LSODA) -> bool:
        """Return whether the integrator failed or a state left all bounds."""
        return solver.status == "failed" or not np.isfinite(solver.t) or bool(self._find_unbounded(solver.y).any())

    def _find_unbounded(self, y: Array) -> NDArray[np.bool_]:
        """Return the rows whose state is lost, (N,)."""
        q, qd, z = self._loop.split(y.reshape(self._start.shape))
        return ~(is_bounded(q, qd) & np.isfinite(z).all(-1))

    def _remove_culprits(self, t: float, reached: Array, y: Array, reason: str) -> None:
        """Mark the rollouts that kept the integrator from getting from y at t [s] to a possible state.

        ``reason`` is given to a rollout whose only fault is its speed.
        """
        odd, beyond = self._odd & ~self._lost.lost, self._find_unbounded(reached) & ~self._lost.lost
        if odd.any():
            self._lost.mark(t, odd, NO_NUMBERS)
        elif beyond.any():
            self._lost.mark(t, beyond)
        else:
            fastest = np.abs(self._loop.rate(t, y.reshape(self._start.shape))).max(-1)
            blamed = np.argmax(np.where(self._lost.lost, -np.inf, fastest))
            self._lost.mark(t, np.arange(len(fastest)) == blamed, reason)
