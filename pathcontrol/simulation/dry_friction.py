"""Set-valued dry friction over one time step, solved exactly for any number of joints.

Over a step the momentum p = Mv a mechanism would have without dry friction is shared between motion and friction,

    M v⁺ + λ = p,    λ_i = high_i if v⁺_i > 0,  low_i if v⁺_i < 0,  λ_i ∈ [low_i, high_i] if v⁺_i = 0,

the optimality condition of a strictly convex problem: v⁺ exists and is unique. It is found by block principal
pivoting on which joints stick: finitely many linear solves, no iteration error. Where blocks of exchanges make no
progress, single exchanges by Murty's least-index rule guarantee the end (Júdice and Pires, Computers & Operations
Research 21, 1994).

One rollout is solved with plain numbers, which is fast where there are few, and N with columns (N,) of them: the same
operations on the same numbers in the same order, and so the same result to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from math import nan
from operator import add
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import SimulationError

_FEW = 5  # rows up to which plain numbers are faster
_PATIENCE = 3  # block exchanges without progress before single ones
_MAX_EXCHANGES = 10_000
_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDING = 1e-12  # relative to the largest momentum; a joint this close to slipping may stick

_Entry = Any  # a number, or a column of them
_States = list[_Entry]  # +1 slips forward, −1 slips backward, 0 sticks; one for each joint


def stick_slip(M: Array, p: Array, low: Array, high: Array, guess: Array | None = None) -> Array:
    """Velocity v⁺ [rad/s] after a step with dry friction.

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
    guess = np.sign(p if guess is None else guess).astype(np.int8)
    if len(p) <= _FEW:
        return np.array([_alone(row, M, p, low, high, guess) for row in range(len(p))]).reshape(p.shape) + 0.0
    columns = _Columns(*map(np.ascontiguousarray, (M.transpose(1, 2, 0), p.T, low.T, high.T)))
    v = columns.velocities(states := columns.possible(list(guess.T)))
    wrong = np.flatnonzero(sum(a != b for a, b in zip(columns.wanted(v, states), states, strict=True)))
    if len(wrong) > _FEW:
        v[:, wrong] = _settled(columns.some(wrong), [state[wrong] for state in states])
    else:
        for row in wrong.tolist():
            v[:, row] = _alone(row, M, p, low, high, guess)
    return np.add(v.T, 0.0, order="C")  # which makes 0 of −0, whose sign would depend on the number of rows


def _alone(row: int, *arrays: Array) -> list[float]:
    """v⁺ of one row of M, p, low, high and the guess; there may be one row of these for all."""
    M, p, low, high, guess = (a[row if len(a) > 1 else 0].tolist() for a in arrays)
    try:
        return _settled(_Numbers(M, p, low, high), guess)
    except ZeroDivisionError:  # M is singular
        return [nan] * len(p)


def _settled(problem: _Numbers, guess: _States) -> Any:
    """v⁺, from a guess of its signs."""
    where, states = problem.where, problem.possible(guess)
    fewest, patience = len(states) + 1, _PATIENCE
    for _ in range(_MAX_EXCHANGES):
        v = problem.velocities(states)
        wanted = problem.wanted(v, states)
        wrong = [a != b for a, b in zip(wanted, states, strict=True)]
        count = sum(wrong)
        if not problem.any(count):
            return v
        better = count < fewest
        fewest, patience = where(better, count, fewest), where(better, _PATIENCE, patience - 1)
        changed = _last_only(wrong, patience < 0)
        states = [where(*each) for each in zip(changed, wanted, states, strict=True)]
    raise SimulationError("the friction of some rollouts did not settle; is the mass matrix positive definite?")


def _last_only(wrong: list[_Entry], single: _Entry) -> list[_Entry]:
    """Those that are ``wrong``; where there is to be a ``single`` one, the last of them."""
    kept, later = [], False
    for off in reversed(wrong):
        kept.append((off > later) | (off & (single == 0)))
        later = later | off
    return kept[::-1]


class _Numbers:
    """M (n × n), p, low and high (n each) of one rollout, lists of numbers."""

    def __init__(self, M: Any, p: Any, low: Any, high: Any) -> None:
        self.M, self.p, self.low, self.high = M, p, low, high
        self.free = [(a == 0) & (b == 0) for a, b in zip(low, high, strict=True)]

    def any(self, entry: _Entry) -> bool:
        """Whether it is not 0, or somewhere not."""
        return bool(entry)

    def where(self, condition: _Entry, a: _Entry, b: _Entry) -> _Entry:
        """One of two entries."""
        return a if condition else b

    def possible(self, states: _States) -> _States:
        """Joints without dry friction never stick."""
        return [self.where(free, 1, state) for free, state in zip(self.free, states, strict=True)]

    def velocities(self, states: _States) -> Any:
        """M v = p − λ for the joints that slip, by elimination, without pivots as M is positive definite."""
        n, U = len(states), [row[:] for row in self.M]
        b = [self.p[i] - (self.high[i] if states[i] > 0 else self.low[i]) for i in range(n)]
        slips = [i for i in range(n) if states[i]]
        for at, k in enumerate(slips):
            for i in slips[at + 1 :]:
                share = U[k][i] / U[k][k]
                for j in slips[at + 1 :]:
                    U[i][j] -= share * U[k][j]
                b[i] -= share * b[k]
        v = [0.0] * n
        for k in reversed(slips):
            v[k] = b[k] / U[k][k]
            for i in slips:
                b[i] -= U[i][k] * v[k]
        return v

    def wanted(self, v: Any, states: _States) -> _States:
        """The states that the velocities, and the impulses where joints stick, call for."""
        products = [[m * x for m, x in zip(row, v, strict=True)] for row in self.M]
        # p − Mv may be a small difference of large terms: allow for their rounding, and not for more
        terms = max(_in_order([abs(term) for term in row]) for row in products)
        margin = _ROUNDING * max(map(abs, self.p)) + 8 * len(v) * _EPSILON * terms
        wanted = []
        for i, state in enumerate(states):
            needed = self.p[i] - _in_order(products[i])
            released = (needed > self.high[i] + margin) - (needed < self.low[i] - margin)
            wanted.append(state if self.free[i] else (0 if v[i] * state < 0 else state) if state else released)
        return wanted


class _Columns(_Numbers):
    """The same of N rollouts, (n, n, N) and (n, N): the same operations on every number, in the same order."""

    def any(self, entry: Array) -> bool:
        return bool(entry.any())

    def where(self, condition: Array, a: _Entry, b: _Entry) -> Array:
        return np.asarray(np.where(condition, a, b))

    def some(self, columns: Array) -> _Columns:
        """Only some of the rollouts."""
        return _Columns(*(a[..., columns] if a.shape[-1] > 1 else a for a in (self.M, self.p, self.low, self.high)))

    def velocities(self, states: _States) -> Array:
        signs, U, v = np.array(states), self.M.copy(), np.empty_like(self.p)
        b = self.p - np.where(signs > 0, self.high, self.low)
        slips = (signs != 0).astype(np.float64)
        for k in range(len(v) - 1):
            after = slice(k + 1, None)
            share = U[k, after] / U[k, k] * slips[after] * slips[k]
            U[after, after] -= share[:, None] * U[k, after]
            b[after] -= share * b[k]
        for k in reversed(range(len(v))):
            v[k] = b[k] / U[k, k] * slips[k]
            b[:k] -= U[:k, k] * v[k]
        v[signs == 0] = 0.0
        return v

    def wanted(self, v: Array, states: _States) -> _States:
        signs, products = np.array(states), self.M * v
        terms = _in_order(np.abs(products).swapaxes(0, 1)).max(0)
        margin = _ROUNDING * np.abs(self.p).max(0) + 8 * len(v) * _EPSILON * terms
        needed = self.p - _in_order(products.swapaxes(0, 1))
        released = (needed > self.high + margin).astype(np.int8) - (needed < self.low - margin)
        wanted = np.where(signs == 0, released, np.where(v * signs < 0, 0, signs))
        return list(np.where(self.free, signs, wanted))


def _in_order(terms: Sequence[_Entry]) -> _Entry:
    """Their sum, one after the other; ``sum`` of Python 3.12 rounds better, and so otherwise than arrays do."""
    return reduce(add, terms)
