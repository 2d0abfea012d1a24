"""Timed joint trajectories, as arms with position interfaces take them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pathcontrol._arrays import Array, as_array, as_scalar, check_finite, freeze
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel

_ROUNDING = 1e-9  # of a limit, and of a period
_FASTEST = 1e5  # Hz
_MOST = 10_000_000  # samples


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Joint positions, velocities and accelerations at equal steps of time.

    Args:
        time: [s], (k,), from 0 on.
        q: joint positions [rad or m], (k, n).
        qd: joint velocities [rad/s or m/s], (k, n).
        qdd: joint accelerations [rad/s² or m/s²], (k, n).
        joints: names of the joints.
        units: ``"rad"`` or ``"m"`` of each joint's position; by default all turn.

    Raises:
        InputError: the shapes do not fit together, a number is not finite, or the steps of time are not equal.
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    joints: Sequence[str]
    units: Sequence[str] = ()

    def __post_init__(self) -> None:
        for name in ("time", "q", "qd", "qdd"):
            object.__setattr__(self, name, freeze(check_finite(name, as_array(name, getattr(self, name)))))
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(self, "units", tuple(self.units) or ("rad",) * len(self.joints))
        shape = len(self.time), len(self.joints)
        if any(array.shape != shape for array in (self.q, self.qd, self.qdd)) or self.time.ndim != 1:
            shapes = [array.shape for array in (self.time, self.q, self.qd, self.qdd)]
            raise InputError(
                f"time, q, qd and qdd have shapes {shapes}, expected (k,) and three times (k, {shape[1]})",
                argument="time",
                value=self.time,
            )
        steps = np.diff(self.time)
        if len(steps) < 1 or steps.min() <= 0 or np.ptp(steps) > 1e-6 * steps.mean():
            raise InputError(
                "the times of a trajectory are two or more in equal, positive steps", argument="time", value=self.time
            )

    @property
    def period(self) -> float:
        """The time between two samples [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @property
    def duration(self) -> float:
        """The time from the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0])

    def check_limits(self, robot: RobotModel) -> None:
        """Check that positions, velocities and torques stay within the limits of ``robot``.

        The torque is τ = M(q)q̈ + C(q,q̇)q̇ + g(q) + f(q̇), with the friction that the model has.

        Raises:
            InputError: a limit is passed; it names the joint, the value, the limit and the time.
        """
        if robot.n != len(self.joints):
            raise InputError(
                f"the trajectory has {len(self.joints)} joints, {robot.name} has {robot.n}", value=len(self.joints)
            )
        limits = robot.limits
        tau = robot.inverse_dynamics(self.q, self.qd, self.qdd) + robot.friction.torque(self.qd)
        self._check("position", self.q, limits.lower, limits.upper, "")
        self._check("velocity", self.qd, -limits.velocity, limits.velocity, "/s")
        self._check("torque", tau, -limits.effort, limits.effort, "torque")

    def _check(self, what: str, values: Array, lower: Array, upper: Array, unit: str) -> None:
        """Raise an error about the value that is farthest outside its limits."""
        margin = _ROUNDING * np.maximum(np.abs(np.nan_to_num(lower)), np.abs(np.nan_to_num(upper)))
        beyond = np.maximum(values - (upper + margin), (lower - margin) - values)
        sample, joint = map(int, np.unravel_index(int(np.nanargmax(beyond)), beyond.shape))
        if not beyond[sample, joint] > 0:
            return
        value, time = float(values[sample, joint]), float(self.time[sample])
        ends = float(lower[joint]), float(upper[joint])
        shown = ("N m" if self.units[joint] == "rad" else "N") if unit == "torque" else self.units[joint] + unit
        raise InputError(
            f"{self.joints[joint]} has the {what} {value:.4g} {shown} at {time:.4g} s, its limits are {ends[0]:.4g} "
            f"and {ends[1]:.4g} {shown}; choose a slower profile, as time_optimal(…, end_time=0.1), or another posture",
            joint=self.joints[joint],
            value=value,
            limit=ends,
            time=time,
        )


def sample_times(rate: float, duration: float) -> Array:
    """Return the times [s] from 0 to ``duration`` [s] at ``rate`` [Hz], (k,).

    Raises:
        InputError: the rate is not from 1e-3 to 1e5 Hz, it gives less than two samples, or more than 10 million.
    """
    rate = as_scalar("rate", rate, positive=True)
    if not 1e-3 <= rate <= _FASTEST:
        raise InputError(
            f"rate = {rate:g}, expected samples per second, from 0.001 to {_FASTEST:g} Hz", argument="rate", value=rate
        )
    count = int(duration * rate + _ROUNDING) + 1
    if not 2 <= count <= _MOST:
        raise InputError(
            f"rate = {rate:g} Hz over {duration:g} s gives {count} samples, expected from 2 to {_MOST}",
            argument="rate",
            value=rate,
        )
    return np.arange(count) / rate


def interpolate_motion(time: Array, q: Array, qd: Array, rate: float) -> tuple[Array, Array, Array, Array]:
    """Return times at ``rate`` [Hz], and q, q̇ and q̈ there of a motion with samples q and q̇, (k, n), at ``time`` (k,).

    Positions are cubics through q and q̇, velocities cubics through q̇ and its central differences.

    Raises:
        InputError: there are less than three samples, or the rate gives less than two.
    """
    from scipy.interpolate import CubicHermiteSpline  # takes a tenth of a second to load

    if len(time) < 3:
        raise InputError(f"the motion has {len(time)} samples, expected three or more", value=len(time), limit=3)
    at = sample_times(rate, float(time[-1] - time[0]))
    velocity = CubicHermiteSpline(time - time[0], qd, np.gradient(qd, time, axis=0, edge_order=2))
    return at, CubicHermiteSpline(time - time[0], q, qd)(at), velocity(at), velocity(at, 1)
