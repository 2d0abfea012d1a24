"""Arc length and curvature of paths."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, finite
from pathcontrol._expect import expect
from pathcontrol.errors import InputError, TaskError
from pathcontrol.tasks.base import PathTask

_NODES, _WEIGHTS = (leggauss(10)[0] + 1) / 2, leggauss(10)[1] / 2
_FIRST_CELLS, _MOST_CELLS = 16, 1 << 17
_TOLERANCE = 1e-11  # relative, of a cell; its halves are then good to rounding
_ROUNDING = 2e-16  # relative, of the whole: a cell that is off by less has no share in it
_NOISE = 1e-8  # disagreements below this that do not fall as cells are halved are rounding of the path itself
_NEWTON_STEPS = 20
_COINCIDENT = 1e-13  # relative to the parameter; places nearer to one another are one place


class ArcLength:
    """The arc length L(s) = ∫‖q_d'‖ds of a path, and its inverse.

    The interval is cut, first at the knots of the path, until Gauss–Legendre quadrature of 10 points on a cell agrees
    with that on its halves to 1e-11 of the cell or to rounding of the whole. One lap stands for all of a closed path.

    Args:
        path: the path.
        lower: where L = 0; of a closed path, where a lap begins.
        upper: the end of the interval; of a closed path, of the lap.
    """

    def __init__(self, path: PathTask, lower: float, upper: float) -> None:
        self.path, self.lower, self.upper = path, lower, upper
        self._ends, steps = self._cells(self._first_ends())
        self._speeds = np.linalg.norm(path.dq_d(self._ends), axis=-1)
        self._lengths = np.concatenate([[0.0], np.cumsum(steps)])
        if not (steps > 0).all() or not np.isfinite(self.total):
            i = int(np.argmin(np.nan_to_num(steps, nan=-1.0)))
            raise TaskError(
                f"{type(path).__name__} has length {steps[i]:g} from s = {self._ends[i]:g} to {self._ends[i + 1]:g}, "
                "expected a path that moves with s everywhere: q_d' = 0 is a standstill"
            )

    @property
    def total(self) -> float:
        """Length of the interval [rad]."""
        return float(self._lengths[-1])

    def __call__(self, s: Array) -> Array:
        """L(s) [rad], (*batch,)."""
        laps, s = self._laps(s - self.lower, self.upper - self.lower)
        s = self.lower + s
        cell = self._cell(self._ends, s)
        return laps * self.total + self._lengths[cell] + self._quadrature(self._ends[cell], s)[0]

    def inverse(self, length: Array) -> Array:
        """The s, (*batch,), up to which the path has the ``length`` [rad], (*batch,), by Newton's method."""
        laps, length = self._laps(length, self.total)
        cell = self._cell(self._lengths, length)
        a, b, rest = self._ends[cell], self._ends[cell + 1], length - self._lengths[cell]
        s = self._guess(cell, rest)
        moving = np.ones(s.shape, dtype=bool)
        for _ in range(_NEWTON_STEPS):
            reached, slope = self._quadrature(a, s)
            # rows that have arrived stay, so that no result depends on how long others take
            step = np.where(moving, (rest - reached) / slope, 0.0)
            s = np.clip(s + step, a, b)
            moving &= np.abs(step) > 1e-8 * (b - a)  # and then twice as many digits
            if not moving.any():
                break
        return s + laps * (self.upper - self.lower)

    def _guess(self, cell: Array, rest: Array) -> Array:
        """The s that lies ``rest`` behind the start of its cell, by the cubic with the ends and end slopes of L⁻¹."""
        h, length = self._ends[cell + 1] - self._ends[cell], self._lengths[cell + 1] - self._lengths[cell]
        x, left, right = rest / length, length / self._speeds[cell], length / self._speeds[cell + 1]
        return self._ends[cell] + x * (left + x * (3 * h - 2 * left - right + x * (left + right - 2 * h)))

    def _laps(self, value: Array, one: float) -> tuple[Array, Array]:
        """Whole laps in ``value`` and the rest, for a closed path."""
        if not self.path.closed:
            return np.zeros_like(value), value
        laps, rest = np.divmod(value, one)
        return laps, rest

    def _cell(self, ends: Array, value: Array) -> Array:
        return np.clip(np.searchsorted(ends, value, side="right") - 1, 0, len(ends) - 2)

    def _quadrature(self, a: Array, b: Array) -> tuple[Array, Array]:
        """The length from a to b, each (*batch,), and ‖q_d'(b)‖."""
        h = (b - a)[..., None]
        speed = np.linalg.norm(self.path.dq_d(a[..., None] + h * np.append(_NODES, 1.0)), axis=-1)
        # a product of matrices would round a row differently in another batch
        return h[..., 0] * (speed[..., :-1] * _WEIGHTS).sum(-1), speed[..., -1]

    def _first_ends(self) -> Array:
        ends = np.linspace(self.lower, self.upper, _FIRST_CELLS + 1)
        knots = self.path.knots
        if knots is None:
            return ends
        return apart(np.union1d(ends, knots[(knots > self.lower) & (knots < self.upper)]))

    def _cells(self, ends: Array) -> tuple[Array, Array]:
        """Ends of the cells, (K + 1,), and their lengths, (K,)."""
        a, b = ends[:-1], ends[1:]
        whole, before = self._quadrature(a, b)[0], np.full(len(a), np.inf)
        starts, lengths, most, least = [], [], _MOST_CELLS + len(a), _ROUNDING * whole.sum()
        count = len(a)
        while a.size:
            middle = (a + b) / 2
            halves = np.stack([self._quadrature(a, middle)[0], self._quadrature(middle, b)[0]])
            off = np.abs(halves.sum(0) - whole)
            error = off / np.maximum(halves.sum(0), np.finfo(float).tiny)
            falling = (error > _TOLERANCE) & ((error > _NOISE) | (error <= 0.4 * before)) & ~(off <= least)
            done = ~falling | (count > most)
            starts += [a[done], middle[done]]
            lengths += [*halves[:, done]]
            a, b = np.concatenate([a[~done], middle[~done]]), np.concatenate([middle[~done], b[~done]])
            whole, before = halves[:, ~done].ravel(), np.tile(error[~done], 2)
            count += len(a)
        order = np.argsort(np.concatenate(starts))
        return np.append(np.concatenate(starts)[order], ends[-1]), np.concatenate(lengths)[order]


def apart(ends: Array) -> Array:
    """Return ``ends`` (K,), ascending, without those that only rounding tells from the one before or the last."""
    nearest = _COINCIDENT * np.abs(ends[[0, -1]]).max()
    kept, last_kept = [ends[0]], ends[0]
    for end in ends[1:-1]:
        if end - last_kept > nearest and ends[-1] - end > nearest:
            kept.append(end)
            last_kept = end
    return np.array([*kept, ends[-1]])


def arc_length(task: PathTask, s0: ArrayLike | None = None, s_end: ArrayLike | None = None) -> Array:
    """Length ∫‖q_d'‖ds [rad], (*batch,), of the path from ``s0`` to ``s_end``, (*batch,) each; negative backwards.

    To about 1e-14 of the length for smooth paths, and for splines.

    Args:
        task: the path.
        s0: where to begin; by default where the path begins.
        s_end: where to end; by default where the path ends, or one lap after where it begins.

    Raises:
        InputError: an end is outside an open path, or left out where there is none; the shapes do not fit.
        TaskError: the path stands still somewhere.
    """
    expect("task", task, PathTask, error=TaskError)
    if s_end is None and not np.isfinite(last(task)):
        raise InputError(f"{type(task).__name__} neither ends nor repeats, so s_end is needed")
    start = _inside(task, "s0", task.s0 if s0 is None else s0)
    end = _inside(task, "s_end", last(task) if s_end is None else s_end)
    try:
        both = np.stack(np.broadcast_arrays(start, end))
    except ValueError as error:
        raise InputError(f"s0 has shape {start.shape} and s_end {end.shape}, expected shapes that broadcast") from error
    lower, upper = (task.s0, last(task)) if task.closed else (both.min(initial=np.inf), both.max(initial=-np.inf))
    if not lower < upper:  # nothing is asked for
        return np.zeros(both.shape[1:])
    length = ArcLength(task, float(lower), float(upper))(both)
    return length[1] - length[0]


def curvature(task: PathTask, s: ArrayLike) -> Array:
    """Curvature κ = ‖q_d' ∧ q_d''‖/‖q_d'‖³ [1/rad], (*batch,), at s (*batch,); the same in every parametrisation.

    ‖a ∧ b‖ is the area that a and b span; divided by ‖a‖ it is the part of b normal to a.
    """
    expect("task", task, PathTask, error=TaskError)
    s = as_array("s", s)
    return np.linalg.norm(curvature_vector(task.dq_d(s), task.ddq_d(s)), axis=-1)


def curvature_vector(dq_d: Array, ddq_d: Array) -> Array:
    """Second derivative by the arc length [1/rad], (*batch, n): the part of q_d'' normal to the path, over ‖q_d'‖²."""
    squared = (dq_d * dq_d).sum(-1, keepdims=True)
    return (ddq_d - (dq_d * ddq_d).sum(-1, keepdims=True) / squared * dq_d) / squared


def last(task: PathTask) -> float:
    """Where a path ends, or its first lap; ``inf`` if it neither ends nor repeats."""
    return task.s_end if task.period is None else task.s0 + task.period


def _inside(task: PathTask, name: str, s: ArrayLike) -> Array:
    """``s`` if the path is there."""
    s = finite(name, as_array(name, s))
    slack = 1e-12 * (1 + np.abs(s))
    outside = (s < task.s0 - slack) | (s > task.s_end + slack)
    if not task.closed and outside.any():
        raise InputError(f"{name} = {s[outside].flat[0]:g}, expected a number from {task.s0:g} to {task.s_end:g}")
    return s
