"""Lines of any length, thinned to what a page can show; peaks, gaps and short runs stay."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pathcontrol._arrays import Array

_COLUMNS = 3000  # columns across a page: more than 300 dpi over both text columns
_CELLS = 4000  # along a side of a plane
_SHORT = 4 * _COLUMNS
_LARGEST = 1e100  # more than that is not drawn: squares must not overflow


def drawable(values: Any) -> Array:
    """Return ``values`` with NaN, which is a gap in a line, where no axis can hold them."""
    array = np.asarray(values, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(array) <= _LARGEST, array, np.nan)


def series(axes: Axes, time: Array, values: Array, **look: Any) -> Line2D:
    """Draw ``values`` (k,) over ``time`` (k,)."""
    kept = select_by_column(values)
    return axes.plot(time[kept], values[kept], **_choose_look(values, look))[0]


def curve(axes: Axes, x: Array, y: Array, **look: Any) -> Line2D:
    """Draw ``y`` (k,) over ``x`` (k,), a curve in a plane."""
    kept = select_by_cell(x, y)
    return axes.plot(x[kept], y[kept], **_choose_look(x + y, look))[0]


def select_by_column(values: Array) -> Array:
    """Return indices of the samples of ``values`` (k,) to draw: first, least, largest and gap of each column."""
    k = len(values)
    if k <= _SHORT:
        return np.arange(k)
    starts = np.linspace(0, k, _COLUMNS, endpoint=False).astype(int)
    wide = int(np.diff(starts, append=k).max())
    at = np.minimum(starts[:, None] + np.arange(wide), np.append(starts[1:], k)[:, None] - 1)  # (columns, wide)
    block = values[at]
    gap = np.isnan(block)
    picks = (np.where(gap, np.inf, block).argmin(1), np.where(gap, -np.inf, block).argmax(1), gap.argmax(1))
    rows = np.arange(len(starts))
    return np.unique(np.concatenate([starts, *(at[rows, pick] for pick in picks), [k - 1]]))


def select_by_cell(x: Array, y: Array) -> Array:
    """Return indices of the points (k,) of a curve to draw: those that enter another cell of a fine grid."""
    k = len(x)
    if k <= _SHORT:
        return np.arange(k)
    cells = [_cells(x), _cells(y)]
    changed = np.any([np.diff(cell) != 0 for cell in cells], axis=0)
    keep = np.ones(k, dtype=bool)
    keep[1:-1] = changed[:-1] | changed[1:]  # the last point in a cell too, so that what is left out stays in one
    return np.flatnonzero(keep)


def _cells(values: Array) -> Array:
    """Return the cells of values."""
    if np.isnan(values).all():
        return np.zeros(len(values), dtype=int)
    low, high = np.nanmin(values), np.nanmax(values)
    scaled = _CELLS * (values - low) / (high - low if high > low else 1.0)
    return np.where(np.isnan(values), -1, np.nan_to_num(scaled)).astype(int)


def _choose_look(values: Array, look: dict[str, Any]) -> dict[str, Any]:
    """Return the look of a line; a line of one point is a dot."""
    return look | ({"marker": ".", "markersize": 4} if np.count_nonzero(~np.isnan(values)) == 1 else {})
