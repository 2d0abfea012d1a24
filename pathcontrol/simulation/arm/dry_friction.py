"""Set-valued dry friction over one time step, solved exactly for any number of joints.

Over a step the momentum p = Mv a mechanism would have without dry friction is shared between motion and friction,

    M v⁺ + λ = p,    λ_i = high_i if v⁺_i > 0,  low_i if v⁺_i < 0,  λ_i ∈ [low_i, high_i] if v⁺_i = 0,

the optimality condition of a strictly convex problem: v⁺ exists and is unique. It is found by block principal
pivoting on which joints stick: finitely many linear solves, no iteration error. Where blocks of exchanges make no
progress, single exchanges by Murty's least-index rule guarantee the end (Júdice and Pires, Computers & Operations
Research 21, 1994).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import SimulationError

_PATIENCE = 3  # block exchanges without progress before single ones
_MAX_EXCHANGES = 10_000
_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDING = 1e-12  # relative to the largest momentum; a joint this close to slipping may stick

_States = NDArray[np.intp]  # +1 slips forward, −1 slips backward, 0 sticks; (N, n)


def stick_slip(M: Array, p: Array, low: Array, high: Array, guess: Array | None = None) -> Array:
    """Return the velocity v⁺ [rad/s] after a step with dry friction.

    A row has the same result to the last bit alone and among others.

    Args:
        M: inertia matrix [kg m²], (N, n, n), symmetric positive definite.
        p: momentum without dry friction [N m s], (N, n).
        low: least friction impulse [N m s], (N, n) or (1, n), ≤ 0.
        high: greatest friction impulse [N m s], (N, n) or (1, n), ≥ 0.
        guess: the sign that v⁺ may have, (N, n), by default that of p; a good one saves time and changes nothing else.

    Returns:
        v⁺, (N, n); exactly 0 for joints that stick, no finite numbers where M is singular.

    Raises:
        SimulationError: M is not positive definite.
    """
    low, high = (bound if bound.shape == p.shape else np.broadcast_to(bound, p.shape) for bound in (low, high))
    problem = _Problem(M, p, low, high, (low == 0) & (high == 0))
    states = np.where(problem.free, 1, np.sign(p if guess is None else guess).astype(np.intp))
    fewest, patience = np.array([p.shape[-1] + 1]), np.array([_PATIENCE])
    v, rows = np.empty_like(p), np.arange(len(p))
    for _ in range(_MAX_EXCHANGES):
        v[rows] = tried = problem.velocities(states)
        wanted = problem.required_states(tried, states)
        wrong = wanted != states
        if not np.count_nonzero(wrong):
            return v + 0.0  # turns −0 into 0
        count = wrong.sum(-1)
        patience = np.where(count < fewest, _PATIENCE, patience - 1)
        fewest = np.minimum(fewest, count)
        changed = np.where(patience[:, None] < 0, _keep_last(wrong), wrong)
        states = np.where(changed, wanted, states)
        if not count.all():
            left = count > 0
            problem = problem.select(left)
            rows, states, fewest, patience = rows[left], states[left], fewest[left], patience[left]
    raise SimulationError("the friction of some rollouts did not settle; is the mass matrix positive definite?")


class _Problem(NamedTuple):
    """The problems M (N, n, n), p, low and high (N, n) of some mechanisms; ``free`` joints (N, n) never stick."""

    M: Array
    p: Array
    low: Array
    high: Array
    free: NDArray[np.bool_]

    def select(self, rows: NDArray[np.bool_]) -> _Problem:
        """Return the problems of the marked ``rows`` (N,) only."""
        return _Problem(*(values[rows] for values in self))

    def velocities(self, states: _States) -> Array:
        """Solve M v = p − λ for the joints that slip; the others rest, (N, n)."""
        slips = states != 0
        count = np.count_nonzero(slips)
        if not count:  # often
            return np.zeros_like(self.p)
        momentum = self.p - np.where(states > 0, self.high, self.low)
        if count == slips.size:  # most often
            return _solve(self.M, momentum)
        M = np.where(slips[:, :, None] & slips[:, None, :], self.M, np.eye(states.shape[-1]))
        return np.where(slips, _solve(M, np.where(slips, momentum, 0.0)), 0.0)

    def required_states(self, v: Array, states: _States) -> _States:
        """Return the states that the velocities, and the impulses where joints stick, require, (N, n)."""
        wanted, sticks = np.where((v * states < 0) & ~self.free, 0, states), states == 0
        if not np.count_nonzero(sticks):
            return wanted
        # p − Mv may be a small difference of large terms: allow for their rounding, and not for more
        terms = _multiply(np.abs(self.M), np.abs(v)).max(-1)
        margin = (_ROUNDING * np.abs(self.p).max(-1) + 8 * v.shape[-1] * _EPSILON * terms)[:, None]
        needed = self.p - _multiply(self.M, v)
        released = np.where(needed > self.high + margin, 1, np.where(needed < self.low - margin, -1, 0))
        return np.where(sticks, released, wanted)


def _keep_last(wrong: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark in each row only the last of the joints that are ``wrong``, (N, n)."""
    later = np.cumsum(wrong[:, ::-1], axis=-1)[:, ::-1]
    return wrong & (later == 1)


def _solve(M: Array, b: Array) -> Array:
    """Return M⁻¹b for each of N rows, (N, n), NaN where M is singular."""
    try:
        return np.linalg.solve(M, b[..., None])[..., 0]
    except np.linalg.LinAlgError:  # it ends the other rows too
        with np.errstate(invalid="ignore"):
            singular = np.linalg.slogdet(M).sign == 0
        return np.linalg.solve(np.where(singular[:, None, None], np.nan, M), b[..., None])[..., 0]


def _multiply(M: Array, x: Array) -> Array:
    """Return M x for each of N rows, (N, n)."""
    return np.einsum("kij,kj->ki", M, x)
