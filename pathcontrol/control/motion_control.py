"""Motion control: the laws track the timed trajectory q_r(t) = q_d(s(t)) of the motion plan, eqs. (6) and (14)."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array
from pathcontrol.arguments import Form, Unit
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.control.gains import joint_gains
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.task import PathTask


class Tracking(NamedTuple):
    """The timed reference and the tracking errors q̃ = q_r − q, all (*batch, n)."""

    acceleration: Array  # q̈_r
    velocity: Array  # q̇_r
    position_error: Array  # q̃
    velocity_error: Array  # dq̃/dt


class MotionController(Controller):
    """A tracking law on the timed trajectory of the task; its state is s, with no feedback from the arm."""

    @abstractmethod
    def torque(self, q: Array, qd: Array, ref: Tracking) -> Array:
        """Return the torque [N m], (*batch, n), without the compensation of friction."""

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        s = z[..., 0]
        point = self.point(s)
        velocity = point.velocity
        e_p, e_v = point.q_d - q, velocity - qd
        tracking = Tracking(point.velocity_slope * point.theta[..., None], velocity, e_p, e_v)
        tau = self.torque(q, qd, tracking) + self.friction_torque(qd, velocity)
        drift, regular = np.zeros_like(s), np.ones(s.shape, dtype=bool)
        out = ControlOutput(tau, point.theta[..., None], s, point.theta, point.dtheta, drift, e_p, e_v, regular)
        return self.compensate(t, q, qd, z, out)


class ProportionalDerivative(MotionController):
    """A tracking law with a gain on q̃ and one on dq̃/dt, in the units that its subclass states.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        K_p: position gain, scalar or diagonal (n,).
        K_v: velocity gain, scalar or diagonal (n,).
        options: ``friction`` and ``start`` of :class:`Controller`.
    """

    gains = ("K_p", "K_v")

    K_p: Annotated[Array, Form.GAIN, Unit("1/s^2")]
    K_v: Annotated[Array, Form.GAIN, Unit("1/s")]

    def __init__(self, robot: RobotModel, task: PathTask, K_p: ArrayLike, K_v: ArrayLike, **options: Any) -> None:
        super().__init__(robot, task, **options)
        self.K_p, self.K_v = joint_gains(robot, K_p=K_p, K_v=K_v)

    def correction(self, ref: Tracking) -> Array:
        """Return K_v dq̃/dt + K_p q̃, (*batch, n)."""
        return self.K_v * ref.velocity_error + self.K_p * ref.position_error


class ComputedTorque(ProportionalDerivative):
    """Computed torque, eq. (16): τ = M(q)[q̈_r + K_v dq̃/dt + K_p q̃] + C(q,q̇)q̇ + g(q) + f̂(q̇).

    Without unmodelled friction the error obeys (17), d²q̃/dt² + K_v dq̃/dt + K_p q̃ = 0. K_p in 1/s², K_v in 1/s;
    arguments as for :class:`ProportionalDerivative`.
    """

    def torque(self, q: Array, qd: Array, ref: Tracking) -> Array:
        return self.robot.inverse_dynamics(q, qd, ref.acceleration + self.correction(ref))


class PDPlus(ProportionalDerivative):
    """PD+ (Paden and Panja, Int. J. Control 47, 1988): τ = M(q)q̈_r + C(q,q̇)q̇_r + g(q) + K_v dq̃/dt + K_p q̃ + f̂(q̇).

    K_p in N m/rad, K_v in N m s/rad; arguments as for :class:`ProportionalDerivative`.
    """

    K_p: Annotated[Array, Form.GAIN, Unit("N m/rad")]
    K_v: Annotated[Array, Form.GAIN, Unit("N m s/rad")]

    def torque(self, q: Array, qd: Array, ref: Tracking) -> Array:
        return self.robot.inverse_dynamics(q, qd, ref.acceleration, velocity=ref.velocity) + self.correction(ref)


class SlotineLi(MotionController):
    """Slotine and Li's law with known parameters (Int. J. Robotics Research 6, 1987).

    τ = M(q)q̈_s + C(q,q̇)q̇_s + g(q) + K_d (q̇_s − q̇) + f̂(q̇),  q̇_s = q̇_r + Λq̃,  q̈_s = q̈_r + Λ dq̃/dt.

    Args:
        robot: the model the law uses.
        task: path and velocity profile.
        Lambda: Λ [1/s], scalar or diagonal (n,).
        K_d: gain on the sliding variable [N m s/rad], scalar or diagonal (n,).
        options: ``friction`` and ``start`` of :class:`Controller`.
    """

    gains = ("Lambda", "K_d")

    def __init__(
        self,
        robot: RobotModel,
        task: PathTask,
        Lambda: Annotated[ArrayLike, Form.GAIN, Unit("1/s")],
        K_d: Annotated[ArrayLike, Form.GAIN, Unit("N m s/rad")],
        **options: Any,
    ) -> None:
        super().__init__(robot, task, **options)
        self.Lambda, self.K_d = joint_gains(robot, Lambda=Lambda, K_d=K_d)

    def torque(self, q: Array, qd: Array, ref: Tracking) -> Array:
        velocity = ref.velocity + self.Lambda * ref.position_error
        acceleration = ref.acceleration + self.Lambda * ref.velocity_error
        return self.robot.inverse_dynamics(q, qd, acceleration, velocity=velocity) + self.K_d * (velocity - qd)
