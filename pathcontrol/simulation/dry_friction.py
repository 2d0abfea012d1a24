"""Set-valued dry friction over one time step, solved exactly for any number of joints.

Over a step the momentum p = Mv a mechanism would have without dry friction is shared between motion and friction,

    M v⁺ + λ = p,    λ_i = high_i if v⁺_i > 0,  low_i if v⁺_i < 0,  λ_i ∈ [low_i, high_i] if v⁺_i = 0,

the optimality condition of a strictly convex problem: v⁺ exists and is unique. It is found by block principal
pivoting on which joints stick: finitely many linear solves, no iteration error. Where blocks of exchanges make no
progress, single exchanges by Murty's least-index rule guarantee the end (Júdice and Pires, Computers & Operations
Research 21, 1994).

Everything is written for the entries of vectors and matrices one by one. They are numbers for one rollout and columns,
(N,), for N: the same operations in the same order, and so the same result to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import SimulationError

_PATIENCE = 3  # block exchanges without progress before single ones
_MAX_EXCHANGES = 10_000
_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDING = 1e-12  # relative to the largest momentum; a joint this close to slipping may stick

_Entry = Any  # a number or a column of them


class _Problem(NamedTuple):
    M: Sequence[Sequence[_Entry]]
    p: Sequence[_Entry]
    low: Sequence[_Entry]  # ≤ 0
    high: Sequence[_Entry]  # ≥ 0
    where: Callable[[_Entry, _Entry, _Entry], _Entry]


def stick_slip(M: Array, p: Array, low: Array, high: Array, guess: Array | None = None) -> Array:
    """Velocity v⁺ [rad/s] after a step with dry friction.

    Args:
        M: inertia matrix [kg m²], (N, n, n), symmetric positive definite.
        p: momentum without dry friction [N m s], (N, n).
        low: least friction impulse [N m s], (N, n) or (1, n), ≤ 0.
        high: greatest friction impulse [N m s], (N, n) or (1, n), ≥ 0.
        guess: the sign that v⁺ may have, (N, n), by default that of p; a good one saves time and changes nothing else.

    Returns:
        v⁺, (N, n); exactly 0 for joints that stick.

    Raises:
        SimulationError: M is not positive definite.
    """
    guess = p if guess is None else guess
    if len(p) == 1:
        numbers = (a[0].tolist() for a in (M, p, low, high))
        return np.array([_settled(_Problem(*numbers, _either), [(g > 0) - (g < 0) for g in guess[0].tolist()], bool)])
    columns = (np.ascontiguousarray(np.moveaxis(a, 0, -1)) for a in (M, p, low, high))
    return np.stack(_settled(_Problem(*columns, np.where), [*np.sign(guess).astype(np.int8).T], np.any), axis=-1)


def _either(condition: bool, a: float, b: float) -> float:
    return a if condition else b


def _settled(problem: _Problem, states: list[_Entry], some: Callable[[_Entry], Any]) -> list[_Entry]:
    """v⁺, from a guess of its signs: +1 slips forward, −1 slips backward, 0 sticks."""
    where, free = problem.where, [(a == 0) & (b == 0) for a, b in zip(problem.low, problem.high, strict=True)]
    # joints without dry friction never stick
    states = [where(never, 1, state) for never, state in zip(free, states, strict=True)]
    fewest, patience = len(states) + 1, _PATIENCE
    for _ in range(_MAX_EXCHANGES):
        v = _velocities(problem, states)
        wanted = _wanted(problem, v, states, free)
        wrong = [a != b for a, b in zip(wanted, states, strict=True)]
        count = sum(wrong)
        if not some(count):
            return v
        better = count < fewest
        fewest, patience = where(better, count, fewest), where(better, _PATIENCE, patience - 1)
        states = _exchanged(where, states, wanted, wrong, patience < 0)
    raise SimulationError("the friction of some rollouts did not settle; is the mass matrix positive definite?")


def _exchanged(where: Callable[..., _Entry], states: Any, wanted: Any, wrong: Any, single: _Entry) -> list[_Entry]:
    """The states, where they are ``wrong`` as ``wanted``; of a ``single`` exchange only the last of them."""
    new, later = [], False
    for state, other, off in zip(reversed(states), reversed(wanted), reversed(wrong), strict=True):
        new.append(where(off & (1 - (single & later)), other, state))
        later = later | off
    return new[::-1]


def _velocities(problem: _Problem, states: Sequence[_Entry]) -> list[_Entry]:
    """M v = p − λ for the joints that move, by elimination without exchanges, as M is positive definite; others rest."""
    M, p, low, high, where = problem
    n, moving = len(p), [state != 0 for state in states]
    U = [list(row) for row in M]
    b = [p[i] - where(states[i] > 0, high[i], low[i]) for i in range(n)]
    for k in range(n):
        for i in range(k + 1, n):
            share = where(moving[i] & moving[k], U[k][i] / U[k][k], 0.0)
            for j in range(i, n):
                U[i][j] = U[i][j] - share * U[k][j]
            b[i] = b[i] - share * b[k]
    v: list[_Entry] = [0.0] * n
    for k in reversed(range(n)):
        rest = b[k]
        for j in range(k + 1, n):
            rest = rest - U[k][j] * v[j]
        v[k] = where(moving[k], rest / U[k][k], 0.0)
    return v


def _wanted(problem: _Problem, v: Sequence[_Entry], states: Sequence[_Entry], free: Sequence[_Entry]) -> list[_Entry]:
    """The states that the velocities, and the impulses where joints stick, call for."""
    M, p, low, high, where = problem
    joints = range(len(p))
    needed = [p[i] - sum(M[i][j] * v[j] for j in joints) for i in joints]
    # p − Mv may be a small difference of large terms: allow for their rounding, and not for more
    terms = _largest(where, [sum(abs(M[i][j]) * abs(v[j]) for j in joints) for i in joints])
    margin = _ROUNDING * _largest(where, [abs(x) for x in p]) + 8 * len(p) * _EPSILON * terms
    wanted = []
    for i, state in enumerate(states):
        released = where(needed[i] > high[i] + margin, 1, where(needed[i] < low[i] - margin, -1, 0))
        onward = where(v[i] * state < 0, 0, state)
        wanted.append(where(free[i], state, where(state == 0, released, onward)))
    return wanted


def _largest(where: Callable[..., _Entry], values: Sequence[_Entry]) -> _Entry:
    largest = values[0]
    for value in values[1:]:
        largest = where(value > largest, value, largest)
    return largest
