"""Search of the postures that bring the tool as near as possible to the curve."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import ToolConstraint

_STEPS = 60
_LEAST_DAMPING, _FIRST_DAMPING, _LARGEST_DAMPING = 1e-10, 1e-2, 1e6
_ARRIVED = 1e-24  # of ‖f‖²
_STUCK = 1e-6  # least relative decrease of ‖f‖² for the iteration to continue


def reach(constraint: ToolConstraint, q: Array, s: Array) -> Array:
    """Return postures (N, n) within the joint limits that locally minimise ‖f(q, s)‖ at s (N,), from q (N, n).

    The Levenberg–Marquardt method; a joint that is at a limit and would leave its range holds still.
    """
    limits = constraint.tool.robot.limits
    q = np.clip(q, limits.lower, limits.upper)
    target = constraint.target(s)
    f, slope = constraint.towards(q, target)
    damping, moving = np.full(len(q), _FIRST_DAMPING), np.arange(len(q))
    for _ in range(_STEPS):
        step = _damped_step(f[moving], slope[moving], damping[moving], q[moving], limits.lower, limits.upper)
        trial = np.clip(q[moving] + step, limits.lower, limits.upper)
        f_trial, slope_trial = constraint.towards(trial, target.rows(moving))
        before, after = (f[moving] ** 2).sum(-1), (f_trial**2).sum(-1)
        better = after < before
        taken = moving[better]
        q[taken], f[taken], slope[taken] = trial[better], f_trial[better], slope_trial[better]
        damping[moving] = np.maximum(damping[moving] * np.where(better, 0.2, 5.0), _LEAST_DAMPING)
        falling = np.where(better, before - after > _STUCK * before, damping[moving] < _LARGEST_DAMPING)
        moving = moving[falling & (np.minimum(before, after) > _ARRIVED)]
        if not moving.size:
            break
    return q


def nearest_postures(constraint: ToolConstraint, seeds: Array, s: Array) -> Array:
    """Return for each s (K,) the best posture that :func:`reach` finds from the ``seeds`` (N, n), (K, n)."""
    places, q = np.repeat(s, len(seeds)), np.tile(seeds, (len(s), 1))
    reached = reach(constraint, q, places)
    left = (constraint.at(reached, places)[0] ** 2).sum(-1).reshape(len(s), -1)
    return reached.reshape(len(s), len(seeds), -1)[np.arange(len(s)), left.argmin(-1)]


def _damped_step(f: Array, slope: Array, damping: Array, q: Array, lower: Array, upper: Array) -> Array:
    """Return the step −(JᵀJ + μI)⁻¹Jᵀf of the joints that are not held by a limit, (N, n)."""
    downhill = -(slope.swapaxes(1, 2) @ f[..., None])[..., 0]
    free = ~((q <= lower) & (downhill < 0) | (q >= upper) & (downhill > 0))
    slope = slope * free[:, None]
    normal = slope.swapaxes(1, 2) @ slope + damping[:, None, None] * np.eye(q.shape[-1])
    return np.linalg.solve(normal, (downhill * free)[..., None])[..., 0]
