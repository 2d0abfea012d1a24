"""The fastest traversal of a path, solved again until no limit is exceeded inside the cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.profiles.topp.binding import Binding, check_rate, check_static_load, find_binding
from pathcontrol.profiles.topp.cell_constraints import cells_of
from pathcontrol.profiles.topp.dynamics import Samples, Torques
from pathcontrol.profiles.topp.fastest_pair import fastest_pair
from pathcontrol.profiles.topp.joint_limits import JointLimits
from pathcontrol.profiles.topp.passes import Allowed, traverse_closed, traverse_open
from pathcontrol.profiles.topp.recheck import find_excess, tighten
from pathcontrol.profiles.topp.velocity_limits import check_bounded, end_limit, endless_speed, speed_limit

_ROUNDS = 12


class Demand(NamedTuple):
    """A path to be passed within limits, and the rates at the ends of an open one, ``None`` for free ones.

    Attributes:
        start_rate: ṡ at the start [1/s].
        end_rate: ṡ at the end [1/s].
        end_time: time constant of the approach to the end [s].
    """

    limits: JointLimits
    samples: Samples
    torques: Torques
    closed: bool
    start_rate: float | None
    end_rate: float | None
    end_time: float | None


def fastest(demand: Demand) -> tuple[Array, Binding]:
    """Return ṡ² at the knots (N + 1,) of the fastest traversal, and the limits that bind there.

    Raises:
        InputError: nothing limits the speed somewhere.
        TaskError: the demand cannot be met; the message names the joint, the limit and s.
    """
    limits, samples, torques = demand.limits, demand.samples, demand.torques
    check_static_load(limits, samples, torques)
    endless = endless_speed(limits, samples, torques)
    speed = speed_limit(limits, samples, endless)
    if demand.end_time is not None:
        speed = np.minimum(speed, end_limit(samples, demand.end_time))
    check_bounded(samples, np.where(np.isinf(speed), speed, 0.0), endless)
    cells = cells_of(limits, samples, torques, speed)
    allowed = Allowed(cells, speed, *fastest_pair(cells, speed[1:]))
    for _ in range(_ROUNDS):
        x = _traversal(demand, allowed)
        over = find_excess(limits, samples, torques, cells, x)
        if not over.cells.any():
            check_bounded(samples, x, endless)
            return x, find_binding(limits, samples, cells, x)
        allowed = tighten(allowed, cells, over, x)
    where = samples.knots.s[over.cells.argmax()]
    raise TaskError(
        f"{len(x)} points do not resolve the path near s = {where:.6g}: limits are exceeded between them; give more",
        s=float(where),
    )


def _traversal(demand: Demand, allowed: Allowed) -> Array:
    """Return ṡ² at the knots of the fastest traversal of the cells."""
    limits, samples, _, closed, start_rate, end_rate, end_time = demand
    if closed:
        return traverse_closed(allowed)
    largest, x = traverse_open(allowed, samples.widths, start_rate, end_rate if end_time is None else np.inf)
    check_rate(limits, samples, allowed.cells, "start_rate", start_rate, largest)
    check_rate(limits, samples, allowed.cells, "end_rate", end_rate, x)
    return x
