"""The largest sequence under a ceiling with bounded steps up and down, by a forward and a backward sweep."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array

_MAX_LAPS = 100


class Lines(NamedTuple):
    """Bounds y ≤ ``slope`` x + ``offset`` over every cell, each (lines, cells) and greater than 0."""

    slope: Array
    offset: Array


def largest_sequence(ceiling: Array, up: Lines, down: Lines, closed: bool) -> Array:
    """Return the largest x ≤ ``ceiling`` (m,) with x_{i+1} ≤ up_i(x_i) and x_i ≤ down_i(x_{i+1}) for all lines and i.

    If two sequences keep the bounds, so does their element-wise maximum; hence there is one largest sequence. The
    forward sweep makes each value as large as its predecessor allows, the backward sweep as its successor allows. A
    value lowered by the backward sweep is still reached from its predecessor if y ≤ up(down(y)), a bound that is part
    of the ceiling. On a closed path the last value is the first again.
    """
    ceiling = ceiling.copy()
    ceiling[1:] = np.minimum(ceiling[1:], _reachable(up, down))
    if closed:
        ceiling[[0, -1]] = min(ceiling[0], ceiling[-1])
    forward = _sweep(ceiling, up, closed)
    return _sweep(forward[::-1], Lines(down.slope[:, ::-1], down.offset[:, ::-1]), closed)[::-1]


def _reachable(up: Lines, down: Lines) -> Array:
    """Return the largest y of each cell with y ≤ up(down(y)), (cells,)."""
    bound = np.full(up.slope.shape[1], np.inf)
    for slope, offset in zip(*up, strict=True):
        closing = 1 - slope * down.slope
        crossing = (slope * down.offset + offset) / np.where(closing > 1e-12, closing, np.nan)
        bound = np.fmin(bound, np.fmin.reduce(crossing, axis=0))
    return bound


def _sweep(ceiling: Array, lines: Lines, closed: bool) -> Array:
    """Sweep once, or round a closed path until the values repeat."""
    values = _sweep_once(ceiling, lines)
    for _ in range(_MAX_LAPS):
        if not closed or values[-1] >= (1 - 1e-12) * values[0]:
            break
        ceiling = np.concatenate([values[-1:], ceiling[1:-1], values[-1:]])
        values = _sweep_once(ceiling, lines)
    if closed:
        values[0] = values[-1]
    return values


def _sweep_once(ceiling: Array, lines: Lines) -> Array:
    """Sweep once, in plain floats: a loop over arrays of one or two lines would take ten times as long."""
    x, *ceilings = ceiling.tolist()
    values = [x]
    for top, slopes, offsets in zip(ceilings, lines.slope.T.tolist(), lines.offset.T.tolist(), strict=True):
        x = min(top, *(a * x + b for a, b in zip(slopes, offsets, strict=True)), np.inf)
        values.append(x)
    return np.array(values)
