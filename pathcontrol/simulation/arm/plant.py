"""The simulated arm: rigid-body dynamics with exact stiction, at a fixed step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import levels_of, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.damping import Damping
from pathcontrol.simulation.arm.dry_friction import stick_slip
from pathcontrol.simulation.checks.mobility import mobility

#: rate of viscous friction [1/s] up to which the trapezoidal rule suffices: its error is (h × rate)²/12, 1e-5 in 2.5 ms
_WEAK = 4.0

_Rows = NDArray[np.intp]
_Held = NDArray[np.bool_]  # joints that are held still, (N, n)
_Dry = tuple[Array, Array, Array]  # friction of forward and of backward motion, and (N, n) of the present direction


class Plant:
    """The arm M(q)q̈ + C(q,q̇)q̇ + g(q) + b q̇ + F(q̇) ∋ τ, in steps of ``step`` [s], F the set-valued dry friction.

    With B = diag(b), let P(v; h, M̃, q, u) be the only velocity v⁺ with

        M̃(v⁺ − v) + λ = h (τ − Bv − C(q,u)u − g(q)),   λ_i ∈ h F_i(v_i⁺) for each joint i

    (:func:`stick_slip`). One step of h is

        v_m = P(v; h/2, M(q) + h/2 B, q, v),   q_m = q + h/4 (v + v_m),
        v⁺ = P(v; h, M̃(q_m), q_m, v_m),        q⁺ = q + h/2 (v + v⁺) + XB(v⁺ − v),

    where M̃ = M + h/2 B + BXB condenses the effect of viscous friction in h while all else is constant, see
    :class:`Damping`: under a constant torque a joint alone gets to v⁺ = v∞ + R(x)(v − v∞) with x = h b/M and
    |R(x) − e⁻ˣ| < 0.0009. So nothing rings, for any b: 0 ≤ R < 1, and R → 0 for b → ∞. The step is of second order
    where no joint changes between sticking and slipping, and a joint that sticks does not creep at all.

    For arms whose viscous friction is weak, tr(M⁻¹B) ≤ 4 1/s in every posture tried, X is 0: the trapezoidal rule.

    Joints that are held are stopped at the beginning of a step, which leaves (Mv)_i of all others as it was, and then
    stand still: M has no entries between them and others, and nothing drives them.

    Args:
        robot: the arm, or one for each rollout; its ``friction`` is the friction of the plant.
        step: h [s].
    """

    def __init__(self, robot: RobotModel | RobotBatch, step: float) -> None:
        expect("robot", robot, RobotModel, RobotBatch)
        self.robot, self.step = robot, step
        self._viscous = viscous_of(robot.friction)
        self._inertia = robot.with_armature(0.5 * step * self._viscous)
        self._strong = has_strong_friction(robot)
        self._damps = bool(self._strong.any())

    def advance(self, q: Array, qd: Array, tau: Array, held: _Held | None = None) -> tuple[Array, Array]:
        """Return (q, q̇) one step later under the constant torque ``tau``, with ``held`` joints; all (N, n)."""
        held = None if held is None or not held.any() else np.broadcast_to(held, q.shape)
        if held is not None and qd[held].any():
            qd = _hold(self.robot, q, qd, held)
        h, drive, dry = self.step, tau - self._viscous * qd, self._dry_friction(qd, held)
        middle_qd = self._advance_freely(q, qd, qd, drive, dry, 0.5 * h, held)
        self._apply_stiction(middle_qd, q, qd, dry, 0.5 * h, held)
        dry = self._dry_friction(middle_qd, held)
        middle_q = q + 0.25 * h * (qd + middle_qd)
        next_qd = self._advance_freely(middle_q, middle_qd, qd, drive, dry, h, held)
        if not self._damps:
            self._apply_stiction(next_qd, middle_q, middle_qd, dry, h, held)
            return q + 0.5 * h * (qd + next_qd), next_qd
        damped = np.flatnonzero(np.broadcast_to(self._strong, len(q)))
        inertia, travel = self._condense(damped, middle_q, qd, next_qd, dry, middle_qd, held)
        self._apply_stiction(next_qd, middle_q, middle_qd, dry, h, held, (damped, inertia))
        next_q = q + 0.5 * h * (qd + next_qd)
        next_q[damped] += h * _multiply(travel, (next_qd - qd)[damped])
        return next_q, next_qd

    def _dry_friction(self, qd: Array, held: _Held | None) -> _Dry:
        """Return the dry friction of forward and of backward motion, and that in the direction of q̇, (N, n).

        The first two broadcast against q̇ (N, n); where q̇ is 0 the third is either of them. Held joints have none.
        """
        forward, minus = levels_of(self.robot.friction, qd)
        backward = np.subtract(0.0, minus)
        if held is not None:
            forward, backward = np.where(held, 0.0, forward), np.where(held, 0.0, backward)
        return forward, backward, np.where(qd > 0, forward, backward)

    def _advance_freely(
        self, q: Array, u: Array, start: Array, drive: Array, dry: _Dry, duration: float, held: _Held | None
    ) -> Array:
        """Return the velocity a ``duration`` after ``start`` if no joint turns or stops, (N, n).

        It takes the trapezoidal rule.
        """
        acceleration = self._inertia.forward_dynamics(q, u, drive - dry[2])
        return start + duration * (acceleration if held is None else _hold(self._inertia, q, acceleration, held))

    def _condense(
        self, rows: _Rows, q: Array, qd: Array, v: Array, dry: _Dry, middle_qd: Array, held: _Held | None
    ) -> tuple[Array, Array]:
        """Return M̃(q) and XB/h, (k, n, n), of ``rows`` (k,) with strong friction; correct their ``v`` in place."""
        viscous = np.broadcast_to(self._viscous, q.shape)[rows]
        M = _decouple(_mass_matrix(self.robot, q[rows], rows), held, rows)
        inertia, travel = Damping(viscous, self.step).condense(
            M, ((qd != 0) | (middle_qd != 0) | (dry[0] <= dry[1]))[rows]
        )
        change = (v - qd)[rows]
        momentum = _multiply(M, change) + 0.5 * self.step * viscous * change
        v[rows] = qd[rows] + np.linalg.solve(inertia, momentum[..., None])[..., 0]
        return inertia, travel

    def _apply_stiction(
        self,
        v: Array,
        q: Array,
        u: Array,
        dry: _Dry,
        duration: float,
        held: _Held | None,
        damped: tuple[_Rows, Array] | None = None,
    ) -> None:
        """Stop joints of ``v`` that dry friction does not let turn since ``u``.

        The inertia is M + h/2 B, and M̃ (k, n, n) for the rows (k,) that are ``damped``.
        """
        turned = v * u <= 0
        if not turned.any():  # the common case
            return
        forward, backward, friction = np.broadcast_arrays(*dry)
        # a diverged arm must not count as one that sticks
        turned &= np.isfinite(v) & (forward > backward)
        rows = np.flatnonzero(turned.any(-1))
        if not len(rows):
            return
        M = _decouple(_mass_matrix(self._inertia, q[rows], rows), held, rows)
        if damped is not None:
            _, here, there = np.intersect1d(rows, damped[0], assume_unique=True, return_indices=True)
            M[here] = damped[1][there]
        # undo the friction that a joint at rest was given
        momentum = _multiply(M, v[rows]) + duration * friction[rows]
        low, high = duration * backward[rows], duration * forward[rows]
        v[rows] = stick_slip(M, momentum, low, high, guess=np.where(turned[rows], 0.0, u[rows]))


def has_strong_friction(robot: RobotModel | RobotBatch) -> NDArray[np.bool_]:
    """Return for which arms the trapezoidal rule of viscous friction does not suffice, (N,), or (1,) for one arm."""
    viscous = np.atleast_2d(viscous_of(robot.friction))
    if not viscous.any():
        return np.zeros(1, dtype=bool)
    return np.asarray((mobility(robot) * viscous).sum(-1).max(0) > _WEAK)


def _hold(robot: RobotModel | RobotBatch, q: Array, x: Array, held: _Held) -> Array:
    """Return velocities or accelerations x (N, n) with 0 at held joints and the same (Mx)_i at all others."""
    rows = np.flatnonzero(held.any(-1))
    M = _mass_matrix(robot, q[rows], rows)
    momentum = np.where(held[rows], 0.0, _multiply(M, x[rows]))
    still = x.copy()
    still[rows] = np.linalg.solve(_decouple(M, held, rows), momentum[..., None])[..., 0]
    return still


def _decouple(M: Array, held: _Held | None, rows: _Rows) -> Array:
    """Return the mass matrices of some rows, (k, n, n), without entries between held joints and all others."""
    if held is None:
        return M
    of_rows = held[rows]
    apart = (of_rows[:, :, None] | of_rows[:, None, :]) & ~np.eye(M.shape[-1], dtype=bool)
    return np.where(apart, 0.0, M)


def _mass_matrix(robot: RobotModel | RobotBatch, q: Array, rows: NDArray[np.intp]) -> Array:
    """Return M of the arms of some ``rows`` (k,), at q (k, n)."""
    return robot.mass_matrix(q, rows) if isinstance(robot, RobotBatch) else robot.mass_matrix(q)


def _multiply(M: Array, x: Array) -> Array:
    """Return M x for each of k rows, (k, n)."""
    return np.einsum("kij,kj->ki", M, x)
