"""The moments at which an arm crosses planes normal to its path, found between the samples of a run.

At a section s_i of the path, with the point c_i and the unit tangent τ_i there, a motion x(t) crosses the normal plane
where u(t) = τ_i·(x(t) − c_i) passes zero. Between two samples u is the cubic of its values and of its slopes τ_i·ẋ at
both (Hermite), which follows a smooth motion with an error of fourth order in the period.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array

_REACH = 0.25  # of a lap or a path: how far the plan may be from a section when the arm crosses its plane
_HALVINGS = 60


class Motion(NamedTuple):
    """A sampled motion of K samples with d coordinates: times (K,), s (K,), positions and velocities (K, d)."""

    time: Array
    s: Array
    x: Array
    v: Array


class Crossings(NamedTuple):
    """Crossings of m sections: the sample before each, and the share of the period that is over, (m,).

    The share is NaN where a section was not crossed.
    """

    before: NDArray[np.intp]
    share: Array

    def of(self, time: Array, values: Array, slopes: Array) -> Array:
        """Return ``values`` (K, d) with their ``slopes`` at the crossings, (m, d), by cubics between samples."""
        h = (time[self.before + 1] - time[self.before])[:, None]
        ends = [np.stack([part[self.before], part[self.before + 1]]) for part in (values, slopes)]
        return _hermite(self.share[:, None], h, *ends)

    def between(self, time: Array, values: Array) -> Array:
        """Return ``values`` (K, d) at the crossings, (m, d), by cubics through the four samples around each."""
        first = np.clip(self.before - 1, 0, len(values) - 4)
        at = time[self.before] + self.share * (time[self.before + 1] - time[self.before])
        nodes = time[first[:, None] + np.arange(4)]
        found = np.zeros((len(first), values.shape[1]))
        for i in range(4):  # Lagrange's form
            others = np.delete(nodes, i, axis=1)
            weight = np.prod((at[:, None] - others) / (nodes[:, i, None] - others), axis=1)
            found += weight[:, None] * values[first + i]
        return found


def find_crossings(motion: Motion, s: Array, centre: Array, tangent: Array, span: float) -> Crossings:
    """Return where a motion crosses the planes normal to a path at s (m,), in the sense of the path.

    Of several crossings the one is taken at which the plan is nearest to the section.

    Args:
        motion: the motion; its s counts laps.
        s: parameters of the sections, that count laps, too.
        centre: points of the path there, (m, d).
        tangent: unit tangents there, (m, d).
        span: length of a lap, or of an open path, in s.
    """
    near = np.abs(motion.s[:, None] - s) <= _REACH * span
    rows = np.flatnonzero(near.any(1))
    if len(rows) < 2:
        return Crossings(np.zeros(len(s), dtype=np.intp), np.full(len(s), np.nan))
    part = slice(rows[0], rows[-1] + 1)
    u = motion.x[part] @ tangent.T - np.vecdot(centre, tangent)
    apart = np.abs(motion.s[part][:-1, None] - s)
    passes = (u[:-1] < 0) & (u[1:] >= 0) & near[part][:-1]
    before = np.where(passes, apart, np.inf).argmin(0)
    columns = np.arange(len(s))
    ends = np.stack([u[before, columns], u[before + 1, columns]])
    before += rows[0]
    slopes = np.stack([np.vecdot(motion.v[k], tangent) for k in (before, before + 1)])
    share = _find_zeros(motion.time[before + 1] - motion.time[before], ends, slopes)
    return Crossings(before, np.where(passes.any(0), share, np.nan))


def _find_zeros(h: Array, values: Array, slopes: Array) -> Array:
    """Return the shares (m,) of cells of widths h at which cubics from below zero to above it vanish, by bisection."""
    low, high = np.zeros_like(h), np.ones_like(h)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = _hermite(middle, h, values, slopes) < 0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def _hermite(x: Array, h: Array, values: Array, slopes: Array) -> Array:
    """Return cubics at shares x of cells of widths h, from values and slopes (2, …) at both ends."""
    rise, v0, v1 = values[1] - values[0], h * slopes[0], h * slopes[1]
    return values[0] + x * (v0 + x * (3 * rise - 2 * v0 - v1 + x * (v0 + v1 - 2 * rise)))
