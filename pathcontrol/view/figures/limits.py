"""Limits of axes for any content: one point, a line, a gap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from pathcontrol._arrays import Array

_MARGIN = 0.05
_STILL = 1e-4  # share of a value; smaller motion is not shown
_FLATTEST = 0.45  # height of an equal plane over its width, and the other way round


def over_time(axes: Axes, times: Sequence[Array]) -> None:
    """Set the limits from the first moment to the last."""
    first, last = min(time[0] for time in times), max(time[-1] for time in times)
    if last > first:
        axes.set_xlim(first, last)


def from_zero(axes: Axes, values: Sequence[Array], room: float = 1.08) -> None:
    """Set the limits from zero to a little more than the largest of values that are not negative."""
    top = extent(values)[1]
    axes.set_ylim(0, room * top if top > 0 else 1.0)


def extent(values: Sequence[Array]) -> tuple[float, float]:
    """Return the least and the largest finite value; 0 without any."""
    numbers = [v[~np.isnan(v)] for v in values]
    some = [n for n in numbers if n.size]
    return (float(min(n.min() for n in some)), float(max(n.max() for n in some))) if some else (0.0, 0.0)


def span(values: Sequence[Array]) -> tuple[float, float]:
    """Return the least and the largest finite value with a margin, which for constant values exceeds rounding."""
    low, high = extent(values)
    half = max(0.5 * (high - low) * (1 + 2 * _MARGIN), _STILL * max(abs(low), abs(high)))
    middle, half = 0.5 * (low + high), half if half > 0 else 1.0
    return middle - half, middle + half


def equal_plane(x: Sequence[Array], y: Sequence[Array]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return limits of both axes of a plane with equal scales that is neither flat nor narrow."""
    (x0, x1), (y0, y1) = span(x), span(y)
    wide, high = max(x1 - x0, _FLATTEST * (y1 - y0)), max(y1 - y0, _FLATTEST * (x1 - x0))
    return _about(x0, x1, wide), _about(y0, y1, high)


def aspect(limits: tuple[tuple[float, float], tuple[float, float]]) -> float:
    """Return the height of a plane with equal scales over its width."""
    (x0, x1), (y0, y1) = limits
    return (y1 - y0) / (x1 - x0)


def _about(low: float, high: float, width: float) -> tuple[float, float]:
    """Return limits of a width around a middle."""
    return 0.5 * (low + high - width), 0.5 * (low + high + width)
