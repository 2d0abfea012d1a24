"""Path control by a projection of the arm's state to the motion reference, whatever that projection is."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.control.base import ControlOutput
from pathcontrol.control.branch import shift_to_lap
from pathcontrol.control.reference_law import STEEPEST, Reference, TrackingReferenceLaw

_STEP = 6e-6  # rad and rad/s, of central differences: the cube root of the precision of numbers


class StateToReferenceProjection(TrackingReferenceLaw):
    """Path control whose motion reference is a function of the state of the arm, σ = Π(q, q̇).

    In this law a *state-to-reference projection* Π stands in place of time (reference [3] of the paper). The torque is
    that of (39), with the rate of σ along the closed loop, in which q̈ is what the brackets contain:

        τ = M(q)[r'(σ)σ̇ + K_v e_v + K_p e_p] + C(q,q̇)q̇ + g(q) + f̂(q̇),   r = q_d'ϑ
        σ̇ = (Π_q q̇ + Π_q̇(K_v e_v + K_p e_p)) / (1 − Π_q̇ r'),   which is Π_q q̇ where Π is of the posture alone.

    The theorem asks three things of Π, near the path:

    1. Π(q_d(s), r(s)) = s: on the path, at its velocity, both errors are 0.
    2. Π_q̇ r' < 1, so that σ̇ is defined. With 1 it says that σ grows along the path, Π_q q_d' > 0.
    3. e_pᵀP q_d'(σ̇ − ϑ) ≤ 0 for a diagonal P > 0, the ``metric``. Then V = ½e_pᵀP e_p + ½e_vᵀP K_p⁻¹e_v does not grow:

        V̇ = −e_vᵀP K_p⁻¹K_v e_v + e_pᵀP q_d'(σ̇ − ϑ)

    This V̇ holds for any Π, in continuous time, where all friction is compensated and no torque is at its limit;
    :func:`lyapunov` returns it for a run. The nearest point in the metric P has P e_p ⊥ q_d', so the last term is 0 in
    any motion. :class:`Projection` is that case, with P = k_p, a number. A plan that is timed has σ̇ = ϑ, as at the end
    of an open path.

    A subclass gives :meth:`reference`, and may give :meth:`project`, where it knows the gradients. The state is the
    last σ.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        K_p: position gain [1/s²], scalar or diagonal (n,).
        K_v: velocity gain [1/s], scalar or diagonal (n,).
        options: ``friction`` and ``start`` of :class:`Controller`; the first σ is the one near to ``start``.
    """

    @abstractmethod
    def reference(self, q: Array, qd: Array, near: Array) -> Array:
        """Return σ = Π(q, q̇), (*batch,), for q [rad] and q̇ [rad/s], (*batch, n).

        ``near`` (*batch,) is the last σ, for a Π that has branches. On a closed path σ may be of any lap; on an open
        one a σ beyond an end is taken as that end. Where Π is not defined it is NaN, and the last σ is kept.
        """

    @property
    def metric(self) -> Array:
        """P of the Lyapunov function, a positive number or diagonal (n,): 1 unless a subclass says otherwise."""
        return np.ones(())

    def project(self, q: Array, qd: Array, near: Array) -> Reference:
        """Return σ with its gradients, by central differences of :meth:`reference` unless a subclass knows better."""
        n = self.robot.n
        s = self._find(q, qd, near)
        step = _STEP * np.eye(2 * n).reshape(2 * n, *(1,) * (q.ndim - 1), 2 * n)
        ahead, behind = (self._find(q + d[..., :n], qd + d[..., n:], near) for d in (step, -step))
        gradient = np.moveaxis(ahead - behind, 0, -1) / (2 * _STEP)
        known = np.isfinite(s) & np.isfinite(gradient).all(-1)
        s, gradient = np.where(known, s, near), np.where(known[..., None], gradient, 0.0)
        by_q, by_qd, point = gradient[..., :n], gradient[..., n:], self.point(s)
        steepness = np.linalg.norm(point.dq_d, axis=-1) * np.linalg.norm(by_q, axis=-1)
        regular = known & (steepness < STEEPEST) & ((1 - np.vecdot(by_qd, point.velocity_slope)) * STEEPEST > 1)
        return Reference(s, point, by_q, by_qd, regular)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        here = self.locate(q, qd, z[..., 0])
        feedback = self.K_v * here.e_v + self.K_p * here.e_p
        sdot = np.where(here.timed, here.point.theta, here.found.rate(qd, feedback))
        qdd = here.point.velocity_slope * sdot[..., None] + feedback
        return self.conclude(t, q, qd, z, here, self.robot.inverse_dynamics(q, qd, qdd), sdot)

    def speed_gradient(self, q: Array, qd: Array, s: Array, velocity: Array) -> tuple[Array, Array]:
        found = self.project(q, qd, s)
        if found.velocity_gradient is None:
            return super().speed_gradient(q, qd, s, velocity)
        change = np.where(self.is_timed(s), 0.0, found.rate(np.zeros_like(qd), velocity))
        return velocity + found.point.velocity_slope * change[..., None], change

    def _find(self, q: Array, qd: Array, near: Array) -> Array:
        """Return σ, (*batch,), in the lap of ``near``, or within the ends of an open path."""
        s = np.asarray(self.reference(q, qd, np.broadcast_to(near, q.shape[:-1])), dtype=np.float64)
        if self.task.closed:
            return shift_to_lap(self.task, s, near)
        return np.minimum(np.maximum(s, self.task.s0), self.task.s_end)
