"""A table of torques over the lap of a closed path, learned lap by lap from those that were seen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array

_FITS = 0.75  # share of the limit of the misfit below which a table counts as fitting
_WHOLE = 0.6  # share of the mean weight of all nodes with which one has been passed as a whole
_LEAST = 0.25  # share of the nodes that have to be compared


class LapMemory(NamedTuple):
    """The parts of a table's memory, views of one array, (*batch, …).

    Attributes:
        torque: τ̂ at the nodes [N m], (*batch, nodes, n).
        seen: the sum of what was seen around each node in this lap [N m s], (*batch, nodes, n).
        weight: the time for which it was seen [s], (*batch, nodes).
        known: 1 for nodes that have been learned, else 0, (*batch, nodes).
        begin: the place at which the law took over, counted in laps, (*batch,).
        lap: the number of the lap, (*batch,).
        fits: 1 once the table has fitted, else 0, (*batch,).
        forgotten: how often it was forgotten, (*batch,).
        time: when that was last [s], 0 if never, (*batch,).
    """

    torque: Array
    seen: Array
    weight: Array
    known: Array
    begin: Array
    lap: Array
    fits: Array
    forgotten: Array
    time: Array


class LearnedTable:
    """A periodic torque τ̂(s) of n joints, linear between nodes, and the rule by which it is learned.

    With the hat functions b_j of the nodes, and u(s) seen in a lap,

        τ̂(s) = Σ_j b_j(s) τ_j,   ū_j = ∫ b_j u dt / ∫ b_j dt,   τ_j ← (1 − γ) τ_j + γ ū_j.

    Averaging by hats and reading by hats is smoothing without a shift along s: of a wave with the frequency f per
    distance of nodes (sin πf / πf)⁴ is kept, 1 for slow ones and never more.

    The first lap, in which the arm comes to its path, is not learned from. The memory goes in and comes out,
    (*batch, :attr:`size`).

    Args:
        nodes: number of nodes, evenly spread over a lap.
        joints: n.
        gain: γ, 0 < γ ≤ 1; a node that knows nothing takes γ = 1.
        misfit: share of u, in the root mean square over a lap, that a table that fitted may leave at a joint before it
            is forgotten: it is then added until the next lap has replaced it, as if nothing had been known.

    Attributes:
        size: length of the memory.
    """

    def __init__(self, nodes: int, joints: int, gain: float, misfit: float) -> None:
        self.nodes, self.joints, self.gain, self.misfit = nodes, joints, gain, misfit
        self.size = 2 * nodes * (joints + 1) + 5

    def start(self, laps: Array) -> Array:
        """Return the memory of a table that knows nothing, at a place counted in ``laps`` (*batch,)."""
        memory = np.zeros((*laps.shape, self.size))
        memory[..., -5], memory[..., -4] = laps, np.floor(laps)
        return memory

    def recollect(self, memory: Array, before: Array) -> Array:
        """Return a memory at the start, with the table of the one ``before``; a lap that has not ended is dropped."""
        kept, first = before.copy(), self.split(memory)
        parts = self.split(kept)
        parts.seen[:], parts.weight[:] = 0.0, 0.0
        parts.begin[...], parts.lap[...] = first.begin, first.lap
        return kept

    def split(self, memory: Array) -> LapMemory:
        """Return the parts of a memory."""
        nodes, table = self.nodes, self.nodes * self.joints
        shape = (*memory.shape[:-1], nodes, self.joints)
        return LapMemory(
            memory[..., :table].reshape(shape),
            memory[..., table : 2 * table].reshape(shape),
            memory[..., 2 * table : 2 * table + nodes],
            memory[..., 2 * table + nodes : -5],
            *(memory[..., i] for i in range(-5, 0)),
        )

    def read(self, memory: Array, laps: Array) -> Array:
        """Return τ̂ [N m], (*batch, n), at a place counted in ``laps`` (*batch,)."""
        rows = memory.reshape(-1, self.size)
        torque = rows[:, : self.nodes * self.joints].reshape(-1, self.nodes, self.joints)
        before, after, share = self._find_nodes(laps.reshape(-1))
        row, part = np.arange(len(rows)), share[:, None]
        read = (1 - part) * torque[row, before] + part * torque[row, after]
        return np.asarray(read.reshape(*laps.shape, self.joints))

    def write(self, memory: Array, laps: Array, torque: Array, time: Array, t: float) -> Array:
        """Return the memory after a ``torque`` u (*batch, n) was seen for a ``time`` [s], (*batch,), up to t [s].

        Where ``laps`` (*batch,), the place counted in laps, is in another lap than before, that one is learned from.
        """
        rows, laps = memory.reshape(-1, self.size).copy(), laps.reshape(-1)
        lap = np.floor(laps)
        ended = rows[:, -4] != lap
        if ended.any():
            rows[ended] = self._learn(rows[ended], t)
            rows[:, -4] = lap
        time = np.where(laps - rows[:, -5] >= 1.0, time.reshape(-1), 0.0)
        self._add(self.split(rows), laps, torque.reshape(-1, self.joints), time)
        return rows.reshape(memory.shape)

    def _add(self, parts: LapMemory, laps: Array, torque: Array, time: Array) -> None:
        """Add what was seen to the nodes beside it, in place."""
        before, after, share = self._find_nodes(laps)
        row = np.arange(len(laps))
        for node, part in ((before, (1 - share) * time), (after, share * time)):
            parts.weight[row, node] += part
            parts.seen[row, node] += part[:, None] * torque

    def _learn(self, rows: Array, t: float) -> Array:
        """Return the memory, (N, size), of a table that has learned from its lap at t [s], or forgotten all.

        A lap in which the load changed is no lap of either load, and is not learned from.
        """
        parts = self.split(rows)
        wanted, enough = _average(parts.seen, parts.weight)
        known = parts.known > 0
        left = _share_left(wanted, parts.torque, enough & known)
        lost = (parts.fits > 0) & (left > self.misfit)
        taken = enough & ~lost[:, None]
        gain = np.where(known, self.gain, 1.0) * taken
        parts.torque[:] += gain[..., None] * (wanted - parts.torque)
        parts.known[:] = (known | taken) & ~lost[:, None]
        parts.fits[:] = ((parts.fits > 0) | (left < _FITS * self.misfit)) & ~lost
        parts.seen[:], parts.weight[:] = 0.0, 0.0
        parts.forgotten[:] += lost
        parts.time[lost] = t
        return rows

    def _find_nodes(self, laps: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """Return the nodes before and after a place, and the share of the way from one to the other, (*batch,) each."""
        place = self.nodes * (laps - np.floor(laps))
        before = np.minimum(place.astype(np.int64), self.nodes - 1)
        return before, (before + 1) % self.nodes, place - before


def _average(seen: Array, weight: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the mean of what was seen at each node, (N, nodes, n), and where enough was seen, (N, nodes).

    A node that was hardly seen between two that were, as where ticks are farther apart than nodes, takes the mean of
    all three.
    """
    alone = (weight >= _WHOLE * weight.mean(-1, keepdims=True)) & (weight > 0)
    filled = ~alone & np.roll(alone, 1, axis=-1) & np.roll(alone, -1, axis=-1)
    total, time = (
        part + _where(filled, np.roll(part, 1, axis=1) + np.roll(part, -1, axis=1)) for part in (seen, weight)
    )
    enough = alone | filled
    return np.divide(total, time[..., None], out=np.zeros_like(total), where=enough[..., None]), enough


def _where(rows: NDArray[np.bool_], values: Array) -> Array:
    """Return ``values`` (N, nodes, …) at some nodes, and 0 at others."""
    return np.where(rows.reshape(*rows.shape, *[1] * (values.ndim - rows.ndim)), values, 0.0)


def _share_left(wanted: Array, torque: Array, compared: NDArray[np.bool_]) -> Array:
    """Return the largest share of ``wanted`` that a table leaves at a joint, (N,); NaN where too little is compared."""
    left, whole = (np.sum(compared[..., None] * part**2, axis=1) for part in (wanted - torque, wanted))
    share = np.sqrt(np.divide(left, whole, out=np.where(left > 0, np.inf, 0.0), where=whole > 0)).max(-1)
    return np.where(compared.mean(-1) >= _LEAST, share, np.nan)
