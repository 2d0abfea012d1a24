"""The cost that selects a posture among those that hold the tool."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from pathcontrol._arrays import Array
from pathcontrol.robot.actuation import Limits

_ATTRACTION = 0.1  # pull of the start posture
_MARGIN = 0.3  # rad or m from a limit where it begins to push, but no more than …
_SHARE = 0.15  # … this share of the joint's range
_PUSH = 40.0  # rad or m, the push at the limit


@dataclass(frozen=True, eq=False)
class PostureCost:
    """The cost H(q) = ½‖q − q_rest‖² + w (½ε‖q − q_anchor‖² + Σ b(d_i)) of a posture, to be minimised.

    b grows when the distance d of a joint to a limit falls below a margin m, b' = −40 (1 − d/m)³, and ε = 0.1. With
    q_rest the posture before and w the length of a step over the lever arm of the joints this is the least motion of
    the joints, bent away from limits and gently towards the anchor, whatever the length of the steps. With w = 0 it is
    the posture nearest to q_rest.

    Attributes:
        rest: q_rest [rad], (N, n).
        anchor: q_anchor [rad], (N, n).
        weight: w, (N,).
        limits: joint limits.
    """

    rest: Array
    anchor: Array
    weight: Array
    limits: Limits

    @classmethod
    def nearest(cls, rest: Array, limits: Limits) -> PostureCost:
        """Return the cost ½‖q − q_rest‖²."""
        return cls(rest, rest, np.zeros(len(rest)), limits)

    def gradients(self, q: Array) -> Array:
        """Return ∇H at several postures for each row, (N, k, n)."""
        if not self.weight.any():
            return q - self.rest[:, None]
        pull = _ATTRACTION * (q - self.anchor[:, None])
        return q - self.rest[:, None] + self.weight[:, None, None] * (pull - self._push(q))

    def rows(self, chosen: Array) -> PostureCost:
        """Return the cost of the ``chosen`` rows."""
        return PostureCost(self.rest[chosen], self.anchor[chosen], self.weight[chosen], self.limits)

    def _push(self, q: Array) -> Array:
        lower, upper = self.limits.lower, self.limits.upper
        margin = np.clip(_SHARE * (upper - lower), 1e-9, _MARGIN)
        from_lower, from_upper = (np.maximum(1 - d / margin, 0.0) for d in (q - lower, upper - q))
        return _PUSH * (from_lower**3 - from_upper**3)


def rest_curve(s: Array, q: Array, closed: bool) -> BSpline:
    """Return q_rest(s), the C² cubic spline through postures q (K, n) at s (K,), as reference for others."""
    if not closed:
        return make_interp_spline(s, q, k=3, bc_type="natural")
    return make_interp_spline(s, np.concatenate([q[:-1], q[:1]]), k=3, bc_type="periodic")
