"""Charts over time, whose lines are thinned to the points that a screen shows, peaks included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.payload import Film
from pathcontrol.view.animation.scene.keyframes import Indices

MOST_POINTS = 4000  # limit of points in a chart
_EACH_BIN = 3  # points of a bin: the least, the greatest, and one where there is none


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a chart.

    Attributes:
        label: what it is.
        times: increasing [s], (k,).
        values: (k,), NaN where the line has a gap.
        run: which of the runs it belongs to.
        role: a value; a reference that values are compared with; or a limit.
        shade: which of several lines of one run it is.
    """

    label: str
    times: Array
    values: Array
    run: int = 0
    role: Literal["value", "reference", "limit"] = "value"
    shade: int = 0

    def repeats(self, other: Curve) -> bool:
        """Return whether it is a reference or a limit that another one shows already."""
        same = self.role == other.role != "value"
        return same and np.array_equal(self.times, other.times) and np.array_equal(self.values, other.values)

    def at(self, times: Array) -> Array:
        """Return values at other times (m,), linear between its own; NaN before the first and after the last."""
        return np.interp(times, self.times, self.values, left=np.nan, right=np.nan)


#: title, unit and lines of one run
Entry: TypeAlias = tuple[str, str, list[Curve]]


@dataclass(frozen=True, eq=False)
class Chart:
    """The lines of one quantity over time."""

    title: str
    unit: str
    curves: Sequence[Curve]

    def header(self, film: Film) -> dict[str, Any]:
        """Return the chart for the header of a film: all lines at the same times."""
        bins = max(MOST_POINTS // (_EACH_BIN * len(self.curves)), 1)
        times = np.unique(np.concatenate([curve.times[extremes(curve.values, bins)] for curve in self.curves]))
        lines = [
            {
                "label": curve.label,
                "values": film.block(curve.at(times)),
                "run": curve.run,
                "role": curve.role,
                "shade": curve.shade,
            }
            for curve in self.curves
        ]
        return {"title": self.title, "unit": self.unit, "times": film.block(times), "lines": lines}


def extremes(values: Array, bins: int) -> Indices:
    """Return increasing indices of the least and the greatest sample in each bin, which draw like the whole line (k,).

    Of bins with gaps also the first sample of a gap. The first and the last sample stay; if there are no
    more than two samples in a bin, all do.
    """
    k = len(values)
    if k <= 2 * bins:
        return np.arange(k)
    starts = np.linspace(0, k, bins + 1).astype(np.int64)[:-1]
    width = -(-k // bins) + 1
    rows = np.minimum(starts[:, None] + np.arange(width), np.append(starts[1:], k)[:, None] - 1)
    part, gap = values[rows], np.isnan(values[rows])
    chosen = [np.where(gap, np.inf, part).argmin(-1), np.where(gap, -np.inf, part).argmax(-1), gap.argmax(-1)]
    bin_ = np.arange(bins)
    return np.unique(np.concatenate([[0, k - 1], *(rows[bin_, each] for each in chosen)]))
