"""The two ways to close the loop: sampled, as on hardware, or in continuous time, as in the theory."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite
from pathcontrol._milliseconds import LONGEST_DELAY, as_period, question_time
from pathcontrol.arguments import Form, Unit
from pathcontrol.errors import InputError
from pathcontrol.robot.batch import RobotBatch
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Disturbance
from pathcontrol.simulation.arm.noise import SensorNoise
from pathcontrol.simulation.arm.sensors import Sensors

MOST_SUBSTEPS = 10_000

Seconds = Annotated[float, Form.POSITIVE, Unit("s")]
TorqueLimits = bool | Annotated[ArrayLike, Form.LIMITS, Unit("N m", "N")]


class Outside(NamedTuple):
    """The surroundings of a simulation: the disturbance and the number of the first rollout.

    Attributes:
        disturbance: the disturbance of the arm, or None.
        first: number of the first rollout.
    """

    disturbance: Disturbance | None = None
    first: int = 0


#: the simulated arm: one for all rollouts, or one for each
Arm = RobotModel | RobotBatch


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """A control computer: torques held over a period, and optional imperfections of real hardware.

    Attributes:
        period: control period [s].
        substeps: steps of the plant in a period; one suffices unless the motion is fast, see :class:`Plant`.
        encoders: False for exact positions, True for the resolution of the robot, or counts per
            revolution, (n,), or for each rollout, (N, n).
        velocity: ``"exact"``, or ``"difference"`` of two measured positions over the period.
        filter_hz: corner frequency of a first-order low-pass filter on the velocity [Hz], or None.
        torque_limits: False for none, True for the effort limits of the robot, or limits [N m], (n,), or for each
            rollout, (N, n).
        delay: time from measuring to applying the torque [s]; no torque acts before the first one.
        noise: noise of the sensors, or None.
    """

    period: Seconds = 2.5e-3
    substeps: int = 1
    encoders: bool | Annotated[ArrayLike, Form.LIMITS] = False
    velocity: Literal["exact", "difference"] = "exact"
    filter_hz: Annotated[float, Form.POSITIVE, Unit("Hz")] | None = None
    torque_limits: TorqueLimits = False
    delay: Annotated[float, Unit("s")] = 0.0
    noise: SensorNoise | None = None

    def __post_init__(self) -> None:
        as_period("period", self.period)
        question_time("delay", as_scalar("delay", self.delay, least=0.0), LONGEST_DELAY)
        if not isinstance(self.substeps, int | np.integer) or not 1 <= self.substeps <= MOST_SUBSTEPS:
            raise InputError(
                f"substeps = {self.substeps!r:.80}, expected a whole number from 1 to {MOST_SUBSTEPS}",
                argument="substeps",
                value=self.substeps,
                limit=(1, MOST_SUBSTEPS),
            )
        if self.velocity not in ("exact", "difference"):
            raise InputError(
                f"velocity = {self.velocity!r}, expected 'exact' or 'difference'",
                argument="velocity",
                value=self.velocity,
                choices=("exact", "difference"),
            )
        if self.filter_hz is not None:
            as_scalar("filter_hz", self.filter_hz, positive=True)
        if self.noise is not None and not isinstance(self.noise, SensorNoise):
            raise InputError(f"noise = {self.noise!r}, expected a SensorNoise(...)", argument="noise", value=self.noise)
        if self.noise is not None and self.noise.on_velocity and self.velocity == "difference":
            raise InputError(
                "noise of the velocity, but velocity = 'difference' is not measured: its noise is that of positions; "
                "use velocity = 'exact', or no noise of it",
                argument="velocity",
                value=self.velocity,
            )

    def sensors(self, robot: Arm) -> Sensors:
        """Return the measuring chain for ``robot``."""
        return Sensors(self.period, self._resolution(robot), self.velocity == "difference", self.filter_hz)

    def _resolution(self, robot: Arm) -> Array | None:
        """Return the angle of an encoder count [rad], (1, n) or (N, n), or None for exact positions."""
        counts = _per_joint("encoders", self.encoders, robot.actuation.encoder_counts, robot)
        if counts is None:
            return None
        if "m" in robot.position_units:
            sliding = [j for j, unit in zip(robot.joint_names, robot.position_units, strict=True) if unit == "m"]
            raise InputError(
                f"encoders count revolutions, but {', '.join(sliding)} slides; use encoders = False",
                argument="encoders",
                value=self.encoders,
                joint=sliding[0],
            )
        if (counts <= 0).any():
            raise InputError(
                f"encoders = {counts.tolist()}, expected counts per revolution greater than 0",
                argument="encoders",
                value=self.encoders,
                limit=0.0,
            )
        return 2 * np.pi / np.atleast_2d(counts)

    def describe(self) -> dict[str, Any]:
        """Return all settings, for the configuration of a run."""
        settings = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "noise"}
        noise = {} if self.noise is None else {"noise": self.noise.describe()}
        return {"loop": "sampled"} | _to_plain(settings) | noise


@dataclass(frozen=True, eq=False)
class ContinuousTime:
    """The closed loop as a differential equation, integrated with error control; dry friction is smoothed.

    Attributes:
        output_period: time between recorded samples [s].
        rtol: relative tolerance of the integrator.
        atol: absolute tolerance of the integrator.
        friction_width: velocity w [rad/s] over which dry friction changes sign, as tanh(q̇/w).
        torque_limits: as for :class:`SampledLoop`.
    """

    output_period: Seconds = 2.5e-3
    rtol: Annotated[float, Form.POSITIVE] = 1e-8
    atol: Annotated[float, Form.POSITIVE] = 1e-10
    friction_width: Annotated[float, Form.POSITIVE, Unit("rad/s")] = 1e-3
    torque_limits: TorqueLimits = False

    def __post_init__(self) -> None:
        for name in ("output_period", "rtol", "atol", "friction_width"):
            as_scalar(name, getattr(self, name), positive=True)

    def describe(self) -> dict[str, Any]:
        """Return all settings, for the configuration of a run."""
        return {"loop": "continuous"} | _to_plain(asdict(self))


def torque_limits(mode: SampledLoop | ContinuousTime, robot: Arm) -> Array | None:
    """Return the limits [N m], (n,) or (N, n), that ``mode`` clamps torques to, or None."""
    limits = _per_joint("torque_limits", mode.torque_limits, robot.limits.effort, robot, infinite=True)
    if limits is not None and (limits <= 0).any():
        dead = [name for name, limit in zip(robot.joint_names, limits.T, strict=True) if (limit <= 0).any()]
        raise InputError(
            f"the torque limit of {', '.join(dead)} is 0, which kills all torque; give torque_limits = [...] in N m",
            argument="torque_limits",
            value=mode,
            joint=dead[0],
        )
    return limits


def check_rows(values: Array | None, name: str, rollouts: int) -> None:
    """Check that the values of a loop for each rollout fit the number of rollouts."""
    if values is not None and values.ndim == 2 and len(values) not in (1, rollouts):
        raise InputError(
            f"{name} has rows for {len(values)} rollouts, expected 1 or {rollouts}", argument=name, value=values
        )


def _per_joint(
    name: str, value: bool | ArrayLike, own: Array | None, robot: Arm, infinite: bool = False
) -> Array | None:
    """Return one value for each joint: None for False, the robot's own values for True, else those given."""
    if isinstance(value, bool | np.bool_) and not value:
        return None
    if isinstance(value, bool | np.bool_):
        if own is None:
            raise InputError(
                f"{name} = True, but {robot.name} says nothing about them; give one value per joint",
                argument=name,
                value=value,
            )
        return own
    array = as_array(name, value)
    if array.shape[-1:] != (robot.n,) or array.ndim > 2:
        raise InputError(
            f"{name} has shape {array.shape}, expected ({robot.n},): one value for each joint, or a row of "
            "them for each rollout",
            argument=name,
            value=value,
        )
    if infinite and not np.isnan(array).any():
        return array
    return check_finite(name, array)


def _to_plain(settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings as plain values."""
    return {name: value if value is None else np.asarray(value).tolist() for name, value in settings.items()}
