"""The desired path as lines in the base frame: cuts, and rapids between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.animation.rollout import Recording
from pathcontrol.view.animation.scene.tube import distinct

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask
    from pathcontrol.toolpaths.contour import Contour

_SAMPLES = 2001  # along a path in joint space …
_SAMPLES_EACH = 201  # … and along each path of a sequence
_CURVE_SAMPLES = 64


@dataclass(frozen=True, eq=False)
class Line:
    """Distinct points [m] or joint positions [rad], (k, d), one after another; ``rapid`` where no cut is."""

    points: Array
    rapid: bool = False


def look_alike(lines: Sequence[Line], others: Sequence[Line]) -> bool:
    """Return whether lines look the same, regardless of their objects."""
    return len(lines) == len(others) and all(
        one.rapid == other.rapid
        and one.points.shape == other.points.shape
        and np.allclose(one.points, other.points, rtol=1e-6, atol=1e-9)
        for one, other in zip(lines, others, strict=True)
    )


def desired_lines(recording: Recording) -> list[Line]:
    """Return the desired path of the tool, once along it: the drawing itself for a toolpath."""
    if recording.task is None:
        return []
    if recording.toolpath is not None:
        lines = _drawing(recording.toolpath)
    else:
        lines = [Line(recording.tool_at(line.points)) for line in desired_joints(recording)]
    lines = [Line(distinct(line.points), line.rapid) for line in lines]
    return [line for line in lines if len(line.points) > 1]


def desired_joints(recording: Recording) -> list[Line]:
    """Return joint positions once along the path; along an endless one over the s of the run."""
    return [] if recording.task is None else [Line(recording.task.q_d(_parameters(recording.task, recording.s)))]


def _parameters(task: PathTask, s: Array) -> Array:
    """Return closely spaced parameters, and all at which pieces of the path meet."""
    if isinstance(task, PathSequence):
        spans = zip(task.starts[:-1], task.starts[1:], strict=True)
        return np.unique(np.concatenate([np.linspace(begin, end, _SAMPLES_EACH) for begin, end in spans]))
    try:
        first, last = task.one_traverse
    except TaskError:
        first, last = s.min(), s.max()
    knots = np.array([]) if task.knots is None else np.asarray(task.knots)
    inner = knots[(knots > first) & (knots < last)]
    return np.union1d(np.linspace(first, last, _SAMPLES), inner)


def _drawing(task: ToolpathTask) -> list[Line]:
    """Return the contours of a toolpath as lines."""
    pose = task.workpiece
    return [Line(_outline(c) @ pose[:3, :3].T + pose[:3, 3], c.rapid) for c in task.drawing]


def _outline(contour: Contour) -> Array:
    """Return points of a contour [m], (k, 3), near enough for a picture."""
    from pathcontrol.toolpaths.segments.segment import Polyline

    u = np.linspace(0.0, 1.0, _CURVE_SAMPLES + 1)
    parts = [segment.points if isinstance(segment, Polyline) else segment.point(u) for segment in contour.segments]
    return np.concatenate(parts)
