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
_EPSILON = np.finfo(np.float64).eps
_ROUNDING = 1e-12  # relative to the largest momentum; a joint this close to slipping may stick

_States = NDArray[np.int8]  # +1 slips forward, −1 slips backward, 0 sticks


class _Problem(NamedTuple):
    M: Array  # (N, n, n)
    p: Array  # (N, n)
    low: Array  # (N, n), ≤ 0
    high: Array  # (N, n), ≥ 0
    free: NDArray[np.bool_]  # (N, n): joints without dry friction never stick

    def rows(self, index: NDArray[np.intp]) -> _Problem:
        return _Problem(*(a[index] for a in self))


def stick_slip(M: Array, p: Array, low: Array, high: Array, guess: Array | None = None) -> Array:
    """Velocity v⁺ [rad/s] after a step with dry friction.

    Args:
        M: inertia matrix [kg m²], (N, n, n), symmetric positive definite.
        p: momentum without dry friction [N m s], (N, n).
        low: least friction impulse [N m s], (N, n), ≤ 0.
        high: greatest friction impulse [N m s], (N, n), ≥ 0.
        guess: the sign that v⁺ may have, (N, n), by default that of p; a good one saves time and changes nothing else.

    Returns:
        v⁺, (N, n); exactly 0 for joints that stick.
    """
    problem = _Problem(M, p, low, high, (low == 0) & (high == 0))
    states = np.sign(p if guess is None else guess).astype(np.int8)
    states[problem.free] = 1
    v, wanted = _solve(problem, states)
    wrong = np.flatnonzero((wanted != states).any(-1))
    if wrong.size:
        v[wrong] = _exchanged(problem.rows(wrong), states[wrong], wanted[wrong])
    return v


def _exchanged(problem: _Problem, states: _States, wanted: _States) -> Array:
    """v⁺, from states that call for others."""
    N, n = states.shape
    v, active = np.empty((N, n)), np.arange(N)
    fewest, patience = np.full(N, n + 1), np.full(N, _PATIENCE)
    for _ in range(_MAX_EXCHANGES):
        violated = wanted != states[active]
        count = violated.sum(-1)
        better = count < fewest[active]
        fewest[active] = np.where(better, count, fewest[active])
        patience[active] = np.where(better, _PATIENCE, patience[active] - 1)
        single = patience[active] < 0
        violated[single] &= _last_only(violated[single])
        states[active] = np.where(violated, wanted, states[active])
        active = active[count > 0]
        if not active.size:
            return v
        v[active], wanted = _solve(problem.rows(active), states[active])
    raise SimulationError(
        f"the friction of {active.size} rollouts did not settle; is the mass matrix positive definite?"
    )


def _solve(problem: _Problem, states: _States) -> tuple[Array, _States]:
    """Velocities for the given sticking joints, and the states that those velocities and impulses call for."""
    M, p, low, high, free = problem
    stick = states == 0
    impulse = np.where(states > 0, high, low)
    reduced = np.where(stick[:, :, None] | stick[:, None, :], 0.0, M)
    reduced += stick[:, :, None] * np.eye(p.shape[1])
    v = np.linalg.solve(reduced, np.where(stick, 0.0, p - impulse)[..., None])[..., 0]
    v[stick] = 0.0
    needed = p - np.einsum("kij,kj->ki", M, v)
    # p − Mv may be a small difference of large terms: allow for their rounding, and not for more
    terms = np.einsum("kij,kj->ki", np.abs(M), np.abs(v)).max(-1, keepdims=True)
    margin = _ROUNDING * np.abs(p).max(-1, keepdims=True) + 8 * p.shape[1] * _EPSILON * terms
    released = (needed > high + margin).astype(np.int8) - (needed < low - margin)
    wanted = np.where(stick, released, np.where(v * states < 0, 0, states))
    return v, np.where(free, states, wanted)


def _last_only(violated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of each row's violations, the one with the greatest index."""
    n = violated.shape[1]
    last = n - 1 - np.argmax(violated[:, ::-1], axis=1)
    return np.arange(n) == last[:, None]
