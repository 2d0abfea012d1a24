"""Numbers that sum up the torques of a run: how large they are, how near to their limits, and how noisy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.torque_limits import torque_limits
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run

_DEMAND = "tau_demand"


def torque_metrics(run: Run, late: Run) -> dict[str, Array]:
    """What can be said of the torques of a run, (rollout,) each: peaks of all of it, noise of its ``late`` part.

    Of several joints each number is that of the one where it is largest.
    """
    values = {f"{name}_peak": np.abs(run.array(name)).max((1, 2)) for name in (_DEMAND, "tau") if name in run.data}
    limits = _limits(run)
    if np.isfinite(limits).any():
        values["tau_demand_ratio"] = (np.abs(run.array(_DEMAND)).max(1) / limits).max(-1)
    noise = noise_deviation(late.array(_DEMAND))
    values["tau_noise"] = noise.max(-1)
    heard = _sensor_error(late)
    if (heard > 0).any():
        gains = np.divide(noise, heard, out=np.zeros_like(noise), where=heard > 0)
        values["noise_amplification"] = gains.max(-1)
    return values


def noise_deviation(values: Array) -> Array:
    """Standard deviation of the white noise on smooth signals (rollout, time, joint), (rollout, joint).

    From second differences, in which what is smooth cancels: √(mean (y_{k+1} − 2 y_k + y_{k−1})² / 6), as the
    variance of one is (1 + 4 + 1) σ². It is NaN of less than three samples. (T. Gasser, L. Sroka and C.
    Jennen-Steinmetz, Residual variance and residual pattern in nonlinear regression, Biometrika 73, 1986.) What a
    smooth signal with the second derivative ÿ adds is h² ÿ / √6 at the period h. Noise that comes through a difference
    of two samples is not white, and counts √(5/3) times its deviation.
    """
    if values.shape[1] < 3:
        return np.full((len(values), values.shape[2]), np.nan)
    return np.sqrt(_mean_square(np.diff(values, 2, axis=1)) / 6)


def _sensor_error(run: Run) -> Array:
    """RMS of what is measured of the positions less the positions, (rollout, joint)."""
    if "q_measured" not in run.data:
        return np.zeros((run.rollouts, run.data.sizes["joint"]))
    return np.sqrt(_mean_square(run.array("q_measured") - run.array("q")))


def _mean_square(values: Array) -> Array:
    """Of (rollout, time, joint) over the time; the same to the last bit however many rollouts there are."""
    return np.ascontiguousarray(np.moveaxis(values**2, 1, -1)).mean(-1)


def _limits(run: Run) -> Array:
    """Torque limits [N m], (rollout, n); inf without one, or where the run does not know its robot."""
    try:
        robots: Sequence[RobotModel | None] = run.robots
    except InputError:
        robots = [None]
    each = {id(robot): torque_limits(run, robot) for robot in robots}
    return np.array([each[id(robot)] for robot in robots])
