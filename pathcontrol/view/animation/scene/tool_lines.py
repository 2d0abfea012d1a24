"""The lines and markers of each rollout in the scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.drawn_rollout import DrawnRollout
from pathcontrol.view.animation.scene.desired_path import look_alike
from pathcontrol.view.animation.scene.legend import tops
from pathcontrol.view.animation.scene.palette import DESIRED_POINT, PLAIN, scale_colors
from pathcontrol.view.animation.scene.scene_builder import Stage
from pathcontrol.view.animation.scene.trace import trace

_HALO, _DOT = 6.0, 2.8  # radii of the desired point and of the tool, of that of the tool's line


def add_lines(stage: Stage, drawn_rollouts: Sequence[DrawnRollout], shifts: Array, width: float, ghosted: bool) -> None:
    """Draw the desired paths, and within them the lines of the tools, with tubes of a radius ``width`` [m].

    A path that was drawn for one ghost is not drawn again for the next.
    """
    ends = tops([drawn_rollout.error for drawn_rollout in drawn_rollouts])
    for i, (drawn_rollout, shift) in enumerate(zip(drawn_rollouts, shifts, strict=True)):
        if not (ghosted and any(look_alike(drawn_rollout.lines, other.lines) for other in drawn_rollouts[:i])):
            stage.add_desired(i, drawn_rollout.lines, 2 * width, shift)
        share, colors = _color_line(drawn_rollout, ends, ghosted)
        line = trace(drawn_rollout.recording.time, drawn_rollout.recording.tool_positions + shift, share, width)
        if line is not None:
            stage.add_trace(i, line, drawn_rollout.recording.time, colors)


def add_markers(stage: Stage, drawn_rollouts: Sequence[DrawnRollout], shifts: Array, width: float) -> None:
    """Add a halo at the desired position of each tool, and a dot of its run's colour at the actual one."""
    for i, (drawn_rollout, shift) in enumerate(zip(drawn_rollouts, shifts, strict=True)):
        recording = drawn_rollout.recording
        if recording.desired_positions is not None:
            halo = recording.desired_positions + shift
            stage.add_marker(f"markers/{i} desired", recording.time, halo, DESIRED_POINT, _HALO * width)
        stage.add_marker(
            f"markers/{i} tool", recording.time, recording.tool_positions + shift, recording.color, _DOT * width
        )


def _color_line(drawn_rollout: DrawnRollout, ends: dict[tuple[str, str], float], ghosted: bool) -> tuple[Array, Array]:
    """Return share of the scale (k,) and colour (k, 3) of a line at each sample."""
    if ghosted or drawn_rollout.error is None:
        color = drawn_rollout.recording.color if ghosted else PLAIN
        return np.zeros(len(drawn_rollout.recording.time)), np.tile(color[:3], (len(drawn_rollout.recording.time), 1))
    share = drawn_rollout.error.values / max(ends[drawn_rollout.error.label, drawn_rollout.error.unit], 1e-300)
    return share, scale_colors(share)
