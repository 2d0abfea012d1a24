"""Inverse kinematics at any parameters of a curve along which a trail is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.continuation import Stop, find_faults, follow
from pathcontrol.cartesian.ik.correction import branch_at, correct
from pathcontrol.cartesian.ik.failure import trail_error
from pathcontrol.cartesian.ik.redundancy import PostureCost

_NEAR = 0.2  # rad, largest correction of an interpolated posture; more may be another branch


class Samples(NamedTuple):
    """Postures q [rad] (K, n) at increasing parameters s [m] (K,)."""

    s: Array
    q: Array

    def with_more(self, s: Array, q: Array) -> Samples:
        """Return these samples with others at other parameters."""
        places, first = np.unique(np.concatenate([self.s, s]), return_index=True)
        return Samples(places, np.concatenate([self.q, q])[first])

    def only(self, s: Array) -> Samples:
        """Return the samples at the parameters s, which are among them."""
        return Samples(s, self.q[np.searchsorted(self.s, s)])


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """The posture q(s), (N, n), nearest to ``rest``(s) of those that hold the tool on the curve at s."""

    constraint: ToolConstraint
    rest: Callable[[Array], Array]

    def near(self, s: Array, known: Samples) -> tuple[Array, Array]:
        """Correct postures (N, n), interpolated at s (N,); return them and the mask of the valid ones, (N,).

        Fit are those near to the interpolation, and on the same side of singularities as the ``known`` one before.
        """
        guess, before = PchipInterpolator(known.s, known.q)(s), np.searchsorted(known.s, s) - 1
        cost = PostureCost.nearest(self.rest(s), self.constraint.tool.robot.limits)
        found = correct(self.constraint, cost, guess, s)
        near = np.abs(found.q - guess).max(-1) < _NEAR
        used, row = np.unique(before, return_inverse=True)
        hops = found.branch.differs(branch_at(self.constraint, known.q[used], known.s[used]).rows(row))
        return found.q, near & ~hops & (find_faults(self.constraint, found) == Stop.NONE)

    def fill(self, known: Samples, s: Array) -> Samples:
        """Return postures at the increasing parameters s (N,), between ``known`` postures.

        What Newton's method does not reach from an interpolation of known postures is found by continuation.

        Raises:
            TaskError: the curve cannot be followed to one of them.
        """
        missing = np.setdiff1d(s, known.s)
        while missing.size:
            q, good = self.near(missing, known)
            if good.any():
                known, missing = known.with_more(missing[good], q[good]), missing[~good]
            else:
                known, missing = self._walk(known, missing[0]), missing[1:]
        return known.only(s)

    def _walk(self, known: Samples, s: float) -> Samples:
        """Continue to s from the known posture before it."""
        before = int(np.searchsorted(known.s, s)) - 1
        trail = follow(self.constraint, known.q[before][None], float(known.s[before]), float(s), self.rest)[0]
        if trail.stop is not Stop.NONE:
            raise trail_error(self.constraint, trail)
        return known.with_more(np.array(trail.s[1:]), np.array(trail.q[1:]))
