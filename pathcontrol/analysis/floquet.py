"""Floquet multipliers of a law on a closed path: how fast what is beside the path comes back to it.

Along a lap of period T small deviations δ from the closed orbit obey a linear equation with periodic coefficients,
δ̇ = A(t)δ, or at ticks δ⁺ = A_k δ. Its matrix over a lap, the monodromy matrix, has the multipliers μ as eigenvalues and
the modes as eigenvectors; λ = ln(μ)/T are exponents [1/s]. One multiplier is 1: a shift along the orbit neither grows
nor decays. The orbit is stable where all others are inside the unit circle (Floquet 1883).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array, check_whole
from pathcontrol._expect import expect
from pathcontrol.analysis.loop_maps import ContinuousMap, TickMap
from pathcontrol.analysis.product_eigen import find_eigen
from pathcontrol.control.base import Controller
from pathcontrol.errors import InputError
from pathcontrol.robot.friction import levels_of
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.simulation.run_arguments import check_controller
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.tasks.task import PathTask

_STEP = 6e-6  # of central differences: the cube root of the precision of numbers
_ORBIT = 1e-6  # of the largest rate, by which an orbit may differ from the path
_SLOWEST = 0.05  # of ϑ, of a plan that goes round in the mean
_AWAY = 0.2  # of the extent of the path, beyond which a loop has left it
_MORE = 1.1  # laps that are recorded, for the nearest tick to the end of one


@dataclass(frozen=True, eq=False)
class Floquet:
    """The stability of a closed orbit; the state has D components: q, q̇, that of the law, and that of the loop.

    Attributes:
        period: time of a lap T [s].
        multipliers: eigenvalues of the monodromy matrix, the largest first, complex (D,).
        exponents: λ = ln(μ)/T [1/s], complex (D,); the imaginary part is known up to multiples of 2π/T.
        modes: their eigenvectors at the beginning of the lap, columns, complex (D, D).
        along: index of the multiplier 1 of a shift along the orbit.
    """

    period: float
    multipliers: Array
    exponents: Array
    modes: Array
    along: int

    @property
    def transverse(self) -> Array:
        """The exponents but that along the orbit, slowest first, (D − 1,)."""
        return np.delete(self.exponents, self.along)

    @property
    def stable(self) -> bool:
        """Whether all deviations decay, but a shift along the orbit."""
        return bool((self.transverse.real < 0).all())

    @property
    def decay_rate(self) -> float:
        """The rate [1/s] at which the slowest deviation from the orbit decays; negative where it grows."""
        return float(-self.transverse.real.max())


class _Lap(NamedTuple):
    """The linear steps of a lap (K, D, D), the direction of the orbit, times of the lap and of the steps [s]."""

    steps: Array
    direction: Array
    period: float
    duration: float


def floquet(law: Controller, loop: SampledLoop | ContinuousTime | None = None, settle: int = 3) -> Floquet:
    """Return the Floquet multipliers of a law on its closed path.

    In continuous time, the default, the orbit is the path at its velocity, which asks for friction that the law
    compensates exactly. In a sampled loop the orbit is that of the loop as it is simulated, with its hold, velocities
    by differences, filter and delay, after some laps to settle. Ticks seldom fit into a lap: the lap ends at the
    nearest one, and exponents are those per time of these ticks.

    Args:
        law: the law, with one closed path and one set of gains; its own model is the arm.
        loop: how the loop is closed; without encoders, noise and limits, which have no derivative.
        settle: laps of a sampled loop before it is linearised.

    Raises:
        InputError: the path is not closed or is no orbit of the law, the plan does not go round it, there is dry
            friction, or the loop has no derivative.
    """
    check_controller("law", law)
    settle, task = check_whole("settle", settle, 1), _check_path(law)
    if loop is None or isinstance(loop, ContinuousTime):
        return _solve(_follow_path(ContinuousMap(law), task))
    expect("loop", loop, SampledLoop)
    return _solve(_follow_loop(TickMap(law, loop), task, settle))


def _check_path(law: Controller) -> PathTask:
    """Return the closed path of a law with one set of gains, whose arm has no dry friction."""
    task, arm = law.task, law.robot
    if isinstance(task, TaskBatch) or task.period is None:
        raise InputError(f"{type(task).__name__} is no single closed path, and multipliers are those of its laps")
    if several := [name for name in law.gains if np.size(getattr(law, name)) > arm.n]:
        raise InputError(f"{several[0]} has the gains of several rollouts, expected those of one, ({arm.n},)")
    if any(np.any(level) for level in levels_of(arm.friction, np.zeros(arm.n))):
        raise InputError(
            "the arm has dry friction, which has no derivative; give the law the arm with Viscous friction only"
        )
    return task


def _follow_path(field: ContinuousMap, task: PathTask) -> _Lap:
    """Return a lap in continuous time, along the path itself.

    dδ/ds = A δ/ϑ is integrated over s by the classical Runge–Kutta method.
    """
    assert task.period is not None
    cells = 2000
    s = task.s0 + task.period * np.arange(2 * cells + 1) / (2 * cells)
    x, point = field.on_path(s), task.at(s)
    theta = point.theta
    _check_orbit(field(x), np.column_stack([point.velocity, point.velocity_slope * theta[:, None], theta]))
    slopes = _differentiate(field, x) / theta[:, None, None]
    h, one = task.period / cells, np.eye(x.shape[1])
    first, middle, last = slopes[:-2:2], slopes[1::2], slopes[2::2]
    k2 = middle @ (one + 0.5 * h * first)
    k3 = middle @ (one + 0.5 * h * k2)
    steps = one + h / 6 * (first + 2 * k2 + 2 * k3 + last @ (one + h * k3))
    time = 1 / theta
    lap = float(h / 6 * (time[:-2:2] + 4 * time[1::2] + time[2::2]).sum())
    return _Lap(steps, field(x[:1])[0], lap, lap)


def _check_orbit(rates: Array, wanted: Array) -> None:
    """Check that a law moves along its path with the arm on it: the first rates of the state (q, q̇, s) are those."""
    apart = np.abs(rates[:, : wanted.shape[1]] - wanted)
    if (apart > _ORBIT * np.abs(wanted).max()).any():
        raise InputError(
            "the path at its velocity is no orbit of the law: friction is left, or the speed is another; give a "
            "SampledLoop, of which the orbit is found"
        )


def _follow_loop(tick: TickMap, task: PathTask, settle: int) -> _Lap:
    """Return a lap of a sampled loop, to the nearest whole number of ticks.

    Where the loop is unstable, so that it leaves the path before it settles, it is along the path itself.
    """
    assert task.period is not None
    states = _record_orbit(tick, task, settle)
    if states is None:
        states = tick.on_path(_record_plan(task, tick.period))
    way = (tick.parameter(states) - tick.parameter(states[:1])) / task.period
    count = int(np.abs(way - 1).argmin())
    duration = tick.period * count
    return _Lap(_differentiate(tick, states[:count]), states[1] - states[0], duration / way[count], duration)


def _record_orbit(tick: TickMap, task: PathTask, settle: int) -> Array | None:
    """Return the states of a lap after those to settle, (k, D); ``None`` where the loop leaves its path."""
    assert task.period is not None
    x, states = tick.on_path(np.array([task.s0])), []
    begin = float(tick.parameter(x)[0])
    extent = np.ptp(task.q_d(np.linspace(*task.sampled_interval, 65)), axis=0).max()
    laps, wanted, ticks = 0.0, settle + _MORE, 0
    most = wanted * _plan_ticks(task, tick.period) / _SLOWEST
    while laps < wanted:
        if laps >= settle:
            states.append(x[0])
        x, ticks = tick(x), ticks + 1
        if ticks > most:
            raise InputError("the plan does not go round its path, so it has no laps; is it held?")
        laps = (float(tick.parameter(x)[0]) - begin) / task.period
        away = np.abs(tick.position(x) - task.q_d(tick.parameter(x))).max()
        if not away < _AWAY * extent:
            return None
    return np.array(states)


def _plan_ticks(task: PathTask, period: float) -> float:
    """Return how many ticks a plan at ϑ takes for a lap."""
    assert task.period is not None
    s = task.s0 + task.period * np.arange(256) / 256
    return float(task.period * np.mean(1 / task.theta(s)) / period)


def _record_plan(task: PathTask, period: float) -> Array:
    """Return the parameters of a lap at ticks of a plan that goes at ϑ, (k,), by the midpoint rule."""
    assert task.period is not None
    s = [float(task.s0)]
    while s[-1] < task.s0 + _MORE * task.period:
        middle = s[-1] + 0.5 * period * float(task.theta(np.array(s[-1])))
        s.append(s[-1] + period * float(task.theta(np.array(middle))))
    return np.array(s)


def _differentiate(field: ContinuousMap | TickMap, x: Array) -> Array:
    """Return the Jacobians (k, D, D) of a map at x (k, D), by central differences."""
    size = x.shape[1]
    steps = _STEP * np.maximum(1.0, np.abs(x).max(0)) * np.eye(size)
    columns = [(field(x + d) - field(x - d)) / (2 * d[i]) for i, d in enumerate(steps)]
    return np.stack(columns, axis=-1)


def _solve(lap: _Lap) -> Floquet:
    """Return the multipliers of a lap."""
    found = find_eigen(lap.steps)
    multipliers = np.exp(found.logarithms * lap.period / lap.duration)
    exponents = found.logarithms / lap.duration
    share = np.abs(lap.direction @ found.vectors.conj()) / np.linalg.norm(lap.direction)
    near = np.abs(exponents.real) < 0.02 * np.abs(exponents.real).max()
    along = int(np.where(near, share, share - 2).argmax())
    return Floquet(lap.period, multipliers, exponents, found.vectors, along)
