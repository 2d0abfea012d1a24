"""The constraints of each cell of the grid: a set in the plane of ṡ² at its two ends."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.profiles.topp.dynamics import Samples, Torques
from pathcontrol.profiles.topp.joint_limits import JointLimits


class Cells(NamedTuple):
    """The constraints A x + B √x + A' x' + B' √x' + C ≤ 0 on x and x' = ṡ² at the ends of cells; arrays (N, rows).

    ṡ² is linear in s within a cell, so that s̈ = (x' − x)/(2Δs) there. The rows are the m rows of
    :meth:`JointLimits.shares` at the first end, less 1, those at the other end, and the velocity limit at the first.
    What q_d'' bulges between the knots is added to both ends.
    """

    A: Array
    B: Array
    A_next: Array
    B_next: Array
    C: Array

    def used(self, x: Array) -> Array:
        """Return the share of each limit that x = ṡ² at the knots (N + 1,) uses, (N, rows)."""
        y = np.sqrt(x)
        own = self.A * x[:-1, None] + self.B * y[:-1, None]
        return own + self.A_next * x[1:, None] + self.B_next * y[1:, None] + self.C + 1

    def swap_ends(self) -> Cells:
        """Return the same cells with their two ends exchanged."""
        return Cells(self.A_next, self.B_next, self.A, self.B, self.C)

    def select(self, index: Array | int) -> Cells:
        """Return the cells at an index."""
        return Cells(*(array[index] for array in self))


def static_shares(limits: JointLimits, torques: Torques) -> Array:
    """Return the shares used at standstill at both ends of each cell, (N, 2, m); dry friction may jump at a knot."""
    ends = np.stack([torques.c[:-1], torques.c[1:]], axis=1)
    return limits.shares(np.zeros_like(ends), ends + torques.most[:, None], ends + torques.least[:, None])


def cells_of(limits: JointLimits, samples: Samples, torques: Torques, speed: Array) -> Cells:
    """Return the cells of a path on which ṡ² ≤ ``speed`` at the knots, (N + 1,)."""
    knots, static = samples.knots, static_shares(limits, torques)
    u = limits.shares(knots.dq, torques.a, torques.a)
    x = limits.shares(knots.ddq, torques.b, torques.b)
    y = limits.shares(np.zeros_like(knots.dq), torques.d, torques.d)
    left, right = (end / (2 * samples.widths[:, None]) for end in (u[:-1], u[1:]))
    bulge = np.maximum(limits.shares(samples.bulge, torques.bulge, torques.bulge), 0.0)
    none, column = np.zeros_like(left), np.zeros((len(left), 1))
    return Cells(
        np.hstack([x[:-1] + bulge - left, -right, 1 / speed[:-1, None]]),
        np.hstack([y[:-1], none, column]),
        np.hstack([left, x[1:] + bulge + right, column]),
        np.hstack([none, y[1:], column]),
        np.hstack([static[:, 0], static[:, 1], column]) - 1,
    )
