"""The fastest traversal of a path, solved again until no limit is exceeded inside the cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError
from pathcontrol.profiles.topp.binding import Binding, check_rate, check_static_load, find_binding
from pathcontrol.profiles.topp.cell_constraints import cells_of
from pathcontrol.profiles.topp.dynamics import Samples, Torques
from pathcontrol.profiles.topp.fastest_pair import fastest_pair
from pathcontrol.profiles.topp.joint_limits import JointLimits
from pathcontrol.profiles.topp.passes import Allowed, traverse_closed, traverse_open
from pathcontrol.profiles.topp.recheck import find_excess, tighten

_ROUNDS = 12
_ENDLESS = 1e6  # times the ṡ² that the arm's strength builds up over the path


class Demand(NamedTuple):
    """A path to be passed within limits, and the rates at the ends of an open one, ``None`` for an arm at rest.

    Attributes:
        start_rate: ṡ at the start [1/s], ∞ for any.
        end_rate: ṡ at the end [1/s], ∞ for any.
        end_time: time constant of the approach to the end [s].
    """

    limits: JointLimits
    samples: Samples
    torques: Torques
    closed: bool
    start_rate: float | None
    end_rate: float | None
    end_time: float | None


def fastest(demand: Demand) -> tuple[Array, Binding, NDArray[np.bool_]]:
    """Return ṡ² at the knots (N + 1,) of the fastest traversal, the limits that bind there, and the cells to be halved.

    Those are the cells, (N,), within which limits are exceeded whatever is tightened.

    Raises:
        InputError: nothing limits the speed somewhere.
        TaskError: the demand cannot be met; the message names the joint, the limit and s.
    """
    limits, samples, torques = demand.limits, demand.samples, demand.torques
    check_static_load(limits, samples, torques)
    endless = _endless_speed(limits, samples, torques)
    speed = _speed_limit(limits, samples, endless)
    if demand.end_time is not None:
        speed = np.minimum(speed, _end_limit(samples, demand.end_time))
    _check_bounded(samples, np.where(np.isinf(speed), speed, 0.0), endless)
    cells = cells_of(limits, samples, torques, speed)
    allowed = Allowed(cells, speed, *fastest_pair(cells, speed[1:]))
    for _ in range(_ROUNDS):
        x = _traversal(demand, allowed)
        over = find_excess(limits, samples, torques, cells, x)
        if not over.cells.any():
            _check_bounded(samples, x, endless)
            break
        allowed = tighten(allowed, cells, over, x)
    return x, find_binding(limits, samples, cells, x), over.cells


def _traversal(demand: Demand, allowed: Allowed) -> Array:
    """Return ṡ² at the knots of the fastest traversal of the cells."""
    limits, samples, _, closed, start_rate, end_rate, end_time = demand
    if closed:
        return traverse_closed(allowed)
    largest, x = traverse_open(allowed, samples.widths, start_rate, end_rate if end_time is None else np.inf)
    check_rate(limits, samples, allowed.cells, "start_rate", start_rate, largest)
    check_rate(limits, samples, allowed.cells, "end_rate", end_rate, x)
    return x


def _speed_limit(limits: JointLimits, samples: Samples, endless: float) -> Array:
    """Return the largest ṡ² at the knots within the velocity limits, (N + 1,); ``endless`` without any."""
    return np.minimum((limits.velocity / np.abs(samples.knots.dq)).min(-1) ** 2, endless)


def _end_limit(samples: Samples, end_time: float) -> Array:
    """Return ṡ² of an approach to the end with the time constant ``end_time`` [s], but for the last cell, (N + 1,)."""
    s = samples.knots.s
    return (np.maximum(s[-1] - s, s[-1] - s[-2]) / end_time) ** 2


def _endless_speed(limits: JointLimits, samples: Samples, torques: Torques) -> float:
    """Return an ṡ² out of reach of any arm that has limits; ``inf`` without limits of acceleration and torque."""
    strength = limits.shares(samples.knots.dq, torques.a, torques.a).max(initial=0.0)
    return float(_ENDLESS * samples.widths.sum() / strength)


def _check_bounded(samples: Samples, x: Array, endless: float) -> None:
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
