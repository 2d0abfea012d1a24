"""Laws whose path parameter is a function of the state of the arm, and what they have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.control.gains import joint_gains
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import PathPoint
from pathcontrol.tasks.task import PathTask

#: σ is called irregular where it changes this many times as fast with q as on the path
STEEPEST = 1e6
_STEP = 1e-5  # of a path of length 2π in s, for central differences along it
_CATCH_UP = 1e-2  # s, time constant with which the state of continuous time converges to σ after it jumped


class Reference(NamedTuple):
    """A motion reference σ and its gradients in the state of the arm.

    Attributes:
        s: σ = Π(q, q̇), (*batch,).
        point: the task at σ.
        position_gradient: Π_q = ∂Π/∂q [1/rad], (*batch, n).
        velocity_gradient: Π_q̇ = ∂Π/∂q̇ [s/rad], (*batch, n); ``None`` where Π is of the posture alone.
        regular: False where Π, or σ̇ with it, is not defined, and the last σ was kept, (*batch,).
    """

    s: Array
    point: PathPoint
    position_gradient: Array
    velocity_gradient: Array | None
    regular: Array

    def rate(self, qd: Array, free: Array) -> Array:
        """Return σ̇ [1/s], (*batch,), of an arm with q̇ and q̈ = r'σ̇ + ``free``, (*batch, n); 0 where not regular."""
        along = np.vecdot(self.position_gradient, qd)
        if self.velocity_gradient is None:
            return np.where(self.regular, along, 0.0)
        along = along + np.vecdot(self.velocity_gradient, free)
        left = 1 - np.vecdot(self.velocity_gradient, self.point.velocity_slope)
        return np.divide(along, left, out=np.zeros_like(along), where=self.regular)

    def rate_at(self, qd: Array, qdd: Array) -> Array:
        """Return σ̇ = Π_q q̇ + Π_q̇ q̈ [1/s], (*batch,), of an arm with q̇ and q̈, (*batch, n)."""
        along = np.vecdot(self.position_gradient, qd)
        return along if self.velocity_gradient is None else along + np.vecdot(self.velocity_gradient, qdd)


class Located(NamedTuple):
    """The place of an arm on its path.

    Attributes:
        found: the motion reference and its gradients.
        s: path parameter in use, (*batch,): that of ``found``, or the last one where the plan is timed.
        point: the task at s.
        e_p: position error q_d(s) − q [rad], (*batch, n).
        e_v: velocity error q_d'(s)ϑ(s) − q̇ [rad/s], (*batch, n).
        timed: where the plan follows σ̇ = ϑ(σ), at the end of an open path or held, (*batch,).
        regular: False where s is not defined and the last one was kept, (*batch,).
    """

    found: Reference
    s: Array
    point: PathPoint
    e_p: Array
    e_v: Array
    timed: NDArray[np.bool_]
    regular: NDArray[np.bool_]


class ReferenceLaw(Controller):
    """The base of laws whose σ is a function of the state (q, q̇); the state z of the law is the last σ.

    A subclass gives :meth:`project`, and its :meth:`law` asks :meth:`locate` first and ends with :meth:`conclude`.
    """

    @abstractmethod
    def project(self, q: Array, qd: Array, near: Array) -> Reference:
        """Return σ with its gradients for q [rad] and q̇ [rad/s], (*batch, n); ``near`` (*batch,) is the last σ."""

    def first_parameter(self, q: Array, qd: Array) -> Array:
        """Return σ, (*batch,), of an arm that starts at (q, q̇)."""
        return self.project(q, qd, super().first_parameter(q, qd)).s

    def locate(self, q: Array, qd: Array, last: Array) -> Located:
        """Return the place of an arm at q [rad] and q̇ [rad/s], (*batch, n), whose ``last`` σ is known, (*batch,)."""
        found, timed = self.project(q, qd, last), self.is_timed(last)
        s, point, regular = found.s, found.point, found.regular
        if timed.any():
            s = np.where(timed, last, s)
            point, regular = self.point(s), regular | timed
        return Located(found, s, point, point.q_d - q, point.velocity - qd, timed, regular)

    def conclude(
        self, t: float, q: Array, qd: Array, z: Array, here: Located, tau: Array, sdot: Array
    ) -> ControlOutput:
        """Return the output of a law that asks for ``tau`` [N m], (*batch, n), beside friction; ``sdot`` is σ̇ [1/s]."""
        last, none = z[..., 0], np.zeros(z.shape[:-1])
        tau = tau + self.friction_torque(qd, here.point.velocity)
        slope = np.where(here.timed, here.point.dtheta, 0.0)
        # in continuous time the state integrates σ̇; its offset, as after a change of branch, decays exponentially
        zdot = sdot + np.where(here.regular, (here.s - last) / _CATCH_UP, 0.0)
        out = ControlOutput(tau, zdot[..., None], here.s, sdot, slope, none, here.e_p, here.e_v, here.regular)
        return self.compensate(t, q, qd, z, out)

    def speed_response(self, s: Array, theta: Array) -> Array:
        return np.where(self.timed(s), theta, 0.0)

    def is_timed(self, s: Array) -> NDArray[np.bool_]:
        """Return where the plan is timed, (*batch,), without a look where it never is."""
        if self.ending is None and self.speed is None:
            return np.zeros(s.shape, dtype=bool)
        return self.timed(s)


class TrackingReferenceLaw(ReferenceLaw):
    """The base of laws that track the reference at σ with two diagonal gains.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        K_p: position gain [1/s²], scalar or diagonal (n,).
        K_v: velocity gain [1/s], scalar or diagonal (n,).
        options: ``friction`` and ``start`` of :class:`Controller`; the first σ is the one near to ``start``.
    """

    gains = ("K_p", "K_v")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        K_p: Annotated[ArrayLike, Form.GAIN, Unit("1/s^2")],
        K_v: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        **options: Any,
    ) -> None:
        super().__init__(robot, task, **options)
        self.K_p, self.K_v = joint_gains(robot, K_p=K_p, K_v=K_v)


def differentiate_along(function: Callable[[Array], Array], task: PathTask, s: Array) -> Array:
    """Return the derivative of a ``function`` of s along a task, (*batch, n), by differences within its ends."""
    if not s.ndim:  # tasks take arrays
        return np.asarray(differentiate_along(function, task, s[None])[0])
    lower, upper = task.sampled_interval
    h = _STEP * (upper - lower) / (2 * np.pi)
    ahead, behind = s + h, s - h
    if not task.closed:
        ahead, behind = np.minimum(ahead, task.s_end), np.maximum(behind, task.s0)
    return (function(ahead) - function(behind)) / (ahead - behind)[..., None]
