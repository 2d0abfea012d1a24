"""A limit on the acceleration along a path, as bounds on the rise and fall of ϑ² over each cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.profiles.limited.two_pass import Lines
from pathcontrol.profiles.motion import Motion

_MAX_GROWTH = 0.1  # relative change of ‖p'‖ over a cell that resolves it
_UNRESOLVED = 0.3
_STANDSTILL = 1e-9


class Tangential(NamedTuple):
    """The limit |v̇| ≤ ``largest`` on the speed v = ‖p'‖ϑ of a ``motion``, with ‖p'‖ and d ln‖p'‖/ds at places s.

    The places are points of cells, (cells, k), from one end of each to the other.
    """

    motion: Motion
    largest: float
    s: Array
    length: Array
    growth: Array

    @property
    def resolved(self) -> NDArray[np.bool_]:
        """The mask of the cells, (cells,), over which ‖p'‖ hardly changes."""
        return self._change <= _MAX_GROWTH

    def steps(self) -> tuple[Lines, Lines]:
        """Return bounds on the rise and on the fall of ϑ² over each cell: a line for each of its points.

        With x = ϑ² linear, s̈ = (x_{i+1} − x_i)/(2Δ). At the share λ of the cell |‖p'‖(s̈ + xγ)| ≤ a, γ = d ln‖p'‖/ds,
        then says βx_{i+1} ≤ αx_i + b and αx_i ≤ βx_{i+1} + b, where α = 1 − 2Δγ(1 − λ), β = 1 + 2Δγλ, b = 2Δa/‖p'‖.

        Raises:
            TaskError: the motion comes to a standstill although the path does not.
        """
        self._check_moving()
        alpha = 1 - 2 * (self.s[:, -1:] - self.s) * self.growth
        beta = 1 + 2 * (self.s - self.s[:, :1]) * self.growth
        reach = 2 * (self.s[:, -1:] - self.s[:, :1]) * self.largest / self.length
        return Lines((alpha / beta).T, (reach / beta).T), Lines((beta / alpha).T, (reach / alpha).T)

    @property
    def _change(self) -> Array:
        return np.abs(self.growth).max(-1) * (self.s[:, -1] - self.s[:, 0])

    def _check_moving(self) -> None:
        """Check that the motion does not stand still."""
        still = (self.length <= _STANDSTILL * self.length.max()).any(-1) | ~(self._change < _UNRESOLVED)
        if still.any():
            raise TaskError(
                f"{self.motion} all but stands still at s = {self.s[np.argmax(still), 0]:g} of the path, so its "
                "tangential acceleration cannot be limited there; limit that of the joints instead",
                s=float(self.s[np.argmax(still), 0]),
            )


def all_steps(limits: Sequence[Tangential], cells: int) -> tuple[Lines, Lines]:
    """Return bounds on the rise and on the fall of ϑ² over each cell under all limits."""
    none = Lines(np.empty((0, cells)), np.empty((0, cells)))
    steps = [(none, none), *(limit.steps() for limit in limits)]
    up, down = (Lines(*map(np.concatenate, zip(*lines, strict=True))) for lines in zip(*steps, strict=True))
    return up, down
