"""The measures of a comparison: contour and lag error told apart, and what an event costs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.power.torque_account import acting_torque
from pathcontrol.analysis.run_metrics import contour_error, lag_error, settling_time
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask

#: the unit of each measure of joints that turn
MEASURES = {
    "contour_peak": "rad",
    "contour_rms": "rad",
    "lag_peak": "rad",
    "speed_peak": "rad/s",
    "torque_peak": "N m",
    "recovery_s": "s",
    "time_lost_s": "s",
    "energy_j": "J",
    "saturated_s": "s",
}
#: an arm has recovered when its contour error stays within this many times its own undisturbed peak
RECOVERED = 1.1
_LEAST_BAND = 1e-4  # rad or m, of an arm that follows its path exactly
_ACCURACY, _MOST_PIECES = 1e-6, 500  # of a quadrature: s and relative, and pieces in which it parts the path
_SLACK = 1e-6  # share of a period, as times of samples are rounded
_AT_LIMIT = 1 - 1e-9  # share of a limit


def measure(
    run: Run, undisturbed: Run, window: tuple[float, float], event_end: float | None, limits: Array | None = None
) -> dict[str, Array]:
    """Return all :data:`MEASURES` of a run beside the undisturbed one with the same samples, (rollout,) each.

    All but the time lost are of the ``window``; those of a rollout that diverged are NaN, and those beside the
    undisturbed one if that did. ``event_end`` is when the event is over [s], or ``None`` where it never is, and no arm
    recovers, NaN. ``limits`` are of the torques from each sample on [N m], to be broadcast to (rollout, time, n).
    """
    lost, unknown = (one.status == "diverged" for one in (run, undisturbed))
    if lost.all():  # the run has ended, perhaps before the window
        return {name: np.full(run.rollouts, np.nan) for name in MEASURES}
    first, stop = find_samples(run.time, window)
    time, task = run.time[first:stop], run.task
    contour, calm = (contour_error(one)[:, first:stop] for one in (run, undisturbed))
    torque, speed = run.array("tau")[:, first:stop], run.array("qd")[:, first:stop]
    normal = np.where(unknown, np.nan, calm.max(-1, initial=0.0))
    late = np.full(run.rollouts, np.nan) if task is None else time_lost(run, undisturbed, task)
    at_limit = np.zeros(torque.shape[:2], dtype=bool) if limits is None else is_at_limit(run, limits)[:, first:stop]
    saturated = np.where(at_limit[:, :-1], np.diff(time), 0.0)
    values = {
        "contour_peak": contour.max(-1),
        "contour_rms": np.sqrt((contour**2).mean(-1)),
        "lag_peak": np.abs(lag_error(run)[:, first:stop]).max(-1),
        "speed_peak": np.linalg.norm(speed, axis=-1).max(-1),
        "torque_peak": np.abs(torque).max((-1, -2)),
        "recovery_s": recovery_time(contour, normal, time, event_end),
        "time_lost_s": np.where(unknown, np.nan, late),
        "energy_j": energy(run, first, stop),
        "saturated_s": saturated.sum(-1),  # by rows: a product has other bits for a rollout alone
    }
    return {name: np.where(lost, np.nan, value) for name, value in values.items()}


def find_samples(time: Array, window: tuple[float, float]) -> tuple[int, int]:
    """Return the first sample (of ``time`` [s], (k,)) within a window, and the one after the last."""
    slack = _SLACK * (time[1] - time[0]) if len(time) > 1 else 0.0
    begin, end = np.searchsorted(time, [window[0] - slack, window[1] + slack])
    return int(begin), int(end)


def recovery_time(contour: Array, normal: Array, time: Array, event_end: float | None) -> Array:
    """Return the time [s] from the end of an event until the contour error stays within its band, (rollout,).

    The band is :data:`RECOVERED` times the undisturbed peak ``normal`` [rad] (rollout,), 1e-4 rad at least. It is 0
    where the error never leaves it, inf where it does not come back in time, NaN without an end of the event.
    """
    if event_end is None:
        return np.full(len(contour), np.nan)
    after = find_samples(time, (event_end, np.inf))[0]
    if after == len(time):
        return np.full(len(contour), np.nan)
    band = np.maximum(RECOVERED * normal, _LEAST_BAND)[:, None]
    return settling_time(contour[:, after:] / band, time[after:], 1.0) - time[after]


def time_lost(run: Run, undisturbed: Run, task: PathTask) -> Array:
    """Return the time [s] that a run is behind the undisturbed one at its end, (rollout,): ∫ds/ϑ(s) between both s.

    Where both have finished an open path, it is the difference of their times. That of motion control is 0, as its
    s waits for nobody.
    """
    ends = np.stack([one.array("s")[:, -1] for one in (run, undisturbed)])
    lost = np.full(run.rollouts, np.nan)
    known = np.isfinite(ends).all(0)
    lost[known] = [_planned_time(task, begin, end) for begin, end in ends[:, known].T]
    finished = [one.finish_time for one in (run, undisturbed)]
    both = np.isfinite(finished).all(0)
    return np.where(both, finished[0] - finished[1], lost)


def _planned_time(task: PathTask, begin: float, end: float) -> float:
    """Return ∫ds/ϑ(s) [s] from ``begin`` to ``end``, inf where ϑ falls to 0 too fast for it to have a value."""
    from scipy.integrate import quad_vec  # takes a quarter of a second to load

    def slowness(s: float) -> float:
        with np.errstate(divide="ignore"):
            return float(1 / np.asarray(task.theta(np.array(s)), dtype=np.float64))

    with np.errstate(invalid="ignore"):  # of infinite values
        time, error = quad_vec(slowness, begin, end, epsabs=_ACCURACY, epsrel=_ACCURACY, limit=_MOST_PIECES)
    return time if error <= _ACCURACY * (1 + abs(time)) else float(np.copysign(np.inf, end - begin))


def energy(run: Run, first: int, stop: int) -> Array:
    """Return ∫|τ·q̇| dt [J], (rollout,), from sample ``first`` to the last before ``stop``, of torques as they acted.

    That is the trapezoidal rule in each period, with the torque that is held in it.
    """
    speed, step = run.array("qd").swapaxes(0, 1), np.diff(run.time)[:, None]
    after, before = acting_torque(run)
    power = 0.5 * (np.abs(np.vecdot(after, speed[:-1])) + np.abs(np.vecdot(before, speed[1:])))
    return np.ascontiguousarray((power * step)[first : stop - 1].T).sum(-1)  # the same bits for a rollout alone


def is_at_limit(run: Run, limits: Array) -> NDArray[np.bool_]:
    """Return whether the torque of any joint is at its limit from each sample on, (rollout, time)."""
    return np.asarray((np.abs(run.array("tau")) >= _AT_LIMIT * limits).any(-1))
