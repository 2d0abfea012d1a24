"""Numbers that sum up a run: errors in steady state, along and across the path, and when they settled."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, scalar
from pathcontrol._expect import expect
from pathcontrol.analysis.gamma import distance_to_gamma
from pathcontrol.analysis.known import by_task, known_task, of_rollouts, where_known
from pathcontrol.analysis.torque import torque_metrics
from pathcontrol.errors import InputError, TaskError
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.base import PathTask

#: the unit of each metric
UNITS = {
    **{f"{name}_{kind}": "rad" for name in ("e_p", "lag_error", "contour_error") for kind in ("peak", "rms")},
    **{f"{name}_{kind}": "rad/s" for name in ("e_v",) for kind in ("peak", "rms")},
    **{f"gamma_distance_{kind}": "rad" for kind in ("peak", "rms")},
    "speed_ratio": "",
    "settling_time": "s",
    "tau_demand_peak": "N m",
    "tau_peak": "N m",
    "tau_demand_ratio": "",
    "tau_noise": "N m",
    "noise_amplification": "N m/rad",
    **{f"tool_deviation_{kind}": "m" for kind in ("peak", "rms")},
    "smoothing_deviation": "m",
    "path_time": "s",
    "end_error": "rad",
}
#: what each metric is called where a person reads, in the order in which they are shown
LABELS = {
    "tool_deviation_peak": "tool from the drawing, peak",
    "tool_deviation_rms": "tool from the drawing, RMS",
    "smoothing_deviation": "smooth curves from the drawing",
    "e_p_peak": "‖e_p‖ peak",
    "e_p_rms": "‖e_p‖ RMS",
    "e_v_peak": "‖e_v‖ peak",
    "e_v_rms": "‖e_v‖ RMS",
    "contour_error_peak": "contour error, peak",
    "contour_error_rms": "contour error, RMS",
    "lag_error_peak": "lag error, peak",
    "lag_error_rms": "lag error, RMS",
    "gamma_distance_peak": "distance to Γ, peak",
    "gamma_distance_rms": "distance to Γ, RMS",
    "speed_ratio": "speed, mean σ̇ over mean ϑ",
    "settling_time": "settling time of ‖e_p‖",
    "path_time": "time for the path",
    "end_error": "‖e_p‖ at the end",
    "tau_demand_peak": "torque demand, peak",
    "tau_peak": "torque that acted, peak",
    "tau_demand_ratio": "torque demand over its limit, peak",
    "tau_noise": "noise of the torque demand",
    "noise_amplification": "noise of the torque over that of the position",
}


def steady_state(run: Run, fraction: float = 0.5) -> Run:
    """The last ``fraction`` of a run; the paper's peaks are those of the second half."""
    expect("run", run, Run)
    fraction = scalar("fraction", fraction, positive=True)
    if fraction > 1:
        raise InputError(f"fraction = {fraction:g}, expected a number from 0 to 1")
    first, last = run.time[0], run.time[-1]
    return run.with_data(run.data.sel(time=run.time >= last - fraction * (last - first)))


def peak(values: Array) -> Array:
    """The largest value over time, (rollout,) of (rollout, time)."""
    return values.max(-1)


def rms(values: Array) -> Array:
    """The root mean square over time, (rollout,) of (rollout, time)."""
    return np.sqrt(_mean(values**2))


def _mean(values: Array) -> Array:
    """The mean over time, the same to the last bit however many rollouts lie beside one another in memory."""
    return np.ascontiguousarray(values).mean(-1)


def contour_error(run: Run, task: PathTask | None = None) -> Array:
    """‖q_d(σ̄(q)) − q‖ [rad], (rollout, time): distance from the path itself, whatever s the controller was at.

    The path is ``run.task`` unless another is given.
    """
    return of_rollouts(_contour_error, run, task)


def _contour_error(run: Run, task: PathTask) -> Array:
    return where_known(lambda q: np.linalg.norm(task.q_d(task.sigma_bar(q)) - q, axis=-1), run.array("q"))


def lag_error(run: Run, task: PathTask | None = None) -> Array:
    """Component of q_d(s) − q along the path [rad], (rollout, time): positive where the arm is behind s.

    The path is ``run.task`` unless another is given.
    """
    return of_rollouts(_lag_error, run, task)


def _lag_error(run: Run, task: PathTask) -> Array:
    def lag(s: Array, q: Array) -> Array:
        tangent = task.dq_d(s)
        return ((task.q_d(s) - q) * tangent).sum(-1) / np.linalg.norm(tangent, axis=-1)

    return where_known(lag, run.array("s"), run.array("q"))


def settling_time(values: Array, time: Array, band: float) -> Array:
    """The time [s] from which ``values`` (rollout, time) stay within ``band``, (rollout,).

    It is inf where they never do, and NaN where some are no numbers.
    """
    outside = np.abs(values) > scalar("band", band, positive=True)
    last = values.shape[-1] - 1 - np.argmax(outside[:, ::-1], axis=-1)
    after = np.append(time, np.inf)[last + 1]
    return np.where(np.isnan(values).any(-1), np.nan, np.where(outside.any(-1), after, time[0]))


def end_error(run: Run, task: PathTask | None = None) -> Array:
    """‖q_d(s_end) − q‖ [rad] when the rollout was finished, (rollout,); NaN where it was not.

    The path is ``run.task`` unless another is given.

    Raises:
        TaskError: the path has no end.
    """
    return of_rollouts(_end_error, run, task)


def _end_error(run: Run, task: PathTask) -> Array:
    if not np.isfinite(task.s_end):
        raise TaskError(f"{type(task).__name__} has no end that an arm could be away from")
    finished = run.status == "finished"
    samples = np.searchsorted(run.time, np.where(finished, run.finish_time, run.time[0]))
    q = run.array("q")[np.arange(run.rollouts), np.minimum(samples, len(run.time) - 1)]
    return np.where(finished, np.linalg.norm(task.q_d(np.array(task.s_end)) - q, axis=-1), np.nan)


def metrics(
    run: Run,
    task: PathTask | None = None,
    fraction: float = 0.5,
    band: float = np.deg2rad(2.0),
    only: Collection[str] = tuple(UNITS),
) -> dict[str, Any]:
    """The usual numbers of a run on its task, or on another, each a list with one entry for each rollout.

    Peaks and RMS of ‖e_p‖ [rad], ‖e_v‖ [rad/s], contour and lag error [rad] and distance to Γ over the last
    ``fraction`` of the time; there also the mean rate of s over the mean of ϑ, 1 for an arm that is as fast as it
    should be and 0 for one that is stuck; settling time [s] of ‖e_p‖ into ``band`` [rad].

    Largest torque demand and largest torque that acted [N m], over all joints and all of the time; the largest share
    that a demand has of its limit, the loop's or else the robot's, left out where nothing is limited. Over the last
    ``fraction`` of the time, the standard deviation of the noise on the torque demand [N m], see
    :func:`~pathcontrol.analysis.torque.noise_deviation`, and its amplification [N m/rad]: that deviation over the RMS
    error of the measured position, by encoder and noise, of the same joint, left out where positions are measured
    exactly. Both are those of the joint where they are largest.

    Contour error and distance to Γ are left out for paths that neither end nor repeat. Open paths have the time [s]
    after which they were finished, and the :func:`end_error` [rad], each NaN where they were not. All numbers of a
    rollout that diverged are NaN. Of these, those that ``only`` names; the distance to Γ takes the most time.

    Rollouts with a task each have the numbers of their own.
    """
    values: dict[str, Array] = {}
    for part, own, rows in by_task(run, known_task(run, task)):
        for name, value in _metrics(part, own, fraction, band, only).items():
            values.setdefault(name, np.full(run.rollouts, np.nan))[rows] = value
    return {name: value.tolist() for name, value in values.items()}


def _metrics(run: Run, task: PathTask, fraction: float, band: float, only: Collection[str]) -> dict[str, Array]:
    """The metrics of rollouts with one task, (rollout,) each."""
    late = steady_state(run, fraction)
    signals = {"e_p": late.norm("e_p"), "e_v": late.norm("e_v"), "lag_error": np.abs(_lag_error(late, task))}
    try:
        if not {"contour_error_peak", "contour_error_rms"}.isdisjoint(only):
            signals["contour_error"] = _contour_error(late, task)
        if not {"gamma_distance_peak", "gamma_distance_rms"}.isdisjoint(only):
            signals["gamma_distance"] = where_known(
                lambda q, qd: np.asarray(distance_to_gamma(task, q, qd)), late.array("q"), late.array("qd")
            )
    except TaskError:
        pass  # no nearest point on an endless path
    values = {f"{name}_peak": peak(v) for name, v in signals.items()}
    values |= {f"{name}_rms": rms(v) for name, v in signals.items()}
    theta = where_known(lambda s: task.at(s).theta, late.array("s"))
    values["speed_ratio"] = _mean(late.array("sdot")) / _mean(theta)
    values["settling_time"] = settling_time(run.norm("e_p"), run.time, band)
    values |= torque_metrics(run, late)
    if np.isfinite(task.s_end):
        values |= {"path_time": run.finish_time, "end_error": _end_error(run, task)}
    sound = run.status != "diverged"
    return {name: np.where(sound, value, np.nan) for name, value in values.items() if name in only}
