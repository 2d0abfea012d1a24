"""The legend of a film: lines, dots, colours and the names of arms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.view.animation.drawn_rollout import DrawnRollout
from pathcontrol.view.animation.path_error import PathError
from pathcontrol.view.animation.scene.palette import DESIRED, DESIRED_POINT, PLAIN, RAPID, WALL, scale_colors
from pathcontrol.view.bodies.body_shapes import Color

_STEPS = 9  # colours of a scale, between which the page blends
_ABOVE, _APART = 0.06, 0.05  # shares of the visible height: labels above the arm, and above one another


def legend(drawn_rollouts: Sequence[DrawnRollout], ghosted: bool) -> list[dict[str, Any]]:
    """Return the entries of a legend, in the order of their importance."""
    drawn = [line for drawn_rollout in drawn_rollouts for line in drawn_rollout.lines]
    entries = [_entry("desired path", "line", DESIRED)] if any(not line.rapid for line in drawn) else []
    entries += [_entry("rapid", "dashed", RAPID)] if any(line.rapid for line in drawn) else []
    if any(drawn_rollout.recording.task is not None for drawn_rollout in drawn_rollouts):
        entries.append(_entry("desired point", "dot", DESIRED_POINT))
    entries += [_entry("wall", "square", WALL)] if any(one.plates for one in drawn_rollouts) else []
    if len(drawn_rollouts) == 1:
        entries.append(_entry("tool", "dot", drawn_rollouts[0].recording.color))
    else:
        entries += [
            _entry(drawn_rollout.recording.name, "line" if ghosted else "dot", drawn_rollout.recording.color)
            for drawn_rollout in drawn_rollouts
        ]
    return entries if ghosted else entries + _scales([drawn_rollout.error for drawn_rollout in drawn_rollouts])


def tops(errors: Sequence[PathError | None]) -> dict[tuple[str, str], float]:
    """Return the top of each scale by quantity and unit: errors that can be compared share a scale."""
    found: dict[tuple[str, str], float] = {}
    for error in errors:
        if error is not None:
            key = (error.label, error.unit)
            found[key] = max(found.get(key, 0.0), error.top)
    return found


def labels(drawn_rollouts: Sequence[DrawnRollout], ghosted: bool) -> list[dict[str, Any]]:
    """Return the name of each arm above it; those of ghosts one above the other."""
    entries, height = [], max(float(np.ptp(drawn_rollout.seen[:, 2])) for drawn_rollout in drawn_rollouts)
    for i, drawn_rollout in enumerate(drawn_rollouts):
        offset = _top(drawn_rollout.seen)
        offset[2] += (_ABOVE + _APART * i * ghosted) * height
        place = {"path": f"/meshcat/arms/{i}", "offset": offset.tolist()}
        entries.append(
            {"text": drawn_rollout.recording.name, "color": list(drawn_rollout.recording.color[:3]), **place}
        )
    return entries


def _scales(errors: Sequence[PathError | None]) -> list[dict[str, Any]]:
    """Return the colour scales of errors."""
    entries = [_entry("path taken", "line", PLAIN)] if any(error is None for error in errors) else []
    colors = scale_colors(np.linspace(0.0, 1.0, _STEPS)).round(3).tolist()
    for (label, unit), top in tops(errors).items():
        look_alike = [error for error in errors if error is not None and (error.label, error.unit) == (label, unit)]
        exceeded = max(error.largest for error in look_alike) > 1.005 * top
        end = f"{'≥ ' if exceeded else ''}{top:.3g}"
        entries.append({"label": label, "kind": "scale", "colors": colors, "from": "0", "to": end, "unit": unit})
    return entries


def _top(points: Array) -> Array:
    """Return the middle of the upper side of the box around points (k, 3) [m], (3,)."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    return np.array([*(lower + upper)[:2] / 2, upper[2]])


def _entry(label: str, kind: str, color: Color) -> dict[str, Any]:
    """Return an entry of the legend."""
    return {"label": label, "kind": kind, "color": list(color[:3])}
