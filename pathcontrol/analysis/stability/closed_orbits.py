"""A lap of a law along its closed orbit, with the linear steps that small deviations take beside it.

Along a lap of period T small deviations δ from the closed orbit obey a linear equation with periodic coefficients,
δ̇ = A(t)δ, or at ticks δ⁺ = A_k δ. Laws that differ in their gains only go round together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.stability.loop_maps import ContinuousMap, TickMap
from pathcontrol.control.base import Controller
from pathcontrol.errors import InputError
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.tasks.task import PathTask

_STEP = 6e-6  # of central differences: the cube root of the precision of numbers
_ORBIT = 1e-6  # of the largest rate, by which an orbit may differ from the path
_SLOWEST = 0.05  # of ϑ, of a plan that goes round in the mean
_AWAY = 0.2  # of the extent of the path, beyond which a loop has left it
_MORE = 1.1  # laps that are recorded, for the nearest tick to the end of one
_ROUNDING = 1e-12  # of the state, which large gains magnify
_AT_ONCE = 4096  # states for which a map is asked
_CELLS, _MOST_CELLS = 1000, 8000  # of a lap in continuous time
_LONGEST = 0.5  # cell over the time of the fastest mode

# nodes, weights and matrix of Radau IIA with three stages
_ROOT = np.sqrt(6.0)
_NODES = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
_WEIGHTS = np.array([(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9])
_STAGES = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        _WEIGHTS,
    ]
)

#: the law with a row of gains for each of some rows of a grid of gains
LawOfRows = Callable[[NDArray[np.intp]], Controller]


class Lap(NamedTuple):
    """The linear steps of a lap (K, D, D), and the times of the lap and of the steps [s]."""

    steps: Array
    period: float
    duration: float


def follow_laps(
    laws: LawOfRows, rows: int, task: PathTask, loop: SampledLoop | ContinuousTime | None, settle: int
) -> list[Lap]:
    """Return a lap of the law with each of some ``rows`` of gains.

    Args:
        laws: the law by rows of gains.
        rows: number of rows.
        task: its closed path.
        loop: how the loop is closed; ``None`` for continuous time.
        settle: laps of a sampled loop before it is linearised.

    Raises:
        InputError: the path is no orbit of the law, the plan does not go round it, or the loop has no derivative.
    """
    if not isinstance(loop, SampledLoop):
        return [_follow_path(laws, row, task) for row in range(rows)]
    every = np.arange(rows)
    tick = TickMap(laws(every), loop)
    orbits = [_cut_lap(tick, task, states) for states in _follow_ticks(laws, tick, loop, rows, task, settle)]
    counts = [count for _, count in orbits]
    states = np.concatenate([each[:count] for each, count in orbits])
    steps = _differentiate(lambda rows: TickMap(laws(rows), loop), np.repeat(every, counts), states)
    ways = [_count_laps(tick, task, each)[count] for each, count in orbits]
    durations = [tick.period * count for count in counts]
    each_lap = zip(np.split(steps, np.cumsum(counts)[:-1]), durations, ways, strict=True)
    return [Lap(one, duration / way, duration) for one, duration, way in each_lap]


def _follow_path(laws: LawOfRows, row: int, task: PathTask) -> Lap:
    """Return a lap in continuous time, along the path itself, where dδ/ds = A δ/ϑ."""
    assert task.period is not None
    few = _find_slopes(laws, row, task, task.s0 + task.period * np.arange(32) / 32)
    needed = np.abs(np.linalg.eigvals(few)) * task.period / _LONGEST
    cells = int(np.clip(needed[needed < 4 * _MOST_CELLS].max(), _CELLS, _MOST_CELLS))  # others vanish in any cell
    h = task.period / cells
    s = task.s0 + (h * (np.arange(cells)[:, None] + _NODES)).ravel()
    slopes = _find_slopes(laws, row, task, s)
    lap = float(h * ((1 / task.theta(s)).reshape(cells, 3) @ _WEIGHTS).sum())
    parts = np.array_split(slopes.reshape(cells, 3, *slopes.shape[1:]), -(-cells // _CELLS))
    return Lap(np.concatenate([_take_steps(part, h) for part in parts]), lap, lap)


def _find_slopes(laws: LawOfRows, row: int, task: PathTask, s: Array) -> Array:
    """Return the matrices A/ϑ on the path at s (k,), (k, D, D)."""
    field, point = ContinuousMap(laws(np.array([row]))), task.at(s)
    x, theta = field.on_path(s), point.theta
    slopes = _differentiate(lambda rows: field, np.zeros(len(s), dtype=np.intp), x)
    wanted = np.column_stack([point.velocity, point.velocity_slope * theta[:, None], theta])
    _check_orbit(field(x), wanted, _ROUNDING * np.abs(slopes).max())
    return slopes / theta[:, None, None]


def _take_steps(slopes: Array, h: float) -> Array:
    """Return the steps (K, D, D) of linear equations over cells of width h, from slopes at three nodes (K, 3, D, D).

    Radau IIA of order 5 (Hairer and Wanner, Solving Ordinary Differential Equations II, table IV.5.6): modes that are
    faster than a cell vanish, where an explicit method would let them grow.
    """
    cells, stages, size, _ = slopes.shape
    parts = _STAGES[:, :, None, None] * h * slopes[:, None]  # how each node moves by the slope at another
    whole = parts.swapaxes(2, 3).reshape(cells, stages * size, stages * size)
    nodes = np.linalg.solve(np.eye(stages * size) - whole, np.tile(np.eye(size), (stages, 1)))
    return nodes[:, -size:]  # the last node is the end


def _check_orbit(rates: Array, wanted: Array, rounding: float) -> None:
    """Check that a law moves along its path with the arm on it: the first rates of the state (q, q̇, s) are those."""
    apart = np.abs(rates[:, : wanted.shape[1]] - wanted)
    if (apart > _ORBIT * np.abs(wanted).max() + rounding).any():
        raise InputError(
            "the path at its velocity is no orbit of the law: friction is left, or the speed is another; give a "
            "SampledLoop, of which the orbit is found"
        )


def _cut_lap(tick: TickMap, task: PathTask, states: Array) -> tuple[Array, int]:
    """Return the states of a sampled loop from the begin of a lap on, (k, D), and the ticks that come nearest to it."""
    return states, int(np.abs(_count_laps(tick, task, states) - 1).argmin())


def _count_laps(tick: TickMap, task: PathTask, states: Array) -> Array:
    """Return how many laps states (k, D) are after the first of them, (k,)."""
    assert task.period is not None
    return (tick.parameter(states) - tick.parameter(states[:1])) / task.period


def _follow_ticks(
    laws: LawOfRows, tick: TickMap, loop: SampledLoop, rows: int, task: PathTask, settle: int
) -> Iterator[Array]:
    """Yield the states of a sampled loop from the begin of a lap on, (k, D), with each row of gains.

    A loop that is unstable, so that it leaves the path before it settles, goes along the path itself.
    """
    for row, states in enumerate(_record_orbits(tick, rows, task, settle)):
        if states is None:
            s = _record_plan(task, tick.period)
            states = TickMap(laws(np.full(len(s), row)), loop).on_path(s)
        yield states


def _record_orbits(tick: TickMap, rows: int, task: PathTask, settle: int) -> list[Array | None]:
    """Return the states of a lap after those to settle, (k, D), of each row; ``None`` where it leaves its path."""
    assert task.period is not None
    start = tick.on_path(np.full(rows, task.s0))
    extent = np.ptp(task.q_d(np.linspace(*task.sampled_interval, 65)), axis=0).max()
    x, laps, recorded, ticks = start, np.zeros(rows), [], 0
    lost, begin = np.zeros(rows, dtype=bool), np.zeros(rows, dtype=np.intp)
    most = (settle + _MORE) * _plan_ticks(task, tick.period) / _SLOWEST
    while (~lost & (laps < settle + _MORE)).any():
        begin += laps < settle
        recorded += [x] if (laps >= settle).any() else []
        with np.errstate(all="ignore"):  # of a loop that diverges, until it is seen
            x, ticks = tick(x), ticks + 1
            away = np.abs(tick.position(x) - task.q_d(tick.parameter(x))).max(-1)
        if ticks > most:
            raise InputError("the plan does not go round its path, so it has no laps; is it held?")
        lost |= ~(away < _AWAY * extent)
        x = np.where(lost[:, None], start, x)
        laps = (tick.parameter(x) - tick.parameter(start)) / task.period
    before, states = ticks - len(recorded), np.array(recorded)
    return [None if lost[row] else states[begin[row] - before :, row] for row in range(rows)]


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


def _differentiate(
    field_of: Callable[[NDArray[np.intp]], ContinuousMap | TickMap], rows: NDArray[np.intp], x: Array
) -> Array:
    """Return the Jacobians (k, D, D) of a map by its ``rows`` of gains (k,) at x (k, D), by central differences."""
    count, size = x.shape
    steps = _STEP * np.maximum(1.0, np.abs(x).max(0)) * np.eye(size)
    columns = []
    for some in np.array_split(steps, min(size, -(-2 * count * size // _AT_ONCE))):  # each call of a map takes a while
        ends = np.concatenate([x + d for step in some for d in (step, -step)])
        after = field_of(np.tile(rows, 2 * len(some)))(ends).reshape(-1, 2, count, size)
        columns += [(high - low) / (2 * step.max()) for (high, low), step in zip(after, some, strict=True)]
    return np.stack(columns, axis=-1)


def pad_steps(laps: Sequence[Lap]) -> Array:
    """Return the steps of laps as one array (N, K, D, D), shorter ones with steps that change nothing at their end."""
    most, size = max(len(lap.steps) for lap in laps), laps[0].steps.shape[-1]
    padded = np.tile(np.eye(size), (len(laps), most, 1, 1))
    for row, lap in zip(padded, laps, strict=True):
        row[: len(lap.steps)] = lap.steps
    return padded
