"""The limits of the joints that a traversal has to keep."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, strip_labels
from pathcontrol.arguments import Form, Unit
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel

#: ``True`` for the limits of the URDF, ``None`` or ``False`` for none, or values
LimitChoice = ArrayLike | bool | None
VelocityLimit = Annotated[LimitChoice, Form.LIMITS, Unit("rad/s", "m/s")]

_UNITS = {
    "rad": {"velocity": "rad/s", "acceleration": "rad/s²", "torque": "N m"},
    "m": {"velocity": "m/s", "acceleration": "m/s²", "torque": "N"},
}


class JointLimits(NamedTuple):
    """Limits |q̇| ≤ ``velocity``, |q̈| ≤ ``acceleration``, |τ| ≤ ``torque``, each (n,) in SI units; ``inf`` for none.

    The torque is what the profile may use: the share ``margin`` of the drives' torque is left to feedback.
    """

    robot: RobotModel
    velocity: Array
    acceleration: Array
    torque: Array
    margin: float

    def text(self, kind: str, joint: int) -> str:
        """Write one limit for an error message: kind, value, unit and joint."""
        value, unit = getattr(self, kind)[joint], _UNITS[self.robot.position_units[joint]][kind]
        text = f"{kind} limit of {self.robot.joint_names[joint]}, {value:.4g} {unit}"
        if kind == "torque" and self.margin:
            text += f" ({value / (1 - self.margin):.4g} {unit} less the margin of {self.margin:g})"
        return text

    def shares(self, acceleration: Array, most: Array, least: Array) -> Array:
        """Return the used share of each finite limit in both directions, (*batch, m).

        The rows are those of acceleration upwards and downwards, then those of torque, which lies between ``least``
        and ``most``; the arguments are (*batch, n).
        """
        i, j = np.flatnonzero(np.isfinite(self.acceleration)), np.flatnonzero(np.isfinite(self.torque))
        up, most, least = acceleration[..., i] / self.acceleration[i], most[..., j], least[..., j]
        return np.concatenate([up, -up, most / self.torque[j], -least / self.torque[j]], -1)

    @property
    def rows(self) -> list[tuple[str, int]]:
        """The kind and the joint of each row of :meth:`shares`."""
        finite = [(kind, np.flatnonzero(np.isfinite(getattr(self, kind)))) for kind in ("acceleration", "torque")]
        return [(kind, int(i)) for kind, joints in finite for i in (*joints, *joints)]


def joint_limits(
    robot: RobotModel, velocity: LimitChoice, acceleration: LimitChoice, torque: LimitChoice, margin: float
) -> JointLimits:
    """Return the limits that the caller chose, the torque less its margin.

    Raises:
        InputError: a limit is not positive, has a wrong shape, or there is none.
    """
    if not 0 <= as_scalar("margin", margin) < 1:
        raise InputError(
            f"margin = {margin:g}, expected the share of the torque left for feedback, 0 ≤ margin < 1",
            argument="margin",
            value=margin,
            limit=(0.0, 1.0),
        )
    if acceleration is True:
        raise InputError(
            "acceleration = True, but a URDF has no acceleration limits; give one for each joint",
            argument="acceleration",
            value=True,
        )
    limits = JointLimits(
        robot,
        joint_values("velocity", velocity, robot.limits.velocity, robot),
        joint_values("acceleration", acceleration, None, robot),
        (1 - margin) * joint_values("torque", torque, robot.limits.effort, robot),
        margin,
    )
    if not np.isfinite(limits[1:4]).any():
        raise InputError(
            "no velocity, acceleration or torque is limited, so nothing bounds the speed; give a limit",
            argument="velocity",
            value=velocity,
        )
    return limits


def joint_values(kind: str, choice: LimitChoice, own: Array | None, robot: RobotModel) -> Array:
    """Return the limit that was chosen for each joint, (n,), its ``own`` for ``True``; ``inf`` for none.

    Raises:
        InputError: a limit is not positive or has a wrong shape.
    """
    if choice is None or choice is False:
        return np.full(robot.n, np.inf)
    values = (
        own if own is not None and choice is True else as_array(kind, strip_labels(kind, choice, robot.joint_names))
    )
    if values.shape not in ((), (robot.n,)):
        raise InputError(
            f"{kind} has shape {values.shape}, expected one limit for each of the {robot.n} joints",
            argument=kind,
            value=choice,
        )
    values = np.broadcast_to(values, robot.n)
    if not (values > 0).all():
        i = int(np.argmin(values > 0))
        raise InputError(
            f"the {kind} limit of {robot.joint_names[i]} is {values[i]:g}, expected more than 0; give {kind} = "
            "one limit for each joint (inf for none), or None for no such limits",
            argument=kind,
            value=values[i],
            limit=0.0,
            joint=robot.joint_names[i],
        )
    return values
