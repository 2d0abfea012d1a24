"""The map of stability over gains, and its boundary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array, as_array, check_finite, check_whole
from pathcontrol._progress import progress_bar
from pathcontrol.analysis.stability.gain_growth import GainGrowth, Loop
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.control.law_gains import single_gain, unit_of_gain, with_gains
from pathcontrol.errors import InputError


@dataclass(frozen=True, eq=False)
class StabilityMap:
    """The stability of a closed orbit over one or two gains of its law.

    Attributes:
        names: the gains, one or two.
        grids: the values of each, increasing.
        growth: rate [1/s] at which the slowest transverse deviation grows; below 0 all decay, (k,) or (k, m).
        multiplier: |μ| of that deviation, the factor over a lap, of the same shape.
        boundary: gains at which it neither grows nor decays, found between neighbours of which one is stable, (b, 1) or
            (b, 2), to 1e-6.
        segments: pairs of rows of ``boundary`` that are ends of a piece of its line, (p, 2); none for one gain.
        units: the unit of each gain.
        own: the law's own gains, ``None`` where one differs between joints.
        law: name of the law.
        loop: how the loop is closed; ``None`` for continuous time.
    """

    names: tuple[str, ...]
    grids: tuple[Array, ...]
    growth: Array
    multiplier: Array
    boundary: Array
    segments: NDArray[np.intp]
    units: tuple[str, ...]
    own: tuple[float | None, ...]
    law: str
    loop: Loop

    @property
    def stable(self) -> NDArray[np.bool_]:
        """The mask of the gains with which all transverse deviations decay, of the shape of ``growth``."""
        return self.growth < 0

    @property
    def decay_rate(self) -> Array:
        """The rate [1/s] at which the slowest deviation decays, −``growth``."""
        return -self.growth


def stability_map(
    law: Controller,
    gains: Mapping[str, Sequence[float]],
    loop: Loop = None,
    *,
    settle: int = 3,
    progress: bool = True,
) -> StabilityMap:
    """Return the map of stability of a law on its closed path over one or two gains, with the boundary.

    At each point of the grid it is what :func:`floquet` says of the law with these gains, in all joints the same.
    Between neighbours of which one is stable and the other is not, the boundary is found by root finding on
    max |μ| = 1, so its points are exact for the linearised loop, however coarse the grid; a stable or unstable island
    that lies between the points of the grid is not seen. A loop that leaves its path before it settles is linearised
    along the path itself.

    Args:
        law: the law, with one closed path and one set of gains; its own model is the arm.
        gains: one or two gains by the names of the law's arguments, with the values of each.
        loop: how the loop is closed, as for :func:`floquet`; ``None`` for continuous time.
        settle: laps of a sampled loop before it is linearised.
        progress: show a bar on standard error when it takes longer than two seconds.

    Raises:
        UnknownNameError: the law has no such gain.
        InputError: there are none or more than two gains, a value is refused by the law, or as of :func:`floquet`.
    """
    check_controller("law", law)
    names, grids = _check_gains(gains)
    own = tuple(single_gain(law, name) for name in names)
    points = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1)
    with_gains(law, {name: grid[:, None] for name, grid in zip(names, grids, strict=True)})  # refuses values at once
    grow = GainGrowth(law, names, loop, check_whole("settle", settle, 1))
    shape = points.shape[:-1]
    with progress_bar("stability_map", points[..., 0].size, progress) as update:
        growth, multiplier = (each.reshape(shape) for each in grow(points.reshape(-1, len(names)), update))
    ends = _find_edges(growth < 0)
    low, high = (tuple(end.T) for end in ends)
    boundary = grow.find_roots(points[low], points[high], (growth[low], growth[high]))
    segments = _link(*ends)
    units, name = tuple(unit_of_gain(law, name) for name in names), type(law).__name__
    return StabilityMap(names, grids, growth, multiplier, boundary, segments, units, own, name, loop)


def _check_gains(gains: Any) -> tuple[tuple[str, ...], tuple[Array, ...]]:
    """Return the names of one or two gains and their values, increasing."""
    if not isinstance(gains, Mapping) or len(gains) not in (1, 2):
        raise InputError(
            f"gains = {gains!r:.80}, expected one or two gains with their values: {{'k': [5, 10, 20]}}",
            argument="gains",
            value=gains,
        )
    grids = []
    for name, given in gains.items():
        values = check_finite(str(name), as_array(str(name), given))
        if values.ndim != 1 or not len(values) or len(np.unique(values)) < len(values):
            raise InputError(
                f"{name} = {given!r:.80}, expected a sequence of different numbers", argument=str(name), value=given
            )
        grids.append(np.sort(values))
    return tuple(map(str, gains)), tuple(grids)


def _find_edges(stable: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of neighbours of which one is stable and the other is not, (b, d) each."""
    low, high = [], []
    for axis, step in enumerate(np.eye(stable.ndim, dtype=np.intp)):
        changed = np.argwhere(np.diff(stable, axis=axis))
        low.append(changed)
        high.append(changed + step)
    return np.concatenate(low), np.concatenate(high)


def _link(low: NDArray[np.intp], high: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the pairs of edges that the boundary joins within a cell of the grid of two gains, (p, 2)."""
    if low.shape[1] < 2:
        return np.zeros((0, 2), dtype=np.intp)
    edges = {(tuple(a), tuple(b)): i for i, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True))}
    cells = {(a - down, b - left) for a, b in low.tolist() for down in (0, 1) for left in (0, 1)}
    pairs = []
    for i, j in sorted(cells):
        corner, right, up, far = (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)
        # in this order, so that the two lines of a saddle go round opposite corners
        sides = [(corner, right), (corner, up), (right, far), (up, far)]
        crossed = [edges[side] for side in sides if side in edges]
        pairs += [crossed[k : k + 2] for k in range(0, len(crossed) - 1, 2)]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)
