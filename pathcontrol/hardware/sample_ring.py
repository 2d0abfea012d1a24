"""The ring buffer between a control loop and the thread that keeps its log."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array

_HEAD = 4  # time, path parameter, factor of the speed, mode


class Moments(dict[str, Array]):
    """Samples of a loop by their names: ``time``, ``s``, ``factor`` and ``mode`` (k,), and others (k, n)."""


class SampleRing:
    """A ring buffer of samples with one writer, which never waits, and one reader; its memory is taken once.

    A sample for which there is no room is lost and counted: those that are read are whole.

    Args:
        n: number of joints.
        capacity: number of samples.

    Attributes:
        lost: number of samples for which there was no room.
        closed: True for a ring that takes no more samples.
    """

    def __init__(self, n: int, capacity: int) -> None:
        self._n, self._capacity = n, capacity
        self._rows = np.empty((capacity, _HEAD + 4 * n))
        self._rows.fill(0.0)  # or the system would give memory tick by tick, and make some late
        self._written = self._taken = 0  # each is changed by one side only
        self._last, self._shift = -np.inf, 0.0
        self.lost, self.closed = 0, False

    def restart(self, time: float, period: float) -> None:
        """Let times go on after the last sample where those of a loop begin anew at ``time`` [s]."""
        if time + self._shift <= self._last:
            self._shift = self._last + period - time

    def put(
        self, time: float, s: float, factor: float, mode: int, q: Array, qd: Array, wanted: Array, acting: Array
    ) -> None:
        """Put a sample: measurements q and q̇, torques that the law asked for and those that act, (n,) each."""
        if self.closed:
            return
        if self._written - self._taken >= self._capacity:
            self.lost += 1
            return
        row, n = self._rows[self._written % self._capacity], self._n
        self._last = time + self._shift
        row[0], row[1], row[2], row[3] = self._last, s, factor, mode
        row[_HEAD : _HEAD + n], row[_HEAD + n : _HEAD + 2 * n] = q, qd
        row[_HEAD + 2 * n : _HEAD + 3 * n], row[_HEAD + 3 * n :] = wanted, acting
        self._written += 1  # last: the reader takes what is counted

    def take(self) -> Moments:
        """Take all samples that wait."""
        end = self._written
        rows = self._rows[np.arange(self._taken, end) % self._capacity]
        self._taken = end
        head, parts = rows[:, :_HEAD].T, np.split(rows[:, _HEAD:], 4, axis=1)
        names = ("time", "s", "factor", "mode"), ("q", "qd", "tau_demand", "tau")
        return Moments(zip((*names[0], *names[1]), (*head, *parts), strict=True))
