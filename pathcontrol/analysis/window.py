"""The time window of metrics, by one rule for each rollout, independent of other rollouts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, as_scalar
from pathcontrol.errors import InputError
from pathcontrol.simulation.finish import detection_times
from pathcontrol.simulation.run import Run

Choice = Literal["second half", "all"]
#: begin and end [s], or a part of each rollout's own time
Window = tuple[float, float] | Choice

_SLACK = 1e-6  # share of a period, as times of samples are rounded


class Samples(NamedTuple):
    """The samples of each rollout that count: from ``first`` up to, not including, ``stop``, (rollout,) each."""

    first: NDArray[np.intp]
    stop: NDArray[np.intp]

    @property
    def span(self) -> slice:
        """The slice from the first sample that counts in any rollout to the last."""
        return slice(int(self.first.min()), int(self.stop.max()))

    def of_span(self) -> Samples:
        """Return the same samples, counted from the beginning of :attr:`span`."""
        return Samples(self.first - self.span.start, self.stop - self.span.start)

    def within(self, values: Array) -> Array:
        """Return ``values`` (rollout, time, …) with NaN outside, so that nothing is computed there."""
        number = np.arange(values.shape[1])
        if not self.first.any() and (self.stop == len(number)).all():
            return values
        inside = (number >= self.first[:, None]) & (number < self.stop[:, None])
        return np.where(inside.reshape(*inside.shape, *[1] * (values.ndim - 2)), values, np.nan)

    def reduce(self, function: Callable[..., float | Array], *values: Array) -> Array:
        """Apply a ``function`` to the samples (k, …) of each rollout that count, (rollout, …); NaN where none does.

        Each rollout is reduced by itself, from memory laid out as if it were alone: the result has the same bits
        whatever is beside it.
        """
        rows = [
            [np.ascontiguousarray(v[i, a:b]) for v in values]
            for i, (a, b) in enumerate(zip(self.first, self.stop, strict=True))
        ]
        found = [np.asarray(function(*row)) if len(row[0]) else np.array(np.nan) for row in rows]
        shape = max((f.shape for f in found), key=len)
        return np.stack([np.broadcast_to(f, shape) for f in found])


def own_samples(run: Run) -> NDArray[np.intp]:
    """Return the number of samples that are each rollout's own, (rollout,): until it finished or diverged.

    There the run would have ended had the rollout been alone. A finished one is held at the end of its path
    while others go on, which tells nothing about it.
    """
    closed = "laps" in run
    ended = np.where(run.status == "finished", detection_times(run.finish_time, not closed), np.inf)
    ended = np.where(run.status == "diverged", run.diverged_time, ended)
    return np.minimum(np.searchsorted(run.time, ended - _slack(run)) + 1, len(run.time))


def samples_of(run: Run, window: Window | None = None, fraction: float = 0.5) -> Samples:
    """Return the samples of each rollout in a ``window``, of its own time only; by default the last ``fraction``.

    Raises:
        InputError: the window is something else, or begins after the run's time was up.
    """
    stop, time = own_samples(run), run.time
    if window is None or isinstance(window, str):
        share = _share(window, fraction)
        last = time[stop - 1]
        return Samples(np.searchsorted(time, last - share * (last - time[0])), stop)
    begin, end = _seconds(window)
    if begin > time[-1] and not (run.status == "finished").any():
        raise InputError(
            f"window = ({begin:g}, {end:g}), but the run ends at {time[-1]:g} s",
            argument="window",
            value=window,
            limit=time[-1],
        )
    first = np.searchsorted(time, begin - _slack(run))
    return Samples(np.minimum(first, stop), np.minimum(stop, np.searchsorted(time, end + _slack(run), side="right")))


def describe_window(window: Window | None = None, fraction: float = 0.5) -> str:
    """Return the time window in words: ``"the second half of the time"``."""
    if window is None and fraction != 0.5:
        return f"the last {100 * fraction:.4g} % of the time"
    if window is None or isinstance(window, str):
        return "all of the time" if window == "all" else "the second half of the time"
    begin, end = _seconds(window)
    return f"{begin:g} s to {end:g} s"


def _share(window: str | None, fraction: float) -> float:
    """Return the share of the time that counts."""
    if window is None:
        fraction = as_scalar("fraction", fraction, positive=True)
        if fraction > 1:
            raise InputError(
                f"fraction = {fraction:g}, expected a number from 0 to 1",
                argument="fraction",
                value=fraction,
                limit=(0.0, 1.0),
            )
        return fraction
    if window not in get_args(Choice):
        choices = ", ".join(map(repr, get_args(Choice)))
        raise InputError(
            f"window = {window!r}, expected {choices}, or (from, to) in seconds",
            argument="window",
            value=window,
            choices=get_args(Choice),
        )
    return 1.0 if window == "all" else 0.5


def _seconds(window: object) -> tuple[float, float]:
    """Check a window in seconds; return begin and end."""
    try:
        begin, end = (float(t) for t in window)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        begin = end = np.nan
    if not begin < end:
        choices = ", ".join(map(repr, get_args(Choice)))
        raise InputError(
            f"window = {window!r}, expected (from, to) in seconds with from < to, or {choices}",
            argument="window",
            value=window,
        )
    return begin, end


def _slack(run: Run) -> float:
    """Return the tolerance of times [s]."""
    return _SLACK * float(run.time[1] - run.time[0]) if len(run.time) > 1 else 0.0
