"""A take with all that is drawn for it: its arm, the path that is asked for, and the error that colours its line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.path_error import PathError, in_fitting_units, path_error
from pathcontrol.view.animation.rollout import Take
from pathcontrol.view.animation.scene.builder import swept
from pathcontrol.view.animation.scene.desired_path import Line, desired_lines

LINE_WIDTH = 0.002  # radius of the line the tool has drawn, of the diagonal of what is seen of its arm …
FINE_LINE_WIDTH = 0.012  # … or of that of the line, if that is less: a small drawing stays legible
THINNEST = 0.0003  # of the diagonal of what is seen
_SAMPLES = 5000


@dataclass(frozen=True, eq=False)
class Shot:
    """A take and what is drawn for it, in the base frame of its arm.

    Attributes:
        take: what happened.
        lines: where the tool should go.
        error: how far it was from there, or None where that cannot be measured.
        body: where the arm gets to [m], (k, 3).
    """

    take: Take
    lines: list[Line]
    error: PathError | None
    body: Array

    @property
    def sight(self) -> Array:
        """What is to be seen well [m], (k, 3): the desired path, or without one the path taken."""
        return np.concatenate([line.points for line in self.lines] or [self._taken])

    @cached_property
    def drawn(self) -> Array:
        """Points of all lines [m], (k, 3)."""
        return np.concatenate([self._taken, *(line.points for line in self.lines)])

    @property
    def _taken(self) -> Array:
        """Samples enough of where the tool was [m], (k, 3)."""
        positions = self.take.tool_positions
        return positions[:: -(-len(positions) // _SAMPLES)]

    @cached_property
    def seen(self) -> Array:
        """Points of all that is seen [m], (k, 3)."""
        return np.concatenate([self.body, self.drawn])

    @property
    def line_width(self) -> float:
        """Radius of the line that the tool draws [m]."""
        scene, drawing = (float(np.linalg.norm(np.ptp(points, axis=0))) for points in (self.seen, self.drawn))
        return max(min(LINE_WIDTH * scene, FINE_LINE_WIDTH * drawing), THINNEST * scene)


def shots_of(takes: Sequence[Take]) -> list[Shot]:
    """What is drawn for each take, lengths of all errors in one unit."""
    errors = in_fitting_units([path_error(take) for take in takes])
    return [Shot(take, desired_lines(take), error, swept(take)) for take, error in zip(takes, errors, strict=True)]
