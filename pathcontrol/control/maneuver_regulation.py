"""Maneuver regulation: the motion reference is the nearest one in position and velocity together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.control.base import ControlOutput
from pathcontrol.control.reference_law import STEEPEST, Reference, TrackingReferenceLaw, differentiate_along
from pathcontrol.geometry.closest_point.curve import Curve, Interval
from pathcontrol.geometry.closest_point.local_search import descend_by_newton
from pathcontrol.tasks.base import PathPoint


class StateMetric(NamedTuple):
    """The metric P of the states (q, q̇), a matrix [[a, b], [b, c]] for each joint, (n,) or (N, n) each.

    Attributes:
        a: weight of squared positions [s].
        b: half the weight of position times velocity [s²].
        c: weight of squared velocities [s³].
    """

    a: Array
    b: Array
    c: Array

    @classmethod
    def of(cls, K_p: Array, K_v: Array) -> StateMetric:
        """Return the solution of A_cᵀP + PA_c = −Q with A_c = [[0, 1], [−K_p, −K_v]] and Q = diag(1, 1/K_p)."""
        return cls(0.5 * K_v / K_p + 1 / K_v, 0.5 / K_p, 1 / (K_p * K_v))

    def apply(self, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Return P(position, velocity), its parts (*batch, n) each."""
        return self.a * position + self.b * velocity, self.b * position + self.c * velocity

    def lift(self, position: Array, velocity: Array) -> Array:
        """Return Lᵀ(position, velocity), (*batch, 2n), with P = LLᵀ, whose Euclidean norm is that of P."""
        return self.factor().lift(position, velocity)

    def factor(self) -> MetricFactor:
        """Return L of P = LLᵀ."""
        root = np.sqrt(self.a)
        return MetricFactor(root, self.b / root, np.sqrt(self.c - self.b**2 / self.a))


class MetricFactor(NamedTuple):
    """The factor L of a metric P = LLᵀ, a matrix [[d, 0], [e, f]] for each joint, (n,) or (N, n) each."""

    d: Array
    e: Array
    f: Array

    def lift(self, position: Array, velocity: Array) -> Array:
        """Return Lᵀ(position, velocity), (*batch, 2n), whose Euclidean norm is that of P."""
        return np.concatenate([self.d * position + self.e * velocity, self.f * velocity], axis=-1)


class ManeuverRegulation(TrackingReferenceLaw):
    """Maneuver regulation of the states (q, q̇).

    (J. Hauser and R. Hindman, Maneuver regulation from trajectory tracking: feedback linearizable systems, IFAC
    Symposium on Nonlinear Control Systems Design, 1995.) The maneuver is the curve of states x_d(s) = (q_d(s), r(s)),
    r = q_d'ϑ, and σ is the parameter of its point nearest to x = (q, q̇) in a metric P:

        σ = arg min ‖x_d(s) − x‖²_P,  so that  x_d'(σ)ᵀP(x_d(σ) − x) = 0
        τ = M(q)[r'(σ)ϑ(σ) + K_v e_v + K_p e_p] + C(q,q̇)q̇ + g(q) + f̂(q̇)

    This is computed torque with σ in place of time. P is the metric in which tracking has a Lyapunov function, for each
    joint A_cᵀP + PA_c = −Q with A_c = [[0, 1], [−K_p, −K_v]] and Q = diag(1, 1/K_p). With e = (e_p, e_v)

        ė = A_c e + x_d'(σ̇ − ϑ),    V = eᵀPe,    V̇ = −eᵀQe + 2(σ̇ − ϑ) x_d'ᵀPe = −eᵀQe,

    whatever σ̇ is, as the last term is 0 at the nearest point. So V ≤ V₀e^{−μt} with μ the least eigenvalue of P⁻¹Q,
    the :attr:`decay_rate`: states come to the maneuver exponentially, in all directions beside it, and where on it they
    arrive is free. An arm that is slow is taken for one that is elsewhere on the path, if the path has a slower place.
    The proof asks for a σ that is regular, continuous time, friction that is compensated, and no torque at its limit.

    σ is the local minimum downhill from the last one; r'' is taken by differences. At the end of an open path, once σ
    is where :class:`Ending` begins, the plan is timed. The state z is the last σ.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        K_p: position gain [1/s²], scalar or diagonal (n,).
        K_v: velocity gain [1/s], scalar or diagonal (n,).
        options: ``friction`` and ``start`` of :class:`Controller`; the first σ is the one near to ``start``.
    """

    @property
    def metric(self) -> StateMetric:
        """The metric P."""
        one = np.ones(np.broadcast_shapes(self.K_p.shape, self.K_v.shape, (self.robot.n,)))
        return StateMetric.of(self.K_p * one, self.K_v * one)

    @property
    def decay_rate(self) -> Array:
        """μ [1/s], the least eigenvalue of P⁻¹Q, a number or (N,): V decays by e^{−μt} at least."""
        a, b, c = self.metric
        determinant, K_p = a * c - b**2, 1 / (2 * b)
        trace = (c + a / K_p) / determinant  # of P⁻¹Q, whose determinant is 1/(K_p det P)
        return (0.5 * (trace - np.sqrt(trace**2 - 4 / (K_p * determinant)))).min(-1)

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        here = self.locate(q, qd, z[..., 0])
        point = here.point
        qdd = point.velocity_slope * point.theta[..., None] + self.K_v * here.e_v + self.K_p * here.e_p
        sdot = np.where(here.timed, point.theta, here.found.rate_at(qd, qdd))
        return self.conclude(t, q, qd, z, here, self.robot.inverse_dynamics(q, qd, qdd), sdot)

    def project(self, q: Array, qd: Array, near: Array) -> Reference:
        """Return σ with its gradient Px_d'/(‖x_d'‖²_P + (x_d − x)ᵀPx_d'')."""
        s, found = self._descend(q, qd, near)
        point, metric = self.point(s), self.metric
        by_q, by_qd = metric.apply(point.dq_d, point.velocity_slope)
        squared = np.vecdot(by_q, point.dq_d) + np.vecdot(by_qd, point.velocity_slope)
        e_p, e_v = point.q_d - q, point.velocity - qd
        bend_q, bend_qd = metric.apply(point.ddq_d, self.slope_rate(s))
        denominator = squared + np.vecdot(bend_q, e_p) + np.vecdot(bend_qd, e_v)
        regular = found & (denominator * STEEPEST > squared)
        moves = regular & ~self._held_by_end(s, np.vecdot(by_q, e_p) + np.vecdot(by_qd, e_v))
        share = np.divide(1.0, denominator, out=np.zeros_like(denominator), where=moves)[..., None]
        return Reference(s, point, share * by_q, share * by_qd, regular)

    def speed_gradient(self, q: Array, qd: Array, s: Array, velocity: Array) -> tuple[Array, Array]:
        found = self.project(q, qd, s)
        return velocity, np.where(self.is_timed(s), 0.0, found.rate_at(np.zeros_like(qd), velocity))

    def _descend(self, q: Array, qd: Array, near: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return σ, (*batch,), downhill from ``near``, or from the point nearest to q, and where it was found."""
        if not near.ndim:
            s, found = self._descend(q[None], qd[None], near[None])
            return s[0], found[0]
        task, maneuver = self.task, _Maneuver(self)
        upper = task.s_end if task.period is None else task.s0 + task.period
        curve = Curve(maneuver.state, maneuver.slope, maneuver.bend)
        interval, x = Interval(task.s0, upper, task.closed), maneuver.factor.lift(q, qd)
        s, found = descend_by_newton(curve, interval, x, near)
        if found.all():
            return s, found
        again, refound = descend_by_newton(curve, interval, x, task.sigma_bar(q, near=near))
        return np.where(found, s, np.where(refound, again, near)), found | refound

    def slope_rate(self, s: Array) -> Array:
        """Return r'' [rad/s], (*batch, n), at s."""
        return differentiate_along(lambda one: self.point(one).velocity_slope, self.task, s)

    def _held_by_end(self, s: Array, slope: Array) -> NDArray[np.bool_]:
        """Return where σ is an end of the open path and stays there, for the ``slope`` of ½‖x_d − x‖²_P."""
        if self.task.closed:
            return np.zeros(s.shape, dtype=bool)
        return (s <= self.task.s0) & (slope > 0) | (s >= self.task.s_end) & (slope < 0)


class _Maneuver:
    """The lifted maneuver Lᵀx_d of a law at one moment, a curve that asks the law once at each s."""

    def __init__(self, law: ManeuverRegulation) -> None:
        self._law, self.factor = law, law.metric.factor()
        self._asked: tuple[Array, PathPoint] | None = None

    def state(self, s: Array) -> Array:
        """Return Lᵀx_d at s (*batch,)."""
        point = self._point(s)
        return self.factor.lift(point.q_d, point.velocity)

    def slope(self, s: Array) -> Array:
        """Return its first derivative."""
        point = self._point(s)
        return self.factor.lift(point.dq_d, point.velocity_slope)

    def bend(self, s: Array) -> Array:
        """Return its second derivative."""
        return self.factor.lift(self._point(s).ddq_d, self._law.slope_rate(s))

    def _point(self, s: Array) -> PathPoint:
        """Return the task at s."""
        if self._asked is None or self._asked[0] is not s:
            self._asked = s, self._law.point(s)
        return self._asked[1]
