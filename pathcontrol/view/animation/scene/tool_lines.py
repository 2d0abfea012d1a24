"""The lines and markers of each shot, put on stage."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.drawn_rollout import Shot
from pathcontrol.view.animation.scene.builder import Stage
from pathcontrol.view.animation.scene.desired_path import alike
from pathcontrol.view.animation.scene.legend import tops
from pathcontrol.view.animation.scene.palette import DESIRED_POINT, PLAIN, scale_colors
from pathcontrol.view.animation.scene.trace import trace

_HALO, _DOT = 6.0, 2.8  # radii of the desired point and of the tool, of that of the tool's line


def add_lines(stage: Stage, shots: Sequence[Shot], shifts: Array, width: float, ghosted: bool) -> None:
    """Draw the desired paths, and within them what the tools draw, with tubes of a radius ``width`` [m].

    A path that was drawn for one ghost is not drawn again for the next.
    """
    ends = tops([shot.error for shot in shots])
    for i, (shot, shift) in enumerate(zip(shots, shifts, strict=True)):
        if not (ghosted and any(alike(shot.lines, other.lines) for other in shots[:i])):
            stage.add_desired(i, shot.lines, 2 * width, shift)
        share, colors = _painted(shot, ends, ghosted)
        line = trace(shot.take.time, shot.take.tool_positions + shift, share, width)
        if line is not None:
            stage.add_trace(i, line, shot.take.time, colors)


def add_markers(stage: Stage, shots: Sequence[Shot], shifts: Array, width: float) -> None:
    """Put a halo where each tool should be, and a dot of its run's colour where it is."""
    for i, (shot, shift) in enumerate(zip(shots, shifts, strict=True)):
        take = shot.take
        if take.desired_positions is not None:
            halo = take.desired_positions + shift
            stage.add_marker(f"markers/{i} desired", take.time, halo, DESIRED_POINT, _HALO * width)
        stage.add_marker(f"markers/{i} tool", take.time, take.tool_positions + shift, take.color, _DOT * width)


def _painted(shot: Shot, ends: dict[tuple[str, str], float], ghosted: bool) -> tuple[Array, Array]:
    """Share of the scale (k,) and colour (k, 3) of a line at each sample."""
    if ghosted or shot.error is None:
        color = shot.take.color if ghosted else PLAIN
        return np.zeros(len(shot.take.time)), np.tile(color[:3], (len(shot.take.time), 1))
    share = shot.error.values / max(ends[shot.error.label, shot.error.unit], 1e-300)
    return share, scale_colors(share)
