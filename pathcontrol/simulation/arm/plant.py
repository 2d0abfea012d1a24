"""The simulated arm: rigid-body dynamics with exact stiction, at a fixed step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.friction import Coulomb, FrictionLaw, FrictionSum, Viscous, levels_of, viscous_of
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.contact import Meeting, Problem, solve_contact, touch_at_once, touch_during
from pathcontrol.simulation.arm.damping import Damping
from pathcontrol.simulation.arm.dry_friction import stick_slip
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.checks.mobility import mobility

#: rate of viscous friction [1/s] up to which the trapezoidal rule suffices: its error is (h × rate)²/12, 1e-5 in 2.5 ms
_WEAK = 4.0

_Rows = NDArray[np.intp]
_Held = NDArray[np.bool_]  # joints that are held still, (N, n)
Walls = Sequence[tuple[Wall, NDArray[np.bool_]]]  # each with the rollouts for which it is there, (N,)
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

    Walls are solved together with dry friction, see :mod:`~pathcontrol.simulation.arm.contact`: with gaps at q, in both
    stages with the Jacobian of the stage. What the step is too long for of an approach is stopped at its beginning.

    Args:
        robot: the arm, or one for each rollout; its ``friction`` is the friction of the plant.
        step: h [s].
    """

    def __init__(self, robot: RobotModel | RobotBatch, step: float) -> None:
        expect("robot", robot, RobotModel, RobotBatch)
        self.robot, self.step = robot, step
        self._viscous = viscous_of(robot.friction)
        self._levels = _signed_levels(robot.friction, np.zeros((1, robot.n))) if _is_constant(robot.friction) else None
        self._inertia = robot.with_armature(0.5 * step * self._viscous)
        self._strong = has_strong_friction(robot)
        self._damps = bool(self._strong.any())

    def advance(
        self, q: Array, qd: Array, tau: Array, held: _Held | None = None, walls: Walls | None = None
    ) -> tuple[Array, Array]:
        """Return (q, q̇) one step later under the constant torque ``tau``, with ``held`` joints and ``walls``.

        All arrays are (N, n); of walls each has the rollouts for which it is there, (N,).
        """
        held = None if held is None or not held.any() else np.broadcast_to(held, q.shape)
        if held is not None and (moves := (held & (qd != 0)).any(-1)).any():
            # rollouts that rest where they are held keep their bits, and their joints that stick stick
            qd = _hold(self.robot, q, qd, held & moves[:, None])
        met = _Met(walls, q, self.step, held) if walls else None
        if met is not None:
            qd = met.stop(self.robot, q, qd)
        h, drive, dry = self.step, tau - self._viscous * qd, self._dry_friction(qd, held)
        middle_qd = self._advance_freely(q, qd, qd, drive, dry, 0.5 * h, held)
        self._settle(middle_qd, q, qd, qd, dry, 0.5 * h, held, met)
        dry = self._dry_friction(middle_qd, held)
        middle_q = q + 0.25 * h * (qd + middle_qd)
        next_qd = self._advance_freely(middle_q, middle_qd, qd, drive, dry, h, held)
        if not self._damps:
            self._settle(next_qd, middle_q, middle_qd, qd, dry, h, held, met)
            return q + 0.5 * h * (qd + next_qd), next_qd
        damped = np.flatnonzero(np.broadcast_to(self._strong, len(q)))
        inertia, travel = self._condense(damped, middle_q, qd, next_qd, dry, middle_qd, held)
        self._settle(next_qd, middle_q, middle_qd, qd, dry, h, held, met, (damped, inertia))
        next_q = q + 0.5 * h * (qd + next_qd)
        next_q[damped] += h * _multiply(travel, (next_qd - qd)[damped])
        return next_q, next_qd

    def _dry_friction(self, qd: Array, held: _Held | None) -> _Dry:
        """Return the dry friction of forward and of backward motion, and that in the direction of q̇, (N, n).

        The first two broadcast against q̇ (N, n); where q̇ is 0 the third is either of them. Held joints have none.
        """
        forward, backward = self._levels or _signed_levels(self.robot.friction, qd)
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

    def _settle(
        self,
        v: Array,
        q: Array,
        u: Array,
        start: Array,
        dry: _Dry,
        duration: float,
        held: _Held | None,
        met: _Met | None,
        damped: tuple[_Rows, Array] | None = None,
    ) -> None:
        """Change v to what dry friction and walls leave of it a ``duration`` after ``start``; all (N, n).

        Joints stop that dry friction does not let turn since ``u``. The inertia is M + h/2 B, and M̃ (k, n, n) for the
        rows (k,) that are ``damped``.
        """
        free = v if met is None else v.copy()
        turned = v * u <= 0
        if np.count_nonzero(turned):  # rarely; any() takes longer than all else here
            # a diverged arm must not count as one that sticks
            turned &= np.isfinite(v) & (dry[0] > dry[1])
            rows = np.flatnonzero(turned.any(-1))
            if len(rows):
                problem = self._state_problem(rows, free, q, dry, duration, held, damped)
                v[rows] = stick_slip(*problem, guess=np.where(turned[rows], 0.0, u[rows]))
        if met is not None and len(rows := met.find_near(q, start, v, duration)):
            problem = self._state_problem(rows, free, q, dry, duration, held, damped)
            for row, *parts in zip(rows.tolist(), *problem, strict=True):
                v[row] = met.solve(row, Problem(*parts), start[row], v[row], duration)

    def _state_problem(
        self,
        rows: _Rows,
        free: Array,
        q: Array,
        dry: _Dry,
        duration: float,
        held: _Held | None,
        damped: tuple[_Rows, Array] | None,
    ) -> tuple[Array, Array, Array, Array]:
        """Return inertia, momentum without dry friction and bounds of its impulses, for ``rows`` (k,)."""
        forward, backward = (_pick(level, rows, free.shape) for level in dry[:2])
        M = _decouple(_mass_matrix(self._inertia, q[rows], rows), held, rows)
        if damped is not None:
            _, here, there = np.intersect1d(rows, damped[0], assume_unique=True, return_indices=True)
            M[here] = damped[1][there]
        # undo the friction that a joint at rest was given
        momentum = _multiply(M, free[rows]) + duration * dry[2][rows]
        return M, momentum, duration * backward, duration * forward


class _Met:
    """The walls of one step, and the rollouts that may meet them."""

    def __init__(self, walls: Walls, q: Array, step: float, held: _Held | None) -> None:
        self._walls, self._step, self._held = walls, step, held
        self._gaps = [wall.gap(q) for wall, _ in walls]
        self._jacobians: list[Array] = []

    def stop(self, robot: RobotModel | RobotBatch, q: Array, qd: Array) -> Array:
        """Return q̇ (N, n) without the approaches that the step is too long for."""
        rows = self.find_near(q, qd, qd, self._step)
        still = qd.copy()
        for row, M in zip(rows.tolist(), _decouple(_mass_matrix(robot, q[rows], rows), self._held, rows), strict=True):
            none = np.zeros(len(M))
            problem = Problem(M, M @ qd[row], none, none)
            found = (touch_at_once(at, problem, qd[row], self._step) for at in self._meetings(row))
            still[row] = solve_contact(problem, [touch for touch in found if touch is not None], qd[row])
        return still

    def find_near(self, q: Array, start: Array, v: Array, t: float) -> _Rows:
        """Return the rows that are beyond a wall, or will be a time t after ``start`` with v at its end."""
        self._jacobians = [self._jacobian(wall, q) for wall, _ in self._walls]
        near = np.zeros(len(q), dtype=bool)
        for (_, stands), gap, jacobian in zip(self._walls, self._gaps, self._jacobians, strict=True):
            change = 0.5 * t * (jacobian[:, 0] * (start + v)).sum(-1)
            near |= stands & ((gap <= 0) | (gap + change <= 0))
        return np.flatnonzero(near & np.isfinite(v).all(-1))

    def solve(self, row: int, problem: Problem, start: Array, v: Array, t: float) -> Array:
        """Return v⁺ (n,) of a row with its walls, from v (n,) without them."""
        found = (touch_during(at, problem, start, t, self._step) for at in self._meetings(row))
        return solve_contact(problem, [touch for touch in found if touch is not None], v)

    def _meetings(self, row: int) -> list[Meeting]:
        """Return a row before each of the walls that are there."""
        known = zip(self._walls, self._gaps, self._jacobians, strict=True)
        return [wall.meet(gap, jacobian, row) for (wall, stands), gap, jacobian in known if stands[row]]

    def _jacobian(self, wall: Wall, q: Array) -> Array:
        """Return the Jacobian of a wall, (N, 3, n), without the joints that are held."""
        jacobian = wall.jacobian(q)
        return jacobian if self._held is None else np.where(self._held[:, None], 0.0, jacobian)


def has_strong_friction(robot: RobotModel | RobotBatch) -> NDArray[np.bool_]:
    """Return for which arms the trapezoidal rule of viscous friction does not suffice, (N,), or (1,) for one arm."""
    viscous = np.atleast_2d(viscous_of(robot.friction))
    if not viscous.any():
        return np.zeros(1, dtype=bool)
    return np.asarray((mobility(robot) * viscous).sum(-1).max(0) > _WEAK)


def _is_constant(law: FrictionLaw) -> bool:
    """Return whether a law is one of the library, or a sum of these, that has the same levels at all velocities."""
    return all(map(_is_constant, law.terms)) if type(law) is FrictionSum else type(law) in (Viscous, Coulomb)


def _signed_levels(law: FrictionLaw, qd: Array) -> tuple[Array, Array]:
    """Return the dry friction of forward and of backward motion at q̇, which broadcasts against q̇ (N, n)."""
    forward, minus = levels_of(law, qd)
    return forward, np.subtract(0.0, minus)


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


def _pick(level: Array, rows: _Rows, shape: tuple[int, ...]) -> Array:
    """Return the levels of some ``rows`` (k,), (k, n), of those that broadcast to a ``shape`` (N, n)."""
    if level.ndim > 1:
        return (level if level.shape == shape else np.broadcast_to(level, shape))[rows]
    levels = np.empty((len(rows), shape[-1]))  # in a third of the time that it takes to broadcast
    levels[...] = level
    return levels


def _multiply(M: Array, x: Array) -> Array:
    """Return M x for each of k rows, (k, n)."""
    return np.einsum("kij,kj->ki", M, x)
