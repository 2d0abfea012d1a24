"""The two passes of TOPP: backwards for the controllable ṡ², forwards for the largest ṡ² inside that set."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.profiles.topp.cell_constraints import Cells

_FIRST_INSTANT = 2.5e-3  # s
_LAPS = 100
_NEGLIGIBLE = 1e-6  # share of a limit
_UNBOUNDED = 1e-100


class Allowed(NamedTuple):
    """The pairs of ṡ² that the limits allow in each cell.

    Attributes:
        cells: the pairs of ṡ² at the ends of each of the N cells.
        speed: the largest ṡ² at the knots, (N + 1,).
        enter: ṡ² at the beginning of each cell if it is passed the fastest, (N,); see :func:`fastest_pair`.
        leave: ṡ² at its end then, (N,).
    """

    cells: Cells
    speed: Array
    leave: Array
    enter: Array


def traverse_open(allowed: Allowed, widths: Array, start: float | None, end: float | None) -> tuple[Array, Array]:
    """Return the largest ṡ² at the knots of an open path from which its end can be reached, and the fastest, (N + 1,).

    ``start`` and ``end`` are the rates ṡ [1/s] at the ends; ∞ for the fastest, ``None`` for what the arm reaches from
    rest in a first instant, 2.5 ms, of the acceleration it is then capable of.
    """
    cells = allowed.cells
    last = _rate_from_rest(cells.select(-1), widths[-1]) if end is None else end
    largest = _sweep_backwards(allowed, min(last**2, allowed.leave[-1]))
    first = _rate_from_rest(cells.swap_ends().select(0), widths[0]) if start is None else start
    return largest, _sweep_forwards(allowed, largest, min(first**2, largest[0]))


def traverse_closed(allowed: Allowed) -> Array:
    """Return ṡ² at the knots of the fastest periodic traversal of a closed path, (N + 1,)."""
    largest = _repeat_laps(lambda x: _sweep_backwards(allowed, x)[::-1], allowed.leave[-1])[::-1]
    fastest = _repeat_laps(lambda x: _sweep_forwards(allowed, largest, x), largest[0])
    fastest[0] = fastest[-1]
    return fastest


def _rate_from_rest(cell: Cells, width: float) -> float:
    """Return the ṡ [1/s] that the arm reaches from rest in a first instant, in one cell of ``width`` Δs."""
    A, C = cell.A[:-1], cell.C[:-1]  # without the row of velocity
    largest = np.where(A > 0, -C / A, np.inf).min(initial=np.inf)
    return float(largest) / (2 * width) * _FIRST_INSTANT


def _sweep_backwards(allowed: Allowed, last: float) -> Array:
    """Return the largest ṡ² at the knots from which ``last`` can be reached."""
    cells, speed, leave, enter = allowed
    return sweep(steps_of(cells, leave, enter).reversed(), last, speed[-2::-1])[::-1]


def _sweep_forwards(allowed: Allowed, largest: Array, first: float) -> Array:
    """Return the fastest ṡ² at the knots that begins with ``first`` and stays below ``largest``."""
    scale = np.minimum(largest[1:], allowed.leave)
    return sweep(steps_of(allowed.cells.swap_ends(), largest[:-1], scale), first, largest[1:])


def _repeat_laps(lap: Callable[[float], Array], first: float) -> Array:
    """Repeat laps, each begun as the last one ended, until one ends as it began; they only become slower."""
    for _ in range(_LAPS):
        values = lap(first)
        if values[-1] >= (1 - 1e-12) * first:
            break
        first = values[-1]
    return values


class Steps(NamedTuple):
    """The constraints that bound x from above, as √x ≤ z/(B + √D) with (D, z) linear in (1, x', √x').

    Attributes:
        weights: of 1, x' and √x' in D and z, (N, 3, 2 rows).
        B: the coefficient of √x, (N, rows).
        most: the largest x' that counts, (N,).
    """

    weights: Array
    B: Array
    most: Array

    def reversed(self) -> Steps:
        """Return the same cells in the opposite order."""
        return Steps(*(array[::-1] for array in self))


def steps_of(cells: Cells, most: Array, scale: Array) -> Steps:
    """Return the steps from x' ≤ ``most`` to x, where (x, x') = (``scale``, ``most``) is allowed; both are (N,).

    The rows that grow with x there bound it: of A x + B √x = z/2 the root is √x = z/(B + √D), D = B² + 2A z.
    """
    A, B, A_next, B_next, C = cells
    y = np.sqrt(scale)[:, None]
    bounding = (2 * A * y + B > 0) & (A * y**2 + B * y > _NEGLIGIBLE)
    A, B = np.where(bounding, A, 0.0), np.where(bounding, B, _UNBOUNDED)
    z = np.where(bounding[:, None], -2 * np.stack([C, A_next, B_next], axis=1), np.array([1.0, 0.0, 0.0])[:, None])
    D = 2 * A[:, None] * z
    D[:, 0] += B * B
    return Steps(np.concatenate([D, z], -1), B, most)


def sweep(steps: Steps, start: float, ceiling: Array) -> Array:
    """Return the largest x ≤ ``ceiling`` (N,) from ``start`` on, each the x' of the next cell, (N + 1,)."""
    x, values, powers, rows = start, [start], np.ones(3), steps.B.shape[-1]
    both, zero = np.empty(2 * rows), np.zeros(rows)
    D, z = both[:rows], both[rows:]
    for weights, B, most, top in zip(steps.weights, steps.B, steps.most.tolist(), ceiling.tolist(), strict=True):
        x = x if x < most else most
        powers[1], powers[2] = x, sqrt(x)
        # in place and without temporaries: this loop is half of the time that a profile takes
        np.dot(powers, weights, both)
        np.sqrt(np.maximum(D, zero, out=D), D)
        np.divide(z, np.add(D, B, D), D)
        y = D.item(D.argmin())
        x = y * y if y > 0 else 0.0
        x = x if x < top else top
        values.append(x)
    return np.array(values)
