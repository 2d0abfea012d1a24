"""Continuation of start postures along a curve, several side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.correction import Corrected, branch_at, correct
from pathcontrol.cartesian.ik.joint_range import is_outside, share_to_limits
from pathcontrol.cartesian.ik.redundancy import PostureCost

_PIECES = 8  # a step is at most this part of the curve, …
_REACH = 0.1  # … and this part of the lever arm long
_SMALLEST = 1e-7  # part of the curve; smaller steps are not tried
_TRIES = 20_000  # steps in all, so that the walk ends
_DRIFT = 0.1  # rad, largest correction of a predicted posture; more may be another branch
_LEAP = 0.4  # rad, largest motion of a joint in a step
SINGULAR = (
    1e-3  # singular values below this count as zero: the joints move 1000 times as much as the tool over its lever
)
_TIGHT = 0.2  # share of the way to a joint limit from which on a posture counts as less comfortable


class Stop(IntEnum):
    """The reason why a posture does not continue the path."""

    NONE = 0
    LOST = 1  # Newton's method does not converge, or far from where it should
    LIMIT = 2  # a joint would pass its limit
    SINGULAR = 3  # the tool cannot move in some direction, here or just before


@dataclass
class Trail:
    """Postures along a curve, as far as continuation from one start posture got.

    Attributes:
        s: path parameters [m].
        q: postures [rad], one for each.
        comfort: the worst along the way of conditioning, lowered near joint limits.
        stop: why it ended, NONE at the end of the curve.
        beyond: the posture that ended it [rad], (n,).
    """

    s: list[float]
    q: list[Array]
    comfort: float = np.inf
    stop: Stop = Stop.NONE
    beyond: Array = field(default_factory=lambda: np.empty(0))


def follow(
    constraint: ToolConstraint, start: Array, s0: float, s_end: float, rest: Callable[[Array], Array] | None = None
) -> list[Trail]:
    """Follow the curve from s0 to s_end from the postures ``start`` (N, n), by prediction and correction.

    The prediction is the secant through the last two postures. A step is cut in four where the correction fails, is
    large or comes to the other side of a singularity, and doubled where it is small. A choice of postures is made for
    the least motion, away from limits and gently towards the start, or given a curve of postures q_rest(s) for the one
    nearest to it.
    """
    walk = _Walk(constraint, start, s0, s_end, rest)
    for _ in range(_TRIES):
        if not walk.advance():
            return walk.trails
    return walk.give_up()


class _Walk:
    """The state of :func:`follow`, with a row for each start posture."""

    def __init__(
        self,
        constraint: ToolConstraint,
        start: Array,
        s0: float,
        s_end: float,
        rest: Callable[[Array], Array] | None,
    ) -> None:
        self.constraint, self.start, self.s_end, self.rest = constraint, start, s_end, rest
        self.s, self.q, self.slope = np.full(len(start), s0), start.copy(), np.zeros_like(start)
        self.longest = min(constraint.curve.length / _PIECES, _REACH * constraint.length)
        self.smallest = _SMALLEST * constraint.curve.length
        self.step = np.full(len(start), self.longest)
        self.branch = branch_at(constraint, start, self.s)
        self.trails = [Trail([s0], [row]) for row in start]
        self.going = np.full(len(start), s0 < s_end)

    def advance(self) -> bool:
        """Take one step in every row that is still going; return whether there was any."""
        rows = np.flatnonzero(self.going)
        if not rows.size:
            return False
        s = self.s[rows] + self.step[rows]
        s = np.where(s > self.s_end - self.step[rows] / 2, self.s_end, s)  # no tiny step at the end
        guess = self.q[rows] + self.slope[rows] * (s - self.s[rows])[:, None]
        found = correct(self.constraint, self._cost(rows, s), guess, s)
        drift = np.abs(found.q - guess).max(-1)
        far = (drift > _DRIFT) | (np.abs(found.q - self.q[rows]).max(-1) > _LEAP)
        beyond = self.branch.rows(rows).differs(found.branch)
        reasons = np.select([far, beyond], [Stop.LOST, Stop.SINGULAR], find_faults(self.constraint, found))
        good = reasons == Stop.NONE
        self._accept(rows[good], s[good], found.rows(good), drift[good])
        self._refuse(rows[~good], reasons[~good], found.q[~good])
        return True

    def give_up(self) -> list[Trail]:
        """Return the trails as they are, with those still going marked as lost."""
        for row in np.flatnonzero(self.going):
            self.trails[row].stop, self.trails[row].beyond = Stop.LOST, self.q[row]
        return self.trails

    def _cost(self, rows: Array, s: Array) -> PostureCost:
        limits = self.constraint.tool.robot.limits
        if self.rest is not None:
            return PostureCost.nearest(self.rest(s), limits)
        weight = (s - self.s[rows]) / self.constraint.length
        return PostureCost(self.q[rows], self.start[rows], weight, limits)

    def _accept(self, rows: Array, s: Array, found: Corrected, drift: Array) -> None:
        comfort = rate_comfort(self.constraint, found)
        self.slope[rows] = (found.q - self.q[rows]) / (s - self.s[rows])[:, None]
        self.s[rows], self.q[rows] = s, found.q
        self.branch.left[rows], self.branch.right[rows] = found.branch
        self.step[rows] = np.minimum(np.where(drift < _DRIFT / 4, 2.0, 1.0) * self.step[rows], self.longest)
        self.going[rows] = s < self.s_end
        for i, row in enumerate(rows):
            trail = self.trails[row]
            trail.s.append(float(s[i]))
            trail.q.append(found.q[i])
            trail.comfort, trail.stop = min(trail.comfort, float(comfort[i])), Stop.NONE

    def _refuse(self, rows: Array, reasons: Array, beyond: Array) -> None:
        self.step[rows] /= 4
        self.going[rows] = self.step[rows] > self.smallest
        for row, reason, posture in zip(rows, reasons, beyond, strict=True):
            self.trails[row].stop, self.trails[row].beyond = Stop(reason), posture


def find_faults(constraint: ToolConstraint, found: Corrected) -> Array:
    """Return the fault of each corrected posture, an array of :class:`Stop`, (N,)."""
    beyond = is_outside(constraint.tool.robot, found.q)
    conditions = [~found.converged, beyond, found.conditioning < SINGULAR]
    return np.select(conditions, [Stop.LOST, Stop.LIMIT, Stop.SINGULAR], Stop.NONE)


def rate_comfort(constraint: ToolConstraint, found: Corrected) -> Array:
    """Return the conditioning of postures, (N,), lowered in proportion where a joint is near a limit."""
    share = share_to_limits(constraint.tool.robot, found.q)
    return found.conditioning * np.clip(share / _TIGHT, 0.1, 1.0)
