"""Closure of a lap: the posture at its end is made the one at its beginning."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.continuation import Stop, verdicts
from pathcontrol.cartesian.ik.correction import correct
from pathcontrol.cartesian.ik.redundancy import PostureCost

_SAME = 1e-6  # rad, between the first and the last posture of a lap
_LEFT = 3.0  # rad, largest gap that is closed; half a turn and more would change the number of turns
_PACE = 0.1  # rad, closed in one step


def close_lap(constraint: ToolConstraint, s: Array, q: Array) -> Array | None:
    """Close a lap: change postures q (K, n) at s (K,) so that the last is the first; None if that fails.

    Where there is a choice of postures, the difference that a lap of least motion leaves is taken back little by little
    and evenly along the curve, each time by the nearest postures that hold the tool.
    """
    left, limits = q[-1] - q[0], constraint.tool.robot.limits
    size = float(np.abs(left).max())
    if constraint.freedom and size < _LEFT:
        share = ((s - s[0]) / (s[-1] - s[0]))[:, None]
        closing, times = q, int(np.ceil(size / _PACE))
        for i in range(1, times + 1):
            found = correct(constraint, PostureCost.nearest(q - i / times * share * left, limits), closing, s)
            if (verdicts(constraint, found) != Stop.NONE).any():
                return None
            closing = found.q
        q = closing
    return q if np.abs(q[-1] - q[0]).max() < _SAME else None
