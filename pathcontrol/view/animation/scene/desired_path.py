"""The path that is asked for, as lines in the base frame: cuts, and rapids between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.tasks.joined.sequence import PathSequence
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.animation.rollout import Take
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


def alike(lines: Sequence[Line], others: Sequence[Line]) -> bool:
    """Whether lines are the same to the eye, whatever objects they come from."""
    return len(lines) == len(others) and all(
        one.rapid == other.rapid
        and one.points.shape == other.points.shape
        and np.allclose(one.points, other.points, rtol=1e-6, atol=1e-9)
        for one, other in zip(lines, others, strict=True)
    )


def desired_lines(take: Take) -> list[Line]:
    """Where the tool should go, once along the path: the drawing itself for a toolpath."""
    if take.task is None:
        return []
    if take.toolpath is not None:
        lines = _drawing(take.toolpath)
    else:
        lines = [Line(take.tool_at(line.points)) for line in desired_joints(take)]
    lines = [Line(distinct(line.points), line.rapid) for line in lines]
    return [line for line in lines if len(line.points) > 1]


def desired_joints(take: Take) -> list[Line]:
    """Joint positions once along the path; along an endless one over the s of the run."""
    return [] if take.task is None else [Line(take.task.q_d(_parameters(take.task, take.s)))]


def _parameters(task: PathTask, s: Array) -> Array:
    """Parameters close together, and all at which pieces of the path meet."""
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
    pose = task.workpiece
    return [Line(_outline(c) @ pose[:3, :3].T + pose[:3, 3], c.rapid) for c in task.drawing]


def _outline(contour: Contour) -> Array:
    """Points of a contour [m], (k, 3), near enough for a picture."""
    from pathcontrol.toolpaths.segments.base import Polyline

    u = np.linspace(0.0, 1.0, _CURVE_SAMPLES + 1)
    parts = [segment.points if isinstance(segment, Polyline) else segment.point(u) for segment in contour.segments]
    return np.concatenate(parts)
