"""A rollout with all that is drawn for it: its arm, its desired path, and the error that colours its line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.path_error import PathError, in_fitting_units, path_error
from pathcontrol.view.animation.rollout import Recording
from pathcontrol.view.animation.scene.desired_path import Line, desired_lines
from pathcontrol.view.animation.scene.scene_builder import swept
from pathcontrol.view.animation.walls import Plate, find_plates

LINE_WIDTH = 0.002  # radius of the line the tool has drawn, of the diagonal of what is seen of its arm …
FINE_LINE_WIDTH = 0.012  # … or of that of the line, if that is less: a small drawing stays legible
THINNEST = 0.0003  # share of the diagonal of the visible region
_SAMPLES = 5000


@dataclass(frozen=True, eq=False)
class DrawnRollout:
    """A rollout with its drawing, in the base frame of its arm.

    Attributes:
        recording: what happened.
        lines: where the tool should go.
        error: how far it was from there, or None where that cannot be measured.
        body: where the arm gets to [m], (k, 3).
        plates: the walls before the arm.
    """

    recording: Recording
    lines: list[Line]
    error: PathError | None
    body: Array
    plates: list[Plate]

    @property
    def sight(self) -> Array:
        """The points that must be seen well [m], (k, 3): the desired path, or without one the path of the tool."""
        return np.concatenate([line.points for line in self.lines] or [self._sample_tool])

    @cached_property
    def drawn(self) -> Array:
        """The points of all lines [m], (k, 3)."""
        return np.concatenate([self._sample_tool, *(line.points for line in self.lines)])

    @property
    def _sample_tool(self) -> Array:
        """Enough samples of the tool's positions [m], (k, 3)."""
        positions = self.recording.tool_positions
        return positions[:: -(-len(positions) // _SAMPLES)]

    @cached_property
    def seen(self) -> Array:
        """The points of everything visible [m], (k, 3)."""
        return np.concatenate([self.body, self.drawn, *(plate.corners for plate in self.plates)])

    @property
    def line_width(self) -> float:
        """The radius of the line that the tool draws [m]."""
        scene, drawing = (float(np.linalg.norm(np.ptp(points, axis=0))) for points in (self.seen, self.drawn))
        return max(min(LINE_WIDTH * scene, FINE_LINE_WIDTH * drawing), THINNEST * scene)


def draw_rollouts(recordings: Sequence[Recording]) -> list[DrawnRollout]:
    """Return the drawing of each rollout, lengths of all errors in one unit."""
    errors = in_fitting_units([path_error(recording) for recording in recordings])
    return [_draw(recording, error) for recording, error in zip(recordings, errors, strict=True)]


def _draw(recording: Recording, error: PathError | None) -> DrawnRollout:
    """Return the drawing of a rollout."""
    body = swept(recording)
    return DrawnRollout(recording, desired_lines(recording), error, body, find_plates(recording, body))
