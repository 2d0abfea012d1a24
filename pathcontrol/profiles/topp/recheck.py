"""A check of the limits inside the cells, and tighter constraints where they are exceeded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.profiles.topp.cell_constraints import Cells
from pathcontrol.profiles.topp.dynamics import Samples, Torques
from pathcontrol.profiles.topp.fastest_pair import fastest_pair
from pathcontrol.profiles.topp.joint_limits import JointLimits
from pathcontrol.profiles.topp.passes import Allowed
from pathcontrol.robot.friction import viscous_of

_ACCEPTED = 1 + 7e-4  # largest share at the samples, a little below what is promised between them
_PROMISED = 1 + 1e-3
_KEPT = 0.1  # share kept of the margin that standstill leaves


class Excess(NamedTuple):
    """The excess of each cell over the limits, in shares; 0 where they are kept.

    Attributes:
        inside: of the m rows at the samples, over the chord between the ends, (N, m).
        ends: of the m rows at the ends, (N, m).
        velocity: of the velocity limits at the samples, (N,).
    """

    inside: Array
    ends: Array
    velocity: Array

    @property
    def cells(self) -> Array:
        """The mask of the cells with any excess, (N,)."""
        return self.inside.any(-1) | self.ends.any(-1) | (self.velocity > 0)


def find_excess(limits: JointLimits, samples: Samples, torques: Torques, cells: Cells, x: Array) -> Excess:
    """Return the excess of ṡ² = x at the knots (N + 1,), by inverse dynamics at the samples."""
    rows, velocity = _inside(limits, samples, torques, x)
    first, last = np.split(cells.used(x)[:, :-1], 2, axis=-1)
    chord = first[:, None] + (last - first)[:, None] * _shares(samples)
    ends = np.maximum(first, last)
    return Excess(
        np.where(rows > _ACCEPTED, rows - chord, 0.0).max(1),
        np.where(ends > _ACCEPTED, ends - 1, 0.0),
        np.where(velocity > _ACCEPTED, velocity - 1, 0.0),
    )


def find_broken(limits: JointLimits, samples: Samples, torques: Torques, x: Array) -> NDArray[np.bool_]:
    """Return the mask of the cells, (N,), in which a sample of ṡ² = x exceeds a limit by more than is promised."""
    rows, velocity = _inside(limits, samples, torques, x)
    return np.asarray((rows > _PROMISED).any((1, 2)) | (velocity > _PROMISED))


def tighten(allowed: Allowed, cells: Cells, over: Excess, x: Array) -> Allowed:
    """Tighten the constraints of cells where ṡ² = x is too much, but never so far that rest is not allowed."""
    slower = np.where(over.velocity > 0, (1 + over.velocity) ** -2, np.inf)
    speed = np.minimum(allowed.speed, x * np.minimum(np.append(slower, np.inf), np.append(np.inf, slower)))
    A = np.hstack([cells.A[:, :-1], 1 / speed[:-1, None]])
    inside, ends = (np.hstack([rows, rows, 0 * A[:, -1:]]) for rows in (over.inside, over.ends))
    C = np.maximum(cells.C + inside, allowed.cells.C + ends)
    C = np.maximum(np.minimum(C, _KEPT * cells.C), allowed.cells.C)
    slowed = speed < allowed.speed
    changed = np.flatnonzero((C > allowed.cells.C).any(-1) | slowed[:-1] | slowed[1:])
    tighter, leave, enter = cells._replace(A=A, C=C), allowed.leave.copy(), allowed.enter.copy()
    leave[changed], enter[changed] = fastest_pair(tighter.select(changed), speed[1:][changed])
    return Allowed(tighter, speed, leave, enter)


def _inside(limits: JointLimits, samples: Samples, torques: Torques, x: Array) -> tuple[Array, Array]:
    """Return the used shares at the samples within the cells, (N, k − 1, m), and the largest of velocity, (N,)."""
    q, dq, ddq = (samples.by_cell(a)[:, 1:] for a in (samples.q, samples.dq, samples.ddq))
    x_inside = x[:-1, None, None] + np.diff(x)[:, None, None] * _shares(samples)
    u = (np.diff(x) / (2 * samples.widths))[:, None, None]
    qd, qdd = dq * np.sqrt(x_inside), dq * u + ddq * x_inside
    tau = limits.robot.inverse_dynamics(q, qd, qdd) + viscous_of(limits.robot.friction) * qd
    rows = limits.shares(qdd, tau + torques.most[:, None], tau + torques.least[:, None])
    return rows, (np.abs(qd) / limits.velocity).max((1, 2))


def _shares(samples: Samples) -> Array:
    """Return the places of the samples within a cell, as shares of its width."""
    return np.arange(1, samples.k)[:, None] / samples.k
