"""The simulated arm: rigid-body dynamics with friction that really sticks, at a fixed step."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.dry_friction import stick_slip


class Plant:
    """M(q)q̈ + C(q,q̇)q̇ + g(q) + b q̇ + F(q̇) ∋ τ over steps of ``step`` seconds, F the set-valued dry friction.

    With a(q, v) the acceleration without dry friction and P_h(v) the velocity that dry friction of duration h makes of
    v (:func:`stick_slip`), one step is

        v_m = P_{h/2}(v + h/2 a(q, v)),  q_m = q + h/4 (v + v_m),  v⁺ = P_h(v + h a(q_m, v_m)),  q⁺ = q + h/2 (v + v⁺):

    second order where no joint changes between sticking and slipping, nothing stiff, and no creep at all while stuck.
    Viscous friction enters by the trapezoidal rule, which adds h/2 b to the diagonal of M and is stable for any b.

    Args:
        robot: the arm, or one for each rollout; its ``friction`` is the friction of the plant.
        step: h [s].
    """

    def __init__(self, robot: RobotModel | RobotBatch, step: float) -> None:
        self.robot, self.step = robot, step
        # rows, (1, n), which NumPy joins to those of a single rollout far faster than (n,)
        self._damping = np.atleast_2d(robot.friction.viscous)
        levels = robot.friction.levels
        steady = tuple(np.atleast_2d(level) for level in levels(np.zeros(robot.n)))
        self._levels = levels if robot.friction.varies else lambda qd: steady
        self._inertia = robot.with_armature(0.5 * step * robot.friction.viscous)

    def _mass_matrix(self, q: Array, rows: Array) -> Array:
        """Of the arms of some ``rows`` (k,), at q (k, n)."""
        if isinstance(self._inertia, RobotBatch):
            return self._inertia.mass_matrix(q, rows)
        return self._inertia.mass_matrix(q)

    def advance(self, q: Array, qd: Array, tau: Array) -> tuple[Array, Array]:
        """(q, q̇) one step later under the constant torque ``tau``; all (N, n)."""
        h, drive = self.step, tau - self._damping * qd
        middle_qd = self._push(q, qd, qd, drive, 0.5 * h)
        middle_q = q + 0.25 * h * (qd + middle_qd)
        next_qd = self._push(middle_q, middle_qd, qd, drive, h)
        return q + 0.5 * h * (qd + next_qd), next_qd

    def _push(self, q: Array, qd: Array, start: Array, drive: Array, duration: float) -> Array:
        """P(start + duration a(q, q̇)): dry friction keeps the direction of q̇, unless that proves wrong."""
        plus, minus = self._levels(qd)
        friction = np.where(qd > 0, plus, -minus)  # whatever a joint at rest gets, it is taken back below
        v = start + duration * self._inertia.forward_dynamics(q, qd, drive - friction)
        turned = v * qd <= 0
        if not np.count_nonzero(turned):
            return v
        # a diverged arm must not be taken for one that sticks
        turned &= np.isfinite(v) & (plus + minus > 0)
        rows = np.flatnonzero(turned.any(-1))
        if not rows.size:
            return v
        M, impulse = self._mass_matrix(q[rows], rows), duration * friction[rows]
        momentum = np.einsum("kij,kj->ki", M, v[rows]) + impulse
        low = -duration * np.broadcast_to(minus, q.shape)[rows]
        high = duration * np.broadcast_to(plus, q.shape)[rows]
        v[rows] = stick_slip(M, momentum, low, high, guess=np.where(turned[rows], 0.0, qd[rows]))
        return v
