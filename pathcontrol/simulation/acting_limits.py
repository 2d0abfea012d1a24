"""The torque limits that act in a run, where they are not the same all the time and for all rollouts."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.simulation.arm.disturbance import Disturbance, list_terms
from pathcontrol.simulation.arm.torque_limit_drop import TorqueLimitDrop
from pathcontrol.simulation.loops import Arm, ContinuousTime, SampledLoop, torque_limits


def record_limits(
    arrays: Mapping[str, Array],
    time: Array,
    loop: SampledLoop | ContinuousTime,
    robot: Arm,
    disturbance: Disturbance | None,
) -> dict[str, Array]:
    """Return the variable ``tau_limit`` of a run with these ``arrays``, or none where its configuration says enough."""
    whole = torque_limits(loop, robot)
    limits = acting_limits(whole, disturbance, time)
    if whole is None or limits is None or (limits == np.atleast_2d(whole)[0]).all():
        return {}
    tau = arrays["tau"]
    left, gone = np.broadcast_to(limits, tau.shape), np.isnan(tau)
    return {"tau_limit": np.where(gone, np.nan, left) if gone.any() else left}


def acting_limits(limits: Array | None, disturbance: Disturbance | None, time: Array) -> Array | None:
    """Return torque limits [N m], (n,) or (N, n), as a disturbance leaves them from each time of a run on.

    They are (1 or N, 1 or time, n); ``None`` where there are none.
    """
    if limits is None:
        return None
    limits, middle = np.atleast_2d(limits), time + 0.5 * (time[1] - time[0] if len(time) > 1 else 0.0)
    shares = [share for term in list_terms(disturbance) if (share := _share_of(term, middle)) is not None]
    return _lower(limits[:, None], reduce(np.multiply, shares).swapaxes(0, 1)) if shares else limits[:, None]


def _share_of(term: Disturbance, times: Array) -> Array | None:
    """Return the share of the torque limits that a disturbance leaves, (time, 1 or N, 1 or n), ``None`` for all."""
    if type(term).torque_factor is Disturbance.torque_factor:
        return None
    if type(term) is TorqueLimitDrop:  # takes all times at once; one of one's own may not
        return term.torque_factor(times[:, None])
    found = [term.torque_factor(t) for t in times]
    return np.stack(np.broadcast_arrays(*(np.atleast_2d(1.0 if share is None else share) for share in found)))


def _lower(limits: Array, share: Array) -> Array:
    """Return a share of limits; of no limit, inf, nothing is 0."""
    with np.errstate(invalid="ignore"):
        return np.where(share == 0, 0.0, limits * share)
