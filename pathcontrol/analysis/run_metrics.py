"""Metrics of a run: errors in steady state, along and across the path, and settling times."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_array, as_scalar, norms
from pathcontrol._expect import expect
from pathcontrol.analysis.coverage import measure_coverage, path_points
from pathcontrol.analysis.gamma import distance_to_gamma, planned_rate
from pathcontrol.analysis.lap_table import lap_time
from pathcontrol.analysis.limit_shares import RATIOS, limit_ratios
from pathcontrol.analysis.metric_helpers import (
    apply_by_task,
    apply_where_finite,
    resolve_task,
    root_mean_square,
    split_by_task,
)
from pathcontrol.analysis.metric_names import LABELS, UNITS, check_metric_names
from pathcontrol.analysis.progress import progress
from pathcontrol.analysis.tool_metrics import NAMES as TOOL_METRICS
from pathcontrol.analysis.tool_metrics import tool_metrics
from pathcontrol.analysis.torque import NAMES as TORQUE_METRICS
from pathcontrol.analysis.torque import torque_metrics
from pathcontrol.analysis.window import Samples, Window, samples_of
from pathcontrol.errors import InputError, TaskError, warn
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

__all__ = ["LABELS", "UNITS"]

_ERRORS = ("e_p", "e_v", "lag_error", "contour_error", "gamma_distance")
_WIDEST_BAND = 1.0  # rad, beyond which a band is probably in degrees
_OF_ERRORS = [f"{name}_{kind}" for name in _ERRORS for kind in ("peak", "rms")]


def steady_state(run: Run, fraction: float = 0.5) -> Run:
    """Return the last ``fraction`` of the time until the last rollout finished; the paper takes the second half.

    Rollouts that are finished at different times have no such time in common: :func:`metrics` takes each one's own.
    """
    expect("run", run, Run)
    own, time = samples_of(run, None, fraction), run.time
    last = time[own.stop.max() - 1]
    begin = last - fraction * (last - time[0])
    start, stop = np.flatnonzero((time >= begin) & (time <= last))[[0, -1]]
    return run.excerpt(np.arange(run.rollouts), int(stop) + 1, int(start))


def peak(values: ArrayLike) -> Array:
    """Return the largest value over time, (rollout,) from (rollout, time)."""
    return np.asarray(as_array("values", values).max(-1))


def rms(values: ArrayLike) -> Array:
    """Return the root mean square over time, (rollout,) from (rollout, time)."""
    return np.asarray(np.sqrt(np.ascontiguousarray(as_array("values", values) ** 2).mean(-1)))


def contour_error(run: Run, task: PathTask | None = None) -> Array:
    """Return ‖q_d(σ̄(q)) − q‖ [rad], (rollout, time): the distance from the path, independent of s.

    The path is ``run.task`` unless another is given.
    """
    return apply_by_task(_contour_error, run, task)


def _contour_error(run: Run, task: PathTask) -> Array:
    """Return the contour error for one task."""
    return _distance(task, run.array("q"))


def _distance(task: PathTask, q: Array) -> Array:
    """Return the distance from the path, (rollout, time), of joint positions (rollout, time, n)."""
    return apply_where_finite(lambda q: np.linalg.norm(task.q_d(task.sigma_bar(q)) - q, axis=-1), q)


def lag_error(run: Run, task: PathTask | None = None) -> Array:
    """Return the component of q_d(s) − q along the path [rad], (rollout, time): > 0 where the arm is behind s.

    The path is ``run.task`` unless another is given.
    """
    return apply_by_task(_lag_error, run, task)


def _lag_error(run: Run, task: PathTask) -> Array:
    """Return the lag error for one task."""
    return _lag(task, run.array("s"), run.array("q"))


def _lag(task: PathTask, s: Array, q: Array) -> Array:
    """Return the lag, (rollout, time), at path parameters (rollout, time) and joint positions (rollout, time, n)."""

    def lag(s: Array, q: Array) -> Array:
        tangent = task.dq_d(s)
        return ((task.q_d(s) - q) * tangent).sum(-1) / np.linalg.norm(tangent, axis=-1)

    return apply_where_finite(lag, s, q)


def settling_time(values: ArrayLike, time: ArrayLike, band: float) -> Array:
    """Return the time [s] from which ``values`` (rollout, time) stay within ``band``, (rollout,).

    It is inf where they never do, and NaN where some are NaN.

    Raises:
        InputError: there is not one value for each time, or the band is not positive.
    """
    values, time = as_array("values", values), as_array("time", time)
    if time.ndim != 1 or not time.size or values.shape[-1:] != time.shape:
        raise InputError(
            f"values have shape {values.shape} and time {time.shape}, expected (rollout, time) and (time,)",
            argument="values",
            value=values,
        )
    outside = np.abs(values) > as_scalar("band", band, positive=True)
    last = values.shape[-1] - 1 - np.argmax(outside[..., ::-1], axis=-1)
    after = np.append(time, np.inf)[last + 1]
    return np.where(np.isnan(values).any(-1), np.nan, np.where(outside.any(-1), after, time[0]))


def end_error(run: Run, task: PathTask | None = None) -> Array:
    """Return ‖q_d(s_end) − q‖ [rad] when the rollout finished, (rollout,); NaN where it did not.

    The path is ``run.task`` unless another is given.

    Raises:
        TaskError: the path has no end.
    """
    return apply_by_task(_end_error, run, task)


def _end_error(run: Run, task: PathTask) -> Array:
    """Return the end error for one task."""
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
    *,
    window: Window | None = None,
) -> dict[str, Any]:
    """Return the usual metrics of a run on its task, or on another, each a list with one entry for each rollout.

    The time of a rollout is its own: it ends when that rollout is finished, whatever others do, and so the numbers of
    a rollout are the same alone and beside any others. Of that time the last ``fraction`` counts, unless a ``window``
    is given, for: peaks and RMS of ‖e_p‖ [rad], ‖e_v‖ [rad/s], contour and lag error [rad] and distance to Γ;
    ``speed_ratio``, the mean rate of s over the mean of ϑ, 1 for an arm that is as fast as it should be and 0 for one
    that is stuck; the standard deviation of the noise on the torque demand [N m], see
    :func:`~pathcontrol.analysis.torque.noise_deviation`, and its amplification [N m/rad]: that deviation over the RMS
    error of the measured position, by encoder and noise, of the same joint, left out where positions are measured
    exactly. Both are those of the joint where they are largest. On an open path ϑ and Γ are those of the plan, which
    comes to rest at the end: an arm that does what the plan asks for has the ratio 1 and the distance 0.

    All of a rollout's time counts for: settling time [s] of ‖e_p‖ into ``band`` [rad]; largest torque demand and
    largest torque that acted [N m], over all joints; the largest share that a demand has of its limit; the largest
    shares that position, velocity and torque have of their limits, ``position_limit_ratio``, ``velocity_limit_ratio``
    and ``torque_limit_ratio``, above 1 where a limit is passed; shares are left out where nothing is limited. Limits
    of torques are those that act, as a :class:`TorqueLimitDrop` leaves them, for a demand while it acts.

    What says whether the arm went along the path at all: ``progress``, the share of what was to be passed that s has
    passed, see :func:`~pathcontrol.analysis.progress.progress`; ``coverage``, the share of the path's length to which
    the arm came within ``band``; and ``path_deviation_peak`` [rad], how far the farthest point of the path is from
    where the arm was, which is the contour error the other way round.

    Of a path made for a frame of the arm, such as a :class:`CartesianPath` and what is made of one, for the same time
    as the errors: mean and largest speed of the tool, and the mean ``feed`` that the path asks for at s, all [m/s];
    ``tool_deviation_peak`` and ``tool_deviation_rms`` [m], from the curve on which q_d leads the tool (of a toolpath
    from its drawing), and ``orientation_error_peak`` [rad], the largest angle between the tool and itself at q_d(s),
    of its z axis only where it may turn about that, and left out where its orientation is free.

    Contour error, coverage and distance to Γ are left out for paths that neither end nor repeat. Open paths have the
    time [s] after which they were finished, and the :func:`end_error` [rad], each NaN where they were not; closed ones
    ``lap_time`` [s], the mean of their whole laps, see :func:`~pathcontrol.analysis.lap_table.lap_times`. All numbers
    of a rollout that diverged are NaN. Of these, those that ``only`` names; the distance to Γ takes the most time.

    Rollouts with a task each have the numbers of their own.

    Args:
        run: the run.
        task: the path; by default the run's own.
        fraction: how much of its time counts for errors, if no ``window`` is given.
        band: band of the settling time and of coverage [rad].
        only: the metrics wanted.
        window: from when to when the errors are, ``(t0, t1)`` in seconds, or ``"second half"`` or ``"all"`` of each
            rollout's time. A rollout that was finished before has NaN there.

    Raises:
        InputError: no task is known, it has other joints, or a setting is something else.
        UnknownNameError: there is no such metric, or a variable is missing in the run.
        TaskError: the task returns something it must not.
    """
    band = as_scalar("band", band, positive=True)
    check_metric_names("only", only)
    if band > _WIDEST_BAND and "q" in run and run.unit("q") == "rad":
        said = f"band = {band:g} rad is {np.rad2deg(band):.3g} deg"
        warn(f"{said}; did you mean {band:g} deg? Then give np.deg2rad({band:g})")
    values: dict[str, Array] = {}
    for part, own, rows in split_by_task(run, resolve_task(run, task)):
        counted = samples_of(part, window, fraction)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # numbers from a file may be huge
            found = _metrics(part, own, counted, band, only)
        for name, value in found.items():
            values.setdefault(name, np.full(run.rollouts, np.nan))[rows] = value
    return {name: value.tolist() for name, value in values.items()}


def _metrics(run: Run, task: PathTask, counted: Samples, band: float, only: Collection[str]) -> dict[str, Array]:
    """Return the metrics of rollouts with one task, (rollout,) each."""
    own, wanted = samples_of(run, "all"), set(only)
    values: dict[str, Array] = {}
    makers: list[tuple[Collection[str], Callable[[], Mapping[str, Array]]]] = [
        (_OF_ERRORS, lambda: _measure_errors(run, task, counted, wanted)),
        (("speed_ratio",), lambda: {"speed_ratio": _speed_ratio(run, task, counted)}),
        (("settling_time",), lambda: {"settling_time": _settling_times(run, own, band)}),
        (TORQUE_METRICS, lambda: torque_metrics(run, own, counted)),
        (RATIOS, lambda: limit_ratios(run, own)),
        (TOOL_METRICS, lambda: tool_metrics(run, task, counted, only)),
        (("progress",), lambda: {"progress": progress(run, task)}),
        (("coverage", "path_deviation_peak"), lambda: _cover_path(run, task, own, band)),
        (("path_time", "end_error"), lambda: _measure_end(run, task)),
        (("lap_time",), lambda: {"lap_time": lap_time(run, task)} if task.closed else {}),
    ]
    for names, make in makers:
        if not wanted.isdisjoint(names):
            values |= make()
    sound = run.status != "diverged"
    return {name: np.where(sound, value, np.nan) for name, value in values.items() if name in wanted}


def _measure_errors(run: Run, task: PathTask, counted: Samples, wanted: Collection[str]) -> dict[str, Array]:
    """Return peaks and RMS of errors over the samples that count, (rollout,) each."""
    late, values = counted.of_span(), dict[str, Array]()

    def of(*names: str) -> list[Array]:
        return [late.within(run.array(name, counted.span)) for name in names]

    signals: dict[str, Callable[[], Array]] = {
        "e_p": lambda: norms(*of("e_p")),
        "e_v": lambda: norms(*of("e_v")),
        "lag_error": lambda: np.abs(_lag(task, *of("s", "q"))),
        "contour_error": lambda: _distance(task, *of("q")),
        "gamma_distance": lambda: _gamma_distance(task, *of("q", "qd")),
    }
    for name, signal in signals.items():
        of_it: dict[str, Callable[..., float | Array]] = {f"{name}_peak": np.max, f"{name}_rms": root_mean_square}
        if not set(wanted).isdisjoint(of_it):
            with suppress(TaskError):  # no nearest point on an endless path
                found = signal()
                values |= {key: late.reduce(reduce, found) for key, reduce in of_it.items() if key in wanted}
    return values


def _gamma_distance(task: PathTask, q: Array, qd: Array) -> Array:
    """Return the distance to Γ with the braking that controllers plan, (rollout, time)."""
    return np.asarray(distance_to_gamma(task, q, qd, braking=True))


def _speed_ratio(run: Run, task: PathTask, counted: Samples) -> Array:
    """Return the mean rate of s over the mean of the planned rate, (rollout,)."""
    theta = apply_where_finite(lambda s: planned_rate(task, s), counted.within(run.array("s")))
    return counted.reduce(np.mean, run.array("sdot")) / counted.reduce(np.mean, theta)


def _settling_times(run: Run, own: Samples, band: float) -> Array:
    """Return the settling time of ‖e_p‖ of each rollout [s], (rollout,)."""
    e_p = run.norm("e_p")
    time = np.broadcast_to(run.time, e_p.shape)
    return own.reduce(lambda e, t: settling_time(e[None], t, band)[0], e_p, time)


def _measure_end(run: Run, task: PathTask) -> dict[str, Array]:
    """Return when an open path was finished and how far from its end, (rollout,) each."""
    return {"path_time": run.finish_time, "end_error": _end_error(run, task)} if np.isfinite(task.s_end) else {}


def _cover_path(run: Run, task: PathTask, own: Samples, band: float) -> dict[str, Array]:
    """Return the covered share of the path, and the distance of its farthest point, (rollout,) each."""
    try:
        points = path_points(task)
    except TaskError:  # nor does an endless path have a share
        return {}
    share, farthest = own.reduce(lambda q: np.array(measure_coverage(points, q, band)), run.array("q")).T
    return {"coverage": share, "path_deviation_peak": farthest}
