"""Upper bounds on ṡ² along a path: velocity limits, an approach to the end, and a bound for unlimited speed."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.profiles.topp.dynamics import Samples, Torques
from pathcontrol.profiles.topp.joint_limits import JointLimits

_ENDLESS = 1e6  # times the ṡ² that the arm's strength builds up over the path


def speed_limit(limits: JointLimits, samples: Samples, endless: float) -> Array:
    """Return the largest ṡ² at the knots within the velocity limits, (N + 1,); ``endless`` without any."""
    return np.minimum((limits.velocity / np.abs(samples.knots.dq)).min(-1) ** 2, endless)


def end_limit(samples: Samples, end_time: float) -> Array:
    """Return ṡ² of an approach to the end with the time constant ``end_time`` [s], but for the last cell, (N + 1,)."""
    s = samples.knots.s
    return (np.maximum(s[-1] - s, s[-1] - s[-2]) / end_time) ** 2


def endless_speed(limits: JointLimits, samples: Samples, torques: Torques) -> float:
    """Return an ṡ² out of reach of any arm that has limits; ``inf`` without limits of acceleration and torque."""
    strength = limits.shares(samples.knots.dq, torques.a, torques.a).max(initial=0.0)
    return float(_ENDLESS * samples.widths.sum() / strength)


def check_bounded(samples: Samples, x: Array, endless: float) -> None:
    """Check that a limit bounds ṡ² everywhere.

    Raises:
        InputError: ṡ² = x at the knots, (N + 1,), is ``endless`` somewhere.
    """
    fastest = int(x.argmax())
    if x[fastest] > 0.9 * endless or np.isinf(x[fastest]):
        raise InputError(
            f"nothing limits the speed at s = {samples.knots.s[fastest]:.6g}, where joints without limits move; limit "
            "their velocity",
            s=float(samples.knots.s[fastest]),
        )
