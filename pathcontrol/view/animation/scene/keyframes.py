"""The choice of key frames, so that straight lines between them stay near all other samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array

Indices: TypeAlias = NDArray[np.int64]

#: returns which spans hold, (m,) bool, from their first samples (m,) and their length in samples
Test: TypeAlias = Callable[[Indices, int], NDArray[np.bool_]]


def key_samples(samples: int, holds: Test) -> Indices:
    """Return indices of the samples to keep, the first and the last among them.

    Neighbouring spans of 1, 2, 4, … samples are joined while the joint span holds, from multiples of their length
    on: every span is tested in the company of all others of its length, so that this takes milliseconds for 10⁴
    samples, at the price of up to twice as many keys as the fewest possible.
    """
    kept, held, length = np.ones(samples, dtype=bool), np.ones(max(samples - 1, 0), dtype=bool), 1
    while len(held) > 1:
        pairs = held[0:-1:2] & held[1::2]
        length *= 2
        merged: Indices = np.flatnonzero(pairs)
        if len(merged):
            merged = merged[holds(merged * length, length)]
        kept[merged * length + length // 2] = False
        held = np.zeros(len(pairs), dtype=bool)
        held[merged] = True
    return np.flatnonzero(kept)


def line_keys(time: Array, values: Array, tolerance: float) -> Indices:
    """Return samples of values (k, d) that interpolate the others in time within ``tolerance``, (keys,)."""

    def holds(first: Indices, length: int) -> NDArray[np.bool_]:
        off = values[inside(first, length)] - interpolate(time, values, first, length)
        return (off**2).sum(-1).max(-1) <= tolerance**2

    return key_samples(len(time), holds)


def inside(first: Indices, length: int) -> Indices:
    """Return indices of the samples inside each span, (m, length − 1)."""
    return first[:, None] + np.arange(1, length)


def interpolate(time: Array, values: Array, first: Indices, length: int) -> Array:
    """Return values (k, d) between both ends of each span, at the times of its samples, (m, length − 1, d)."""
    begin, end = time[first, None], time[first + length, None]
    lasting = np.maximum(end - begin, np.finfo(np.float64).tiny)  # late in a film samples may share a moment
    share = ((time[inside(first, length)] - begin) / lasting)[..., None]
    start = values[first][:, None]
    return start + share * (values[first + length][:, None] - start)
