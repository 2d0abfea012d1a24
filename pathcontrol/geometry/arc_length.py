"""Arc length and curvature of curves in any space; the unit of length is that of the curve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError

_NODES, _WEIGHTS = (leggauss(10)[0] + 1) / 2, leggauss(10)[1] / 2
_FIRST_CELLS, _MOST_CELLS = 16, 1 << 17
_TOLERANCE = 1e-11  # relative, of a cell; its halves are then good to rounding
#: relative, of the whole: a cell that is off by less has no share in it; of curves without and with cusps
_ROUNDING = (2e-16, 1e-14)
_NOISE = 1e-8  # disagreements below this that do not fall as cells are halved are rounding of the curve itself
_NEWTON_STEPS = 64  # where the speed vanishes Newton's method begins by halving
_TURN = 0.9  # rad over a cell; what quadrature would miss in the corner of a cell shows in the tangents at its ends
_SMALLEST = np.finfo(float).tiny
_NARROWEST = 2.0**-40  # of the interval, in which a direction that jumps is not looked for any closer
_SLOWEST = 0.1  # of the mean speed in a cell
_COINCIDENT = 1e-13  # relative to the parameter; places nearer to one another are one place


class ArcLength:
    """The arc length L(s) = ∫‖p'‖ds of a curve p(s), and its inverse.

    The interval is cut, first at the knots of the curve, until Gauss–Legendre quadrature of 10 points on a cell agrees
    with that on its halves to 1e-11 of the cell or to rounding of the whole. One lap stands for all of a closed curve.

    Args:
        derivative: p'(s), (*batch, n), at s (*batch,).
        lower: where L = 0; of a closed curve, where a lap begins.
        upper: the end of the interval; of a closed curve, of the lap.
        closed: whether the curve repeats with the period ``upper - lower``.
        knots: where pieces of the curve meet, increasing, (K,); ``None`` for a curve all of one piece.
        name: what the curve is called in errors.
        cusps: whether the curve may stand still at points, where its direction may jump; a cell in which the direction
            turns by more than 0.9 rad is then halved, too.

    Raises:
        TaskError: the curve stands still over a part of the interval, and has no ``cusps``.
    """

    def __init__(
        self,
        derivative: Callable[[Array], Array],
        lower: float,
        upper: float,
        closed: bool = False,
        knots: Array | None = None,
        name: str = "the curve",
        cusps: bool = False,
    ) -> None:
        self._derivative, self._closed, self._knots, self._cusps = derivative, closed, knots, cusps
        self.lower, self.upper = lower, upper
        self._ends, steps = self._cells(self._first_ends())
        self._speeds = np.linalg.norm(derivative(self._ends), axis=-1)
        self._lengths = np.concatenate([[0.0], np.cumsum(steps)])
        if not cusps and (not (steps > 0).all() or not np.isfinite(self.total)):
            i = int(np.argmin(np.nan_to_num(steps, nan=-1.0)))
            raise TaskError(
                f"{name} has length {steps[i]:g} from s = {self._ends[i]:g} to {self._ends[i + 1]:g}, "
                "expected a path that moves with s everywhere: q_d' = 0 is a standstill",
                s=float(self._ends[i]),
            )

    @property
    def total(self) -> float:
        """Length of the interval [rad]."""
        return float(self._lengths[-1])

    def __call__(self, s: Array) -> Array:
        """Return the arc length L(s) [rad], (*batch,)."""
        laps, s = self._laps(s - self.lower, self.upper - self.lower)
        s = self.lower + s
        cell = self._cell(self._ends, s)
        return laps * self.total + self._lengths[cell] + self._quadrature(self._ends[cell], s)[0]

    def inverse(self, length: Array) -> Array:
        """Return the s, (*batch,), at the arc ``length`` [rad], (*batch,), by Newton's method."""
        laps, length = self._laps(length, self.total)
        cell = self._cell(self._lengths, length)
        a, b, rest = self._ends[cell], self._ends[cell + 1], length - self._lengths[cell]
        s = self._estimate_inverse(cell, rest)
        moving = np.ones(s.shape, dtype=bool)
        for _ in range(_NEWTON_STEPS):
            reached, slope = self._quadrature(a, s)
            # rows that have arrived stay, so that no result depends on how long others take
            step = np.where(moving, (rest - reached) / np.maximum(slope, _SMALLEST), 0.0)
            s = np.clip(s + step, a, b)
            moving &= np.abs(step) > 1e-8 * (b - a)  # and then twice as many digits
            if not moving.any():
                break
        return s + laps * (self.upper - self.lower)

    def _estimate_inverse(self, cell: Array, rest: Array) -> Array:
        """Return a first estimate of the inverse in a cell: the cubic through the ends and end slopes of L⁻¹."""
        h = self._ends[cell + 1] - self._ends[cell]
        length = np.maximum(self._lengths[cell + 1] - self._lengths[cell], _SMALLEST)
        x, slow = np.clip(rest / length, 0.0, 1.0), _SLOWEST * length / h  # no tangent of a curve that stands still
        left, right = (length / np.maximum(self._speeds[at], slow) for at in (cell, cell + 1))
        return self._ends[cell] + x * (left + x * (3 * h - 2 * left - right + x * (left + right - 2 * h)))

    def _laps(self, value: Array, one: float) -> tuple[Array, Array]:
        """Split ``value`` into whole laps of a closed curve and the rest."""
        if not self._closed:
            return np.zeros_like(value), value
        laps, rest = np.divmod(value, one)
        return laps, rest

    def _cell(self, ends: Array, value: Array) -> Array:
        """Return the cells that hold the values."""
        return np.clip(np.searchsorted(ends, value, side="right") - 1, 0, len(ends) - 2)

    def _quadrature(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Return the length from a to b, each (*batch,), and the speed ‖p'(b)‖."""
        h = (b - a)[..., None]
        speed = np.linalg.norm(self._derivative(a[..., None] + h * np.append(_NODES, 1.0)), axis=-1)
        # a product of matrices would round a row differently in another batch
        return h[..., 0] * (speed[..., :-1] * _WEIGHTS).sum(-1), speed[..., -1]

    def _first_ends(self) -> Array:
        """Return equidistant ends of cells, joined by the knots of the curve."""
        ends = np.linspace(self.lower, self.upper, _FIRST_CELLS + 1)
        knots = self._knots
        if knots is None:
            return ends
        return drop_coincident(np.union1d(ends, knots[(knots > self.lower) & (knots < self.upper)]))

    def _cells(self, ends: Array) -> tuple[Array, Array]:
        """Return the ends of the cells, (K + 1,), refined until the quadrature agrees, and their lengths, (K,)."""
        a, b = ends[:-1], ends[1:]
        whole, before = self._quadrature(a, b)[0], np.full(len(a), np.inf)
        starts, lengths, most, least = [], [], _MOST_CELLS + len(a), _ROUNDING[self._cusps] * whole.sum()
        count = len(a)
        while a.size:
            middle = (a + b) / 2
            halves = np.stack([self._quadrature(a, middle)[0], self._quadrature(middle, b)[0]])
            off = np.abs(halves.sum(0) - whole)
            error = off / np.maximum(halves.sum(0), np.finfo(float).tiny)
            falling = (
                (error > _TOLERANCE) & (self._cusps | (error > _NOISE) | (error <= 0.4 * before)) & ~(off <= least)
            )
            done = ~(falling | self._turns(a, b)) | (count > most)
            starts += [a[done], middle[done]]
            lengths += [*halves[:, done]]
            a, b = np.concatenate([a[~done], middle[~done]]), np.concatenate([middle[~done], b[~done]])
            whole, before = halves[:, ~done].ravel(), np.tile(error[~done], 2)
            count += len(a)
        order = np.argsort(np.concatenate(starts))
        return np.append(np.concatenate(starts)[order], ends[-1]), np.concatenate(lengths)[order]

    def _turns(self, a: Array, b: Array) -> NDArray[np.bool_]:
        """Return whether the direction of a curve with cusps turns too much from a to b, each (*batch,)."""
        if not self._cusps:
            return np.zeros(a.shape, dtype=bool)
        both = self._derivative(np.stack([a, b]))
        before, after = both / np.maximum(np.linalg.norm(both, axis=-1, keepdims=True), _SMALLEST)
        return (np.linalg.norm(after - before, axis=-1) > _TURN) & (b - a > _NARROWEST * (self.upper - self.lower))


def drop_coincident(ends: Array) -> Array:
    """Return ``ends`` (K,), ascending, without those that coincide up to rounding with the one before or the last."""
    nearest = _COINCIDENT * np.abs(ends[[0, -1]]).max()
    kept, last_kept = [ends[0]], ends[0]
    for end in ends[1:-1]:
        if end - last_kept > nearest and ends[-1] - end > nearest:
            kept.append(end)
            last_kept = end
    return np.array([*kept, ends[-1]])


def curvature_vector(dq_d: Array, ddq_d: Array) -> Array:
    """Return the second derivative by the arc length [1/rad], (*batch, n): the normal part of q_d'' over ‖q_d'‖²."""
    squared = (dq_d * dq_d).sum(-1, keepdims=True)
    return (ddq_d - (dq_d * ddq_d).sum(-1, keepdims=True) / squared * dq_d) / squared
