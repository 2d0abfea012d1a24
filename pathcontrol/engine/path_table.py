"""A task as a table of quintic pieces of q_d(s) and ϑ(s), the only form of path that the compiled engine takes."""

from __future__ import annotations

from ctypes import addressof
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, norms
from pathcontrol._identity import IdentityCache
from pathcontrol.control.ending import Ending, arrival_parameter
from pathcontrol.engine.library import load_library
from pathcontrol.engine.structs import Memory, Path, address_of
from pathcontrol.errors import EngineError
from pathcontrol.geometry import hermite
from pathcontrol.geometry.hermite import horner
from pathcontrol.geometry.periodic import wrap
from pathcontrol.tasks.recorded import sample_path
from pathcontrol.tasks.task import PathTask

_NODES = 0.5 - 0.5 * np.cos(np.pi * (2 * np.arange(6) + 1) / 12)  # places in a cell at which ϑ is interpolated
_PROBES = np.array([0.15, 0.5, 0.85])  # places in a cell at which table and task are compared
# allowed differences, as shares of the extent of q_d or the largest ϑ, and of the largest slopes
_VALUE, _SLOPE = 1e-11, 1e-9
# the same for ϑ and ϑ' where cells are halved; they are tighter, as ϑ acts on the arm at once
_RATE, _RATE_SLOPE = 1e-13, 1e-11
_ROUNDING = 64 * np.finfo(np.float64).eps
_HALVINGS, _MOST_CELLS = 40, 1 << 16
_NARROWEST = 64 * np.finfo(np.float64).eps  # width of a cell as a share of s
_DEGREE = 5
_PLACES = np.modf((5**0.5 - 1) / 2 * np.arange(1, 65))[0]  # places in the domain, as shares, evenly spread


class PathTable(NamedTuple):
    """Quintic pieces of a path between increasing ``knots`` (K + 1,).

    Attributes:
        knots: parameters at which the pieces meet; the last one is s_end, or s0 + period.
        coefficients: (K, 6, n + 1): powers of s − knot from the fifth down, of the n joints and of ϑ.
        closed: whether the path repeats.
        ending: how the plan of an open path comes to rest, else ``None``.
        arrival: the s from which on an arm has arrived at the end of an open path; ∞ for a closed one.
        width: the median width of a piece.
    """

    knots: Array
    coefficients: Array
    closed: bool
    ending: Ending | None
    arrival: float
    width: float

    def struct(self, memory: Memory) -> Path:
        """Return the table for the engine; its arrays live as long as ``memory``."""
        cells, columns = len(self.knots) - 1, self.coefficients.shape[-1]
        s0, s_end = self.knots[0], self.knots[-1]
        starts = np.linspace(s0, s_end, 2 * cells, endpoint=False)
        bucket = np.clip(np.searchsorted(self.knots, starts, side="right") - 1, 0, cells - 1)
        centre, radius = _balls(self.knots, self.coefficients[..., :-1])
        path = Path(joints=columns - 1, cells=cells, buckets=2 * cells, closed=self.closed, brakes=not self.closed)
        path.s0, path.s_end, path.period, path.arrival = s0, s_end, s_end - s0, self.arrival
        path.buckets_per_s = 2 * cells / (s_end - s0)
        if self.ending is not None:
            path.braking, path.begin = self.ending.braking, self.ending.begin
            path.braking_back, path.begin_back = self.ending.braking_back, self.ending.begin_back
        path.knots, path.bucket = memory.address(self.knots), memory.address(bucket, np.int32)
        path.coefficients = memory.address(self.coefficients)
        path.centre, path.radius = memory.address(centre), memory.address(radius)
        return path

    def evaluate(self, s: Array) -> tuple[Array, Array]:
        """Return values and slopes (2 of (m, n + 1)) at s (m,) inside the domain: q_d, and ϑ last."""
        cell = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, len(self.knots) - 2)
        return horner(np.moveaxis(self.coefficients[cell], 1, 0), (s - self.knots[cell])[:, None])


_TABLES: IdentityCache[PathTask, tuple[PathTable, Path, Memory]] = IdentityCache()


def path_struct(task: PathTask) -> tuple[Path, Memory]:
    """Return the table of ``task`` as struct of the engine, with the memory that keeps its arrays alive.

    Raises:
        EngineError: the path goes on for ever without repeating, or is not smooth enough for a table.
    """
    return task_table(task)[1:]


def task_table(task: PathTask) -> tuple[PathTable, Path, Memory]:
    """Return the table of ``task`` and its struct; it is made once, and checked again, as tasks may change.

    Raises:
        EngineError: the path goes on for ever without repeating, or is not smooth enough for a table.
    """
    known = _TABLES.get(task)
    if known is None or not _agrees(known[0], task):
        table, memory = make_table(task), Memory()
        known = _TABLES.keep(task, (table, table.struct(memory), memory))
    return known


def make_table(task: PathTask) -> PathTable:
    """Return quintic pieces that are within 1e-11 of the extent of q_d and of the largest ϑ.

    Raises:
        EngineError: the path goes on for ever without repeating, or is not smooth enough for a table.
    """
    name = type(task).__name__
    if not task.closed and not np.isfinite(task.s_end):
        raise EngineError(
            f"{name} neither ends nor repeats, so it has no table; give it an s_end or a period", value=name
        )
    try:
        sampled, jets = sample_path(task)
    except Exception as error:  # code of the user, which need not answer everywhere
        raise EngineError(f"{name} cannot be tabulated: {error}", value=name) from error
    knots, rate = _refine(task, _add_corners(task, sampled if task.knots is not None else _halve(sampled)))
    if not np.array_equal(knots, sampled):
        jets = _jets(task, knots)
    coefficients = np.concatenate([hermite.coefficients(knots, jets), rate[..., None]], axis=-1)
    ending = Ending.of(task)
    arrival = np.inf if task.closed else arrival_parameter(task)
    table = PathTable(knots, np.moveaxis(coefficients, 0, 1), task.closed, ending, arrival, _median(np.diff(knots)))
    if not _agrees(table, task):
        raise EngineError(
            f"{name} is not smooth enough for a table of quintics: q_d must have two derivatives that fit", value=name
        )
    return table


def has_same_projection(task: PathTask, path: Path) -> bool:
    """Check that σ̄ of a task whose class defines it is the nearest point of the task's table, close to the path."""
    if type(task).sigma_bar is PathTask.sigma_bar:
        return True
    s = path.s0 + (path.s_end - path.s0) * np.array([0.13, 0.38, 0.61, 0.87])
    q_d, aside = task.q_d(s), np.roll(task.dq_d(s), 1, axis=-1)
    aside /= np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), 1e-12)
    q = np.ascontiguousarray(q_d + 1e-2 * np.ptp(q_d) * aside)  # beside the path, at a hundredth of its size
    found = np.empty(len(s))
    load_library().pathcontrol_nearest(addressof(path), len(s), *map(address_of, (q, s, found)))
    return bool(np.allclose(task.sigma_bar(q, near=s), found, rtol=0, atol=1e-7 * (path.s_end - path.s0)))


def _jets(task: PathTask, s: Array) -> Array:
    """Return q_d, q_d' and q_d'' at s (m,), (3, m, n)."""
    return np.stack([task.q_d(s), task.dq_d(s), task.ddq_d(s)])


def _median(values: Array) -> float:
    """Return the median; ``np.median`` takes many times as long."""
    ordered, half = np.sort(values), len(values) // 2
    return float(0.5 * (ordered[half] + ordered[-1 - half]))


def _theta(task: PathTask, s: Array) -> tuple[Array, Array]:
    """Return ϑ and ϑ' at s, each of the shape of s."""
    zero = np.zeros_like(s)
    return task.theta(s) + zero, task.dtheta(s) + zero


def _rate_pieces(task: PathTask, left: Array, right: Array) -> Array:
    """Return quintics (6, K) that interpolate ϑ at the Chebyshev nodes of the cells [left, right], (K,) each."""
    width = right - left
    s = left + _NODES[:, None] * width
    theta = np.broadcast_to(task.theta(s.reshape(-1)), s.size).reshape(s.shape)
    powers = np.arange(_DEGREE, -1, -1)
    return np.linalg.solve(_NODES[:, None] ** powers, theta) / width ** powers[:, None]


def _add_corners(task: PathTask, knots: Array) -> Array:
    """Add the knots of the profile, where ϑ' may jump, in the first lap of a closed path."""
    if task.profile_knots is None:
        return knots
    lower, upper = knots[0], knots[-1]
    corners = np.asarray(task.profile_knots, dtype=np.float64)
    if task.period is not None:
        corners = wrap(corners, lower, task.period)
    every = np.union1d(knots, corners[(corners > lower) & (corners < upper)])
    apart = np.diff(every) > 1e-12 * (upper - lower)
    return np.append(every[:-1][apart], upper)


def _halve(knots: Array) -> Array:
    """Add a knot in the middle of each cell: q_d'' of a smooth path is then 16 times closer."""
    return np.sort(np.concatenate([knots, 0.5 * (knots[1:] + knots[:-1])]))


def _refine(task: PathTask, knots: Array) -> tuple[Array, Array]:
    """Halve cells until quintics follow ϑ in them, within shares of the largest ϑ and |ϑ'|.

    Return the knots and the quintics (6, K), each of which is made once.
    """
    theta, slope = _theta(task, 0.5 * (knots[1:] + knots[:-1]))
    largest = np.abs(theta).max()
    scale = largest, max(np.abs(slope).max(), largest / (knots[-1] - knots[0]))
    pieces, most = _rate_pieces(task, knots[:-1], knots[1:]), len(knots) + _MOST_CELLS
    coarse = _find_coarse(task, knots[:-1], knots[1:], pieces, *scale)
    for _ in range(_HALVINGS):
        if not coarse.size or len(knots) + len(coarse) > most:
            break
        knots = np.insert(knots, coarse + 1, 0.5 * (knots[coarse] + knots[coarse + 1]))
        halves = coarse + np.arange(len(coarse))
        halves = np.sort(np.concatenate([halves, halves + 1]))
        left, right = knots[halves], knots[halves + 1]
        pieces = np.insert(pieces, coarse, 0.0, axis=1)
        pieces[:, halves] = made = _rate_pieces(task, left, right)
        coarse = halves[_find_coarse(task, left, right, made, *scale)]
    return knots, pieces


def _find_coarse(
    task: PathTask, left: Array, right: Array, pieces: Array, largest: float, steepest: float
) -> NDArray[np.intp]:
    """Return the indices of the cells [left, right], (k,) each, in which ϑ and its quintic (6, k) differ too much."""
    x = _PROBES[:, None] * (right - left)
    theta, slope = (part.reshape(x.shape) for part in _theta(task, (left + x).reshape(-1)))
    value, rise = horner(pieces[:, None], x)
    local = np.abs(slope).max(0, initial=0.0)
    # the tolerance cannot be less than the change of ϑ over the rounding of s, nor than numbers have digits
    rounding = _ROUNDING * (largest + local * np.abs(right)) + np.finfo(np.float64).tiny
    apart = np.abs(value - theta).max(0, initial=0.0) > _RATE * largest + rounding
    bent = np.abs(rise - slope).max(0, initial=0.0) > _RATE_SLOPE * (steepest + local) + 8 * rounding / (right - left)
    wide = right - left > _NARROWEST * np.maximum(np.abs(left), np.abs(right))  # s has no more digits to halve
    return np.flatnonzero((apart | bent) & wide)


def _agrees(table: PathTable, task: PathTask) -> bool:
    """Return whether table and task agree at places spread over the domain."""
    domain = (task.s0, task.s_end if task.period is None else task.s0 + task.period)
    if (table.knots[0], table.knots[-1], table.closed) != (*domain, task.closed):
        return False
    s = domain[0] + (domain[1] - domain[0]) * _PLACES
    found, expected = table.evaluate(s), _evaluate_task(task, s)
    if found[0].shape != expected[0].shape:
        return False
    extent, steepest = np.ptp(expected[0], axis=0), np.abs(expected[1]).max(0)
    extent[:-1], steepest[:-1] = extent[:-1].max(), steepest[:-1].max()
    extent[-1] = expected[0][:, -1].max()
    steepest[-1] = max(steepest[-1], extent[-1] / (domain[1] - domain[0]))  # smaller ϑ' do not count
    rounding = _ROUNDING * np.abs(expected[0]).max()
    close = np.abs(found[0] - expected[0]) <= 2 * _VALUE * extent + rounding
    along = np.abs(found[1] - expected[1]) <= 4 * _SLOPE * steepest + rounding / table.width + 1e-12
    return bool(close.all() and along.all())


def _evaluate_task(task: PathTask, s: Array) -> tuple[Array, Array]:
    """Return values and slopes (m, n + 1) of q_d, and of ϑ in the last column, at s (m,)."""
    theta, dtheta = _theta(task, s)
    return np.column_stack([task.q_d(s), theta]), np.column_stack([task.dq_d(s), dtheta])


def bezier_points(knots: Array, coefficients: Array) -> Array:
    """Return the Bézier points of polynomials of s − knot, both (K, d + 1, n): their hull encloses the curve."""
    width, degree = np.diff(knots), coefficients.shape[1] - 1
    powers = range(degree + 1)
    weights = np.array([[comb(j, i) / comb(degree, i) if i <= j else 0.0 for i in powers] for j in powers])
    rising = np.moveaxis(coefficients, 1, 0)[::-1] * (width ** np.arange(degree + 1)[:, None])[..., None]
    points = weights @ rising.reshape(degree + 1, -1)  # one product of matrices for all pieces
    return np.moveaxis(points.reshape(rising.shape), 0, 1)


def _balls(knots: Array, coefficients: Array) -> tuple[Array, Array]:
    """Return a ball around each piece of q_d, centres (K, n) and radii (K,)."""
    points = bezier_points(knots, coefficients)
    centre = 0.5 * (points.min(1) + points.max(1))
    return centre, norms(points - centre[:, None]).max(1) * (1 + 1e-12)
