"""Metrics of the torques of a run: their size, their share of limits, and their noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.disturbance_estimate import split_loop_delay
from pathcontrol.analysis.limit_shares import stack_torque_limits
from pathcontrol.analysis.lost_samples import find_lost
from pathcontrol.analysis.torque_limits import torque_shares
from pathcontrol.analysis.window import Samples
from pathcontrol.simulation.config import laws
from pathcontrol.simulation.run import Run

_DEMAND = "tau_demand"
#: the metrics of :func:`torque_metrics`
NAMES = ("tau_demand_peak", "tau_peak", "tau_demand_ratio", "tau_noise", "noise_amplification")


def torque_metrics(run: Run, own: Samples, counted: Samples) -> dict[str, Array]:
    """Return the metrics of torques, (rollout,) each: peaks of all samples, noise of those ``counted``.

    Each is the largest over the joints. Samples to which no measurement came in a ``Dropout`` are none of noise: the
    torque jumps when the next one comes, and a frozen measurement is no error of the sensor.
    """
    values = {f"{name}_peak": own.reduce(_peak, run.array(name)).max(-1) for name in (_DEMAND, "tau") if name in run}
    limits = stack_torque_limits(run)
    if np.isfinite(limits).any():
        shares = torque_shares(run.array(_DEMAND), _limits_of_demands(limits, run))
        values["tau_demand_ratio"] = own.reduce(_peak, shares).max(-1)
    lost = find_lost(run, filtered=False)
    noise = _expand_joints(counted.reduce(_noise, run.array(_DEMAND), _compensated_direction(run), lost), run)
    values["tau_noise"] = noise.max(-1)
    if "q_measured" in run:
        heard = _expand_joints(counted.reduce(_rms, run.array("q_measured") - run.array("q"), lost), run)
        if (heard > 0).any():
            gains = np.divide(noise, heard, out=0.0 * heard, where=heard > 0)
            values["noise_amplification"] = gains.max(-1)
    return values


def _limits_of_demands(limits: Array, run: Run) -> Array:
    """Return the least of the limits (rollout, 1 or time, n) while each demand acts, which a delay makes later."""
    whole, late = split_loop_delay(run)
    last = limits.shape[1] - 1
    begin = np.minimum(np.arange(last + 1) + whole, last)
    return np.minimum(limits[:, begin], limits[:, np.minimum(begin + (late > 0), last)])


def noise_deviation(values: Array, left_out: NDArray[np.bool_] | None = None) -> Array:
    """Return the standard deviation of the white noise on smooth signals (rollout, time, joint), (rollout, joint).

    It follows from second differences, in which smooth parts cancel: √(mean (y_{k+1} − 2 y_k + y_{k−1})² / 6), as the
    variance of one is (1 + 4 + 1) σ². It is NaN for less than three samples. (T. Gasser, L. Sroka and C.
    Jennen-Steinmetz, Residual variance and residual pattern in nonlinear regression, Biometrika 73, 1986.) A
    smooth signal with the second derivative ÿ adds h² ÿ / √6 at the period h. Noise that comes through a difference
    of two samples is not white, and counts √(5/3) times its deviation.

    Differences over a step from one sample to the next are ``left_out``, (rollout, time − 1, joint), where the signal
    is known to jump for another reason than noise.
    """
    if values.shape[1] < 3:
        return np.full((len(values), values.shape[2]), np.nan)
    none = np.zeros((len(values), values.shape[1] - 1, values.shape[2]), dtype=bool)
    steps = none if left_out is None else left_out
    return np.stack([_noise_of_one(*row) for row in zip(values, steps, strict=True)])


def _noise(values: Array, unsteady: Array, lost: NDArray[np.bool_]) -> Array:
    """Return the deviation of one rollout, (joint,), from torques (time, joint) and compensated directions.

    Steps from and to ``lost`` samples (time,) do not count.
    """
    gap = (lost[1:] | lost[:-1])[:, None]
    return noise_deviation(values[None], ((np.diff(unsteady, axis=0) != 0) | gap)[None])[0]


def _noise_of_one(values: Array, left_out: NDArray[np.bool_]) -> Array:
    """Return the deviation of the noise of one rollout, (joint,)."""
    counted = ~(left_out[1:] | left_out[:-1])
    squares = np.where(counted, np.diff(values, 2, axis=0) ** 2, 0.0)
    number = counted.sum(0)
    total = np.ascontiguousarray(squares.T).sum(-1)
    return np.sqrt(np.divide(total, 6 * number, out=np.full(len(total), np.nan), where=number > 0))


def _compensated_direction(run: Run) -> Array:
    """Return the direction in which a law compensates dry friction, (rollout, time, joint): +1, −1 or 0.

    Where it changes, the torque jumps by design and not by noise: see :meth:`Controller.friction_torque`. It is 0 for a
    law without such compensation.
    """
    known = all(name in run for name in ("qd_measured", "e_v"))
    if not known or not any(law.get("friction") == "full" for law in laws(run.config)):
        return np.zeros_like(run.array(_DEMAND))
    measured = run.array("qd_measured")
    return np.sign(np.where(measured == 0, run.array("e_v"), measured))


def _peak(values: Array) -> Array:
    """Return the largest size over time, (joint,) from (time, joint)."""
    return np.abs(values).max(0)


def _rms(values: Array, lost: NDArray[np.bool_]) -> Array:
    """Return the RMS over the times that are not ``lost``, (joint,) from (time, joint); NaN where all are.

    It is bit-identical for any number of rollouts.
    """
    came = np.ascontiguousarray((values[~lost] ** 2).T)
    return np.sqrt(came.mean(-1)) if came.size else np.full(values.shape[-1], np.nan)


def _expand_joints(values: Array, run: Run) -> Array:
    """Return values as (rollout, joint), also where no rollout has a sample."""
    return np.broadcast_to(values.reshape(len(values), -1), (len(values), len(run.array("joint"))))
