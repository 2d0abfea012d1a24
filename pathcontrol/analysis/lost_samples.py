"""Samples of a run at which no measurement came, and the motion between those that did."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.simulation.config import table
from pathcontrol.simulation.run import Run

_Marks = NDArray[np.bool_]  # (rollout, time)


def find_lost(run: Run, filtered: bool) -> _Marks:
    """Return the samples with the measurement of the sample before, as no new one came, (rollout, time).

    An arm that rests may have the same measurement twice, too: only the times of a run's ``Dropout`` count, and in the
    log of a control loop those of an arm that moves. Of a velocity that the loop has ``filtered`` the first measurement
    after a gap is lost, too: the filter went on unseen.
    """
    lost: _Marks = np.zeros((run.rollouts, len(run.time)), dtype=bool)
    if table(run.config, "loop").get("loop") == "hardware" and "qd_measured" in run:
        lost |= (run.array("qd_measured") != 0).any(-1)
    for dropout in _dropouts(table(run.config, "disturbance")):
        lost |= _covered(dropout, run)
    if not lost.any():
        return lost
    for name in ("q_measured", "qd_measured"):
        values = run.array(name) if name in run else np.zeros((run.rollouts, len(run.time), 1))
        lost[:, 1:] &= (values[:, 1:] == values[:, :-1]).all(-1)
    lost[:, 0] = False  # the first measurement comes in any case
    if filtered:
        lost[:, 1:] |= lost[:, :-1].copy()
    return lost


def _dropouts(described: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the dropouts among described disturbances."""
    if described.get("disturbance") == "Dropout":
        yield described
    terms = described.get("terms")
    for term in terms if isinstance(terms, list) else ():
        if isinstance(term, Mapping):
            yield from _dropouts(term)


def _covered(dropout: Mapping[str, Any], run: Run) -> _Marks:
    """Return the samples whose periods a dropout covers; all where the run does not know its times any more."""
    half = 0.5 * float(np.median(np.diff(run.time))) if len(run.time) > 1 else 0.0
    try:
        start, length = (np.asarray(dropout[name], dtype=np.float64).reshape(-1, 1) for name in ("start", "duration"))
        since = run.time + half - start
        return np.broadcast_to((since >= 0) & (since < length), (run.rollouts, len(run.time)))
    except (KeyError, TypeError, ValueError):
        return np.ones((run.rollouts, len(run.time)), dtype=bool)


def find_gaps(lost: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the numbers of the samples before and after each gap of one rollout's ``lost`` samples (time,)."""
    edges = np.flatnonzero(np.diff(lost.astype(np.int8)))
    ends = [*edges.tolist(), len(lost)] if len(edges) % 2 else edges.tolist()
    return [(before, min(last + 1, len(lost))) for before, last in zip(ends[::2], ends[1::2], strict=True)]


def bridge(time: Array, q: Array, qd: Array, lost: _Marks) -> tuple[Array, Array]:
    """Return positions and velocities (rollout, time, n) with a cubic over each gap, of those before and after it.

    After the last measurement that came they stay as they are.
    """
    if not lost.any():
        return q, qd
    from scipy.interpolate import CubicHermiteSpline  # takes a quarter of a second to load, and few runs have gaps

    q, qd = q.copy(), qd.copy()
    for row in np.flatnonzero(lost.any(1)).tolist():
        for before, after in find_gaps(lost[row]):
            if after < len(time):
                ends, inside = [before, after], slice(before + 1, after)
                curve = CubicHermiteSpline(time[ends], q[row, ends], qd[row, ends])
                q[row, inside], qd[row, inside] = curve(time[inside]), curve(time[inside], 1)
    return q, qd


def spread_over_gaps(means: Array, dt: Array, lost: NDArray[np.bool_]) -> Array:
    """Return the means of periods of one rollout (time − 1, n), in each gap with an end that over the whole gap.

    ``dt`` (time − 1, 1) are the periods [s], ``lost`` (time,) the samples that did not come.
    """
    spread = means.copy()
    for before, after in find_gaps(lost):
        if after < len(lost):
            gap = slice(before, after)
            spread[gap] = (means[gap] * dt[gap]).sum(0) / dt[gap].sum()
    return spread


def hold_at_end(r: Array, lost: _Marks) -> Array:
    """Return an estimate (rollout, time, n) that stays as it is from the last measurement of a run on."""
    held = r.copy()
    for row in np.flatnonzero(lost[:, -1]).tolist():
        before, _ = find_gaps(lost[row])[-1]
        held[row, before + 1 :] = r[row, before]
    return held
