"""Contact of a point of the arm with walls over one time step, solved together with dry friction of the joints.

A wall pushes with the impulse λ along its normal and holds against slip by Coulomb friction. With J the row of the
point's Jacobian along the normal, J_t its two rows along the wall, and p the momentum without either,

    M v⁺ + F = p + Jᵀλ + J_tᵀλ_t,    λ = max(0, β − a J v⁺),
    |λ_t| ≤ μ λ, and λ_t = −μ λ J_t v⁺/|J_t v⁺| where it slips,

F the dry friction of the joints (:mod:`~pathcontrol.simulation.arm.dry_friction`). For λ_t = 0 this is the optimality
condition of a strictly convex problem, so that v⁺ is unique. Friction is found by weighting: λ_t = −c J_t v⁺, first
with a large c, which is the solution where the point sticks. Where that asks for more than μλ, c = μλ/|J_t v⁺| is
looked for from c = 0 on, with |J_t v⁺| and λ linear in the impulse c |J_t v⁺| through the last two solutions. Friction
may press the point to the wall or off it: while c > 0 is looked for, λ < 0 says that c is too large, not that the wall
is left. For any c ≥ 0 friction takes energy out, whether this has converged or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.arm.dry_friction import stick_slip

_HARD = 1e6  # a of what is rigid, relative to the inertia of the point: J v⁺ is 1e-6 of what it would be
_MOST, _CLOSE = 60, 1e-11  # solutions of one problem, and the relative change of v⁺ that ends them
_SMALLEST = 1e-9  # m²/(kg m²), mobility of a point that a wall cannot push


class Problem(NamedTuple):
    """Inertia M (n, n), momentum without dry friction p (n,), and bounds of the impulses of dry friction, (n,)."""

    M: Array
    p: Array
    low: Array
    high: Array

    def solve(self, weights: Sequence[tuple[float, Array, float]], guess: Array) -> Array:
        """Return v⁺ (n,) under impulses −(c J v⁺ − b) along rows J, given as (c, J, b), from a ``guess`` of it (n,)."""
        M, p = self.M.copy(), self.p.copy()
        for c, row, b in weights:
            M += c * np.outer(row, row)
            p += b * row
        return stick_slip(M[None], p[None], self.low[None], self.high[None], guess[None])[0]

    def mobility(self, row: Array) -> float:
        """Return J M⁻¹ Jᵀ [1/kg]."""
        return float(row @ np.linalg.solve(self.M, row))


class Touch(NamedTuple):
    """A wall in one step.

    Attributes:
        normal: J, the Jacobian of the point along the normal [m/rad], (n,).
        along: J_t, its two rows along the wall, (2, n).
        a: increase of λ for a slower v⁺ along the normal [kg].
        beta: β, λ for v⁺ = 0 along the normal [N s].
        friction: coefficient μ.
        hold: c with which the point sticks [kg].
    """

    normal: Array
    along: Array
    a: float
    beta: float
    friction: float
    hold: float

    def push(self, v: Array) -> float:
        """Return the impulse λ [N s] that the wall gives where the velocity is v, (n,); below 0 if it had to pull."""
        return self.beta - self.a * float(self.normal @ v)

    def slip(self, v: Array) -> float:
        """Return the speed along the wall [m/s]."""
        return float(np.hypot(*(self.along @ v)))


class Meeting(NamedTuple):
    """A point before a wall at the beginning of a step.

    Attributes:
        gap: distance from the wall along its normal [m], below 0 beyond it.
        jacobian: rows of the point's Jacobian along the normal and the two directions of the wall, (3, n).
        stiffness: k [N/m], inf for a rigid wall.
        damping: c [N s/m].
        friction: μ.
    """

    gap: float
    jacobian: Array
    stiffness: float
    damping: float
    friction: float


def touch_during(at: Meeting, problem: Problem, start: Array, t: float, h: float) -> Touch | None:
    """Return the wall in a part t [s] of a step h, from the velocity ``start`` (n,) on; ``None`` if it cannot push.

    With x the gap, Δ = t/2 J (start + v⁺) its change and c = 0 where x > 0, λ = −t (k (x + ηΔ) + c Δ/t): over all of a
    contact the wall takes energy out, for 1/2 ≤ η ≤ 1 and η = 1 where x > 0. η tends to 1/2, the rule of second order,
    where the step resolves the spring, and to 1 where it does not.
    """
    row, w = at.jacobian[0], problem.mobility(at.jacobian[0])
    if w < _SMALLEST:
        return None
    stiffness, inside = at.stiffness, at.gap <= 0
    eta = 1.0 - 0.5 / (1.0 + h * h * stiffness * w) if inside else 1.0
    a = 0.5 * t * (t * stiffness * eta + (at.damping if inside else 0.0))
    hard = _HARD / w
    if a > hard:
        return _touch(at, problem, hard, -hard * (2.0 * max(at.gap, 0.0) / t + float(row @ start)))
    return _touch(at, problem, a, -t * stiffness * at.gap - a * float(row @ start))


def touch_at_once(at: Meeting, problem: Problem, v: Array, h: float) -> Touch | None:
    """Return the wall as it takes away, at once, the approach that a step h is too long for; ``None`` if none is.

    An approach J v faster than −2x/h, with which the point would come to rest at the wall at the end of the step, is
    brought down to it by the share 1 − 1/(1 + (h²k J M⁻¹Jᵀ)²), all of it for a rigid wall: the impact is inelastic.
    """
    row, w = at.jacobian[0], problem.mobility(at.jacobian[0])
    speed, goal = float(row @ v), -2.0 * max(at.gap, 0.0) / h
    if w < _SMALLEST or speed >= goal:
        return None
    left = 1.0 / (1.0 + (h * h * at.stiffness * w) ** 2)
    hard = _HARD / w
    return _touch(at, problem, hard, hard * (goal + left * (speed - goal)))


def _touch(at: Meeting, problem: Problem, a: float, beta: float) -> Touch:
    """Return the wall with the directions along it, and what holds the point there."""
    along = at.jacobian[1:]
    w = sum(problem.mobility(row) for row in along) if at.friction else 0.0
    return Touch(at.jacobian[0], along, a, beta, at.friction, _HARD / w if w >= _SMALLEST else 0.0)


def solve_contact(problem: Problem, touches: Sequence[Touch], v: Array) -> Array:
    """Return v⁺ (n,) with walls, from the solution v without them; v itself where none is met."""
    pushed = [touch.push(v) > 0 for touch in touches]
    if not any(pushed):
        return v
    zero = [0.0] * len(touches)
    free = _iterate(problem, touches, v, zero, pushed, most=2 * len(touches) + 2, slips=False)
    if not any(touch.friction and touch.hold for touch in touches):
        return free
    hold = [touch.hold if touch.friction else 0.0 for touch in touches]
    pushed = [touch.push(free) > 0 for touch in touches]
    stuck = _iterate(problem, touches, free, hold, pushed, most=2 * len(touches) + 2, slips=False)
    if all(c * touch.slip(stuck) <= touch.friction * touch.push(stuck) for c, touch in zip(hold, touches, strict=True)):
        return stuck
    return _iterate(problem, touches, free, _weigh(touches, free), pushed, most=_MOST, slips=True)


def _iterate(
    problem: Problem, touches: Sequence[Touch], v: Array, c: list[float], pushed: list[bool], most: int, slips: bool
) -> Array:
    """Return v⁺ (n,) with the walls that push found, and, where the point ``slips``, with friction by weighting."""
    before = [(0.0, touch.slip(v), touch.push(v)) for touch in touches]
    for left in reversed(range(most)):
        weights = [(t.a, t.normal, t.beta) for t, on in zip(touches, pushed, strict=True) if on]
        for touch, weight, on in zip(touches, c, pushed, strict=True):
            if on and weight:
                weights += [(weight, row, 0.0) for row in touch.along]
        last, v = v, problem.solve(weights, v)
        now = [touch.push(v) > 0 or (on and w > 0) for touch, on, w in zip(touches, pushed, c, strict=True)]
        if now == pushed and (not slips or np.abs(v - last).max() <= _CLOSE * np.abs(v).max()):
            break
        pushed = now
        if slips:
            known = [(weight, touch.slip(v), touch.push(v)) for weight, touch in zip(c, touches, strict=True)]
            c, before = _weigh(touches, v, before, known), known
            if left <= 2 * len(touches) + 2:  # it does not converge: at the end no wall pulls
                c = [0.0 if push <= 0 else weight for weight, _, push in known]
    return v


def _weigh(
    touches: Sequence[Touch],
    v: Array,
    before: Sequence[tuple[float, float, float]] = (),
    known: Sequence[tuple[float, float, float]] = (),
) -> list[float]:
    """Return c with c |J_t v⁺| = μλ of each wall, by the last two c, |J_t v⁺| and λ, no more than what holds."""
    found = []
    for k, touch in enumerate(touches):
        bound, slip = touch.friction * touch.push(v), touch.slip(v)
        c = bound / slip if slip > 0 else touch.hold
        if known:
            (c0, s0, p0), (c1, s1, p1) = before[k], known[k]
            change = c1 * s1 - c0 * s0
            if (s0 - s1) * change > 0:
                w, lift = (s0 - s1) / change, touch.friction * (p0 - p1) / change
                if lift > -1.0:
                    bound = (bound + lift * c1 * s1) / (1.0 + lift)
                rest = s1 + (c1 * s1 - bound) * w
                c = bound / rest if rest > 0 else touch.hold
        found.append(max(0.0, min(touch.hold, c)))
    return found
