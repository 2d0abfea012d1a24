"""One pass along the grid, from ṡ² at one end of each cell to the largest ṡ² at the other."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.profiles.topp.cell_constraints import Cells

_NEGLIGIBLE = 1e-6  # share of a limit
_UNBOUNDED = 1e-100


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
