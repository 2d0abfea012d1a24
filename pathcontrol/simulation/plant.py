"""The simulated arm: rigid-body dynamics with friction that really sticks, at a fixed step."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.dry_friction import stick_slip

_ZERO, _ONLY = np.array(0.0), np.array([0])


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
        expect("robot", robot, RobotModel, RobotBatch)
        self.robot, self.step = robot, step
        # rows, (1, n), and numbers as arrays, (), which NumPy joins to those of a single rollout far faster than others
        self._damping = np.atleast_2d(robot.friction.viscous)
        self._whole, self._half, self._quarter = np.array(step), np.array(0.5 * step), np.array(0.25 * step)
        self._steady = None if robot.friction.varies else self._levels_at(np.zeros((1, robot.n)))
        self._inertia = arm = robot.with_armature(0.5 * step * robot.friction.viscous)
        self._of_one = arm.forward_dynamics if isinstance(arm, RobotBatch) else arm.forward_dynamics_of_one

    def _levels_at(self, qd: Array) -> tuple[Array, Array]:
        """Dry friction of forward and of backward motion, F⁺ and −F⁻ [N m], as rows."""
        plus, minus = self.robot.friction.levels(qd)
        return np.atleast_2d(plus), -np.atleast_2d(minus)

    def _mass_matrix(self, q: Array, rows: Array) -> Array:
        """Of the arms of some ``rows`` (k,), at q (k, n)."""
        if isinstance(self._inertia, RobotBatch):
            return self._inertia.mass_matrix(q, rows)
        return self._inertia.mass_matrix(q)

    def advance(self, q: Array, qd: Array, tau: Array) -> tuple[Array, Array]:
        """(q, q̇) one step later under the constant torque ``tau``; all (N, n)."""
        drive, dry = tau - self._damping * qd, self._dry(qd)
        middle_qd, turned = self._push(q, qd, qd, drive, dry, self._half)
        if turned or self._steady is None:  # else it is what it was
            dry = self._dry(middle_qd)
        middle_q = q + self._quarter * (qd + middle_qd)
        next_qd, _ = self._push(middle_q, middle_qd, qd, drive, dry, self._whole)
        return q + self._half * (qd + next_qd), next_qd

    def _dry(self, qd: Array) -> tuple[Array, Array, Array]:
        """Dry friction of forward and of backward motion, and in the direction of q̇, or any where that is 0."""
        forward, backward = self._steady or self._levels_at(qd)
        return forward, backward, np.where(qd > _ZERO, forward, backward)

    def _push(
        self, q: Array, qd: Array, start: Array, drive: Array, dry: tuple[Array, Array, Array], duration: Array
    ) -> tuple[Array, bool]:
        """P(start + duration a(q, q̇)), and whether a joint turned or stuck: else dry friction keeps its direction."""
        forward, backward, friction = dry
        forward_dynamics = self._of_one if len(q) == 1 else self._inertia.forward_dynamics
        v = start + duration * forward_dynamics(q, qd, drive - friction)
        turned = v * qd <= _ZERO
        if not np.count_nonzero(turned):
            return v, False
        # a diverged arm must not be taken for one that sticks
        turned &= np.isfinite(v) & (forward > backward)
        if not np.count_nonzero(turned):
            return v, True
        rows = _ONLY if len(v) == 1 else np.flatnonzero(turned.any(-1))
        # whatever friction a joint at rest got, it is taken back here
        M, impulse = self._mass_matrix(q[rows], rows), duration * friction[rows]
        momentum = np.einsum("kij,kj->ki", M, v[rows]) + impulse
        low, high = (duration * (level if len(level) == 1 else level[rows]) for level in (backward, forward))
        v[rows] = stick_slip(M, momentum, low, high, guess=np.where(turned[rows], _ZERO, qd[rows]))
        return v, True
