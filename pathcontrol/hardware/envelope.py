"""The safety envelope of a control loop: what torques, motions and measurements are let through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, as_whole, freeze
from pathcontrol.errors import InputError
from pathcontrol.hardware.start_check import read_tube
from pathcontrol.robot.model import RobotModel

_FULL_TORQUE = 0.01  # s in which a torque may go from 0 to its limit
_STOP = 0.1  # s in which a joint may be braked from its velocity limit
_MOST = 1_000_000
_NO_LIMIT = 1e6  # rad/s: files without a limit give 0 or some huge number


@dataclass(frozen=True, eq=False)
class Envelope:
    """The limits within which a control loop lets a law act, and how patient it is with faults.

    Numbers hold for all joints or are (n,). What is None is taken from the robot, by :meth:`complete`.

    Args:
        torque: largest |τ| [N m]; of the URDF.
        torque_rate: largest |τ̇| [N m/s]; from 0 to the torque limit in 10 ms.
        velocity: largest |q̇| [rad/s]; of the URDF.
        lower: least q [rad]; of the URDF.
        upper: largest q [rad]; of the URDF.
        deceleration: of a joint that is braked before a position limit [rad/s²]; from the velocity limit in 0.1 s.
        tube: distance ‖q_d(s) − q‖ from the path [rad] that the arm must not leave, nor start beyond; inf for none.
        jump: what a position may change beyond its velocity limit from one measurement to the next [rad].
        patience: number of bad measurements in a row that are bridged by the last torque.
        frozen: number of equal measurements in a row, while the arm moves, that count as bad.
        late: gap between two steps, in periods, from which a deadline counts as missed.
        lost: gap between two steps, in periods, after which the plan is held.

    Raises:
        InputError: a limit is negative or no number.
    """

    torque: ArrayLike | None = None
    torque_rate: ArrayLike | None = None
    velocity: ArrayLike | None = None
    lower: ArrayLike | None = None
    upper: ArrayLike | None = None
    deceleration: ArrayLike | None = None
    tube: float = 0.5
    jump: float = 0.05
    patience: int = 5
    frozen: int = 20
    late: float = 1.5
    lost: float = 10.0

    def __post_init__(self) -> None:
        for name in ("torque", "torque_rate", "velocity", "deceleration"):
            if (value := getattr(self, name)) is not None and not (as_array(name, value) > 0).all():
                raise InputError(
                    f"{name} = {np.asarray(value).tolist()}, expected limits greater than 0",
                    argument=name,
                    value=value,
                )
        for name in ("lower", "upper"):
            if (value := getattr(self, name)) is not None:
                as_array(name, value)
        read_tube(self.tube)
        as_scalar("jump", self.jump, least=0.0)
        as_whole("patience", self.patience, 0, _MOST)
        as_whole("frozen", self.frozen, 2, _MOST)
        if not self._as_number("lost") >= self._as_number("late") >= 1:
            raise InputError(
                f"late = {self.late!r} and lost = {self.lost!r} periods, expected 1 ≤ late ≤ lost",
                argument="late",
                value=self.late,
                limit=self.lost,
            )

    def complete(self, robot: RobotModel) -> CompleteEnvelope:
        """Return the envelope with the limits of ``robot`` where none are given, each (n,).

        Raises:
            InputError: a limit has another shape, or a joint has no torque or velocity limit here nor in its URDF.
        """
        limits, n = robot.limits, robot.n
        torque = self._limit("torque", limits.effort, robot)
        velocity = self._limit("velocity", np.where(limits.velocity < _NO_LIMIT, limits.velocity, np.inf), robot)
        rate = _spread("torque_rate", torque / _FULL_TORQUE, self.torque_rate, n)
        braking = _spread("deceleration", velocity / _STOP, self.deceleration, n)
        lower, upper = _spread("lower", limits.lower, self.lower, n), _spread("upper", limits.upper, self.upper, n)
        if (lower >= upper).any():
            raise InputError(
                f"lower = {lower.tolist()} is not below upper = {upper.tolist()}",
                argument="lower",
                value=lower,
                limit=upper,
            )
        patient = (self.tube, self.jump, self.patience, self.frozen, self.late, self.lost)
        joints = tuple(robot.joint_names), tuple(robot.position_units)
        return CompleteEnvelope(torque, rate, velocity, lower, upper, braking, *patient, *joints)

    def _as_number(self, name: str) -> float:
        """Return an argument that is one number or inf."""
        value = as_array(name, getattr(self, name))
        if value.ndim:
            raise InputError(f"{name} = {value.tolist()}, expected one number", argument=name, value=value)
        return float(value)

    def _limit(self, name: str, own: Array, robot: RobotModel) -> Array:
        """Return a limit of torque or velocity, which every joint must have."""
        found = _spread(name, own, getattr(self, name), robot.n)
        missing = [joint for joint, value in zip(robot.joint_names, found, strict=True) if not 0 < value < np.inf]
        if missing:
            raise InputError(
                f"{', '.join(missing)} of {robot.name}: no {name} limit in the URDF; give Envelope({name}=…)",
                argument=name,
                joint=missing[0],
            )
        return found


@dataclass(frozen=True, eq=False)
class CompleteEnvelope:
    """An :class:`Envelope` with all limits as arrays (n,), and the names and units of the joints for its sentences."""

    torque: Array
    torque_rate: Array
    velocity: Array
    lower: Array
    upper: Array
    deceleration: Array
    tube: float
    jump: float
    patience: int
    frozen: int
    late: float
    lost: float
    joints: tuple[str, ...]
    units: tuple[str, ...]

    def find_motion_fault(self, q: Array, qd: Array) -> str:
        """Return the sentence on a joint that is too fast, or too near to a position limit to be braked, or ""."""
        speed = np.abs(qd)
        if (speed > self.velocity).any():
            i = int((speed - self.velocity).argmax())
            return f"{self.joints[i]} moves at {qd[i]:.4g} {self.units[i]}/s, its limit is {self.velocity[i]:.4g}"
        ahead = q + qd * speed / (2 * self.deceleration)
        over = np.maximum(np.maximum(q, ahead) - self.upper, self.lower - np.minimum(q, ahead))
        if (over > 0).any():
            i = int(over.argmax())
            here, unit = f"{self.joints[i]} at {q[i]:.3g}", self.units[i]
            return f"{here} {unit} and {qd[i]:.3g} {unit}/s cannot be braked before its limit"
        return ""

    def clip(self, tau: Array, last: Array, dt: float) -> Array:
        """Return torques within their limits, and within their rate of the ``last`` ones, dt [s] ago."""
        change = self.torque_rate * dt
        tau = np.minimum(np.maximum(tau, -self.torque), self.torque)
        return np.minimum(np.maximum(tau, last - change), last + change)


def _spread(name: str, own: Array, given: ArrayLike | None, n: int) -> Array:
    """Return ``given``, or the robot's ``own``, as (n,)."""
    array = as_array(name, own if given is None else given)
    if array.shape not in ((), (n,)) or np.isnan(array).any():
        raise InputError(f"{name} = {array.tolist()}, expected a number or ({n},)", argument=name, value=array)
    return freeze(np.broadcast_to(array, (n,)).copy())
