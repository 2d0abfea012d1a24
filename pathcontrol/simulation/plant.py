"""The simulated arm: rigid-body dynamics with friction that really sticks, at a fixed step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import levels_vary
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.damping import Damping
from pathcontrol.simulation.dry_friction import stick_slip
from pathcontrol.simulation.mobility import mobility

_ZERO, _ONLY = np.array(0.0), np.array([0])

#: rate of viscous friction [1/s] up to which the trapezoidal rule does: that is off by (h × rate)²/12, 1e-5 in 2.5 ms
_WEAK = 4.0

_Rows = slice | NDArray[np.intp]
_Dry = tuple[Array, Array, Array]  # friction of forward and of backward motion, and that of the present direction


class Plant:
    """M(q)q̈ + C(q,q̇)q̇ + g(q) + b q̇ + F(q̇) ∋ τ over steps of ``step`` seconds, F the set-valued dry friction.

    With B = diag(b), let P(v; h, M̃, q, u) be the only velocity v⁺ with

        M̃(v⁺ − v) + λ = h (τ − Bv − C(q,u)u − g(q)),   λ_i ∈ h F_i(v_i⁺) for each joint i

    (:func:`stick_slip`). One step of h is

        v_m = P(v; h/2, M(q) + h/2 B, q, v),   q_m = q + h/4 (v + v_m),
        v⁺ = P(v; h, M̃(q_m), q_m, v_m),        q⁺ = q + h/2 (v + v⁺) + XB(v⁺ − v),

    where M̃ = M + h/2 B + BXB condenses what viscous friction does in h while all else is constant, as
    :class:`Damping` says: under a constant torque a joint alone gets to v⁺ = v∞ + R(x)(v − v∞) with x = h b/M and
    |R(x) − e⁻ˣ| < 0.0009. So nothing rings, for any b: 0 ≤ R < 1, and R → 0 for b → ∞. The step is of second order
    where no joint changes between sticking and slipping, and a joint that sticks does not creep at all.

    For arms whose viscous friction is weak, tr(M⁻¹B) ≤ 4 1/s in every posture tried, X is 0: the trapezoidal rule.

    Args:
        robot: the arm, or one for each rollout; its ``friction`` is the friction of the plant.
        step: h [s].
    """

    def __init__(self, robot: RobotModel | RobotBatch, step: float) -> None:
        expect("robot", robot, RobotModel, RobotBatch)
        self.robot, self.step = robot, step
        # rows, (1, n), and numbers as arrays, (), which NumPy joins to those of a single rollout far faster than others
        self._viscous = np.atleast_2d(robot.friction.viscous)
        self._whole, self._half, self._quarter = np.array(step), np.array(0.5 * step), np.array(0.25 * step)
        self._steady = None if levels_vary(robot.friction) else self._levels_at(np.zeros((1, robot.n)))
        self._inertia = arm = robot.with_armature(0.5 * step * robot.friction.viscous)
        self._of_one = arm.forward_dynamics if isinstance(arm, RobotBatch) else arm.forward_dynamics_of_one
        strong, rows = has_strong_friction(robot), self._viscous
        self._damped: _Rows = slice(None) if strong.all() else np.flatnonzero(strong)
        self._damping = Damping(rows if len(rows) == 1 else rows[self._damped], step)

    def _levels_at(self, qd: Array) -> tuple[Array, Array]:
        """Dry friction of forward and of backward motion, F⁺ and −F⁻ [N m], as rows."""
        plus, minus = self.robot.friction.levels(qd)
        return np.atleast_2d(plus), -np.atleast_2d(minus)

    def advance(self, q: Array, qd: Array, tau: Array) -> tuple[Array, Array]:
        """(q, q̇) one step later under the constant torque ``tau``; all (N, n)."""
        drive, dry = tau - self._viscous * qd, self._dry(qd)
        middle_qd = self._free(q, qd, qd, drive, dry, self._half)
        turned = self._hinder(middle_qd, q, qd, dry, self._half)
        if turned or self._steady is None:  # else it is what it was
            dry = self._dry(middle_qd)
        middle_q = q + self._quarter * (qd + middle_qd)
        next_qd = self._free(middle_q, middle_qd, qd, drive, dry, self._whole)
        if isinstance(self._damped, slice) or len(self._damped):
            inertia, travel = self._condense(middle_q, qd, next_qd, dry, middle_qd)
            self._hinder(next_qd, middle_q, middle_qd, dry, self._whole, inertia)
            next_q = q + self._half * (qd + next_qd)
            next_q[self._damped] += self._whole * _times(travel, (next_qd - qd)[self._damped])
            return next_q, next_qd
        self._hinder(next_qd, middle_q, middle_qd, dry, self._whole)
        return q + self._half * (qd + next_qd), next_qd

    def _dry(self, qd: Array) -> _Dry:
        """Dry friction of forward and of backward motion, and in the direction of q̇, or any where that is 0."""
        forward, backward = self._steady or self._levels_at(qd)
        return forward, backward, np.where(qd > _ZERO, forward, backward)

    def _free(self, q: Array, u: Array, start: Array, drive: Array, dry: _Dry, duration: Array) -> Array:
        """The velocity a ``duration`` after ``start`` if no joint turns or stops, by the trapezoidal rule, (N, n)."""
        forward_dynamics = self._of_one if len(q) == 1 else self._inertia.forward_dynamics
        return start + duration * forward_dynamics(q, u, drive - dry[2])

    def _condense(self, q: Array, qd: Array, v: Array, dry: _Dry, middle_qd: Array) -> tuple[Array, Array]:
        """M̃(q) and XB/h, (k, n, n), of rows with strong viscous friction, whose ``v`` becomes what it ought to be."""
        rows, one = self._damped, len(self._viscous) == 1
        M = _mass_matrix(self.robot, q[rows], np.arange(len(q))[rows])
        inertia, travel = self._damping.condense(M, ((qd != _ZERO) | (middle_qd != _ZERO) | (dry[0] <= dry[1]))[rows])
        change = (v - qd)[rows]
        momentum = _times(M, change) + self._half * (self._viscous if one else self._viscous[rows]) * change
        v[rows] = qd[rows] + np.linalg.solve(inertia, momentum[..., None])[..., 0]
        return inertia, travel

    def _hinder(self, v: Array, q: Array, u: Array, dry: _Dry, duration: Array, damped: Array | None = None) -> bool:
        """Stop joints of ``v`` that dry friction does not let turn since ``u``, and tell whether one was to turn.

        With the M̃ of the rows of strong viscous friction where these are ``damped``, (k, n, n).
        """
        forward, backward, friction = dry
        turned = v * u <= _ZERO
        if not np.count_nonzero(turned):
            return False
        # a diverged arm must not be taken for one that sticks
        turned &= np.isfinite(v) & (forward > backward)
        if not np.count_nonzero(turned):
            return True
        rows = _ONLY if len(v) == 1 else np.flatnonzero(turned.any(-1))
        M, impulse = self._inertia_of(q, rows, damped), duration * friction[rows]
        # whatever friction a joint at rest got, it is taken back here
        momentum = _times(M, v[rows]) + impulse
        low, high = (duration * (level if len(level) == 1 else level[rows]) for level in (backward, forward))
        v[rows] = stick_slip(M, momentum, low, high, guess=np.where(turned[rows], _ZERO, u[rows]))
        return True

    def _inertia_of(self, q: Array, rows: NDArray[np.intp], damped: Array | None) -> Array:
        """M + h/2 B of some ``rows`` (k,), or their M̃ where it is among ``damped``, (k, n, n)."""
        if damped is None:
            return _mass_matrix(self._inertia, q[rows], rows)
        if isinstance(self._damped, slice):
            return damped[rows]
        at = np.searchsorted(self._damped, rows).clip(max=len(damped) - 1)
        M, others = damped[at], self._damped[at] != rows
        if others.any():
            M[others] = _mass_matrix(self._inertia, q[rows[others]], rows[others])
        return M


def has_strong_friction(robot: RobotModel | RobotBatch) -> NDArray[np.bool_]:
    """Return for which arms the trapezoidal rule of viscous friction does not do, (N,), or (1,) for the arm of all."""
    viscous = np.atleast_2d(robot.friction.viscous)
    if not viscous.any():
        return np.zeros(1, dtype=bool)
    return np.asarray((mobility(robot) * viscous).sum(-1).max(0) > _WEAK)


def _mass_matrix(robot: RobotModel | RobotBatch, q: Array, rows: NDArray[np.intp]) -> Array:
    """M of the arms of some ``rows`` (k,), at q (k, n)."""
    return robot.mass_matrix(q, rows) if isinstance(robot, RobotBatch) else robot.mass_matrix(q)


def _times(M: Array, x: Array) -> Array:
    """M x for each of k rows, (k, n)."""
    return np.einsum("kij,kj->ki", M, x)
