"""The plane chart: joint over joint, or the tool in the plane in which its path extends most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.readable import in_degrees
from pathcontrol.view.animation.drawn_rollout import Shot
from pathcontrol.view.animation.payload import Film
from pathcontrol.view.animation.rollout import Take
from pathcontrol.view.animation.scene.desired_path import Line, alike, desired_joints
from pathcontrol.view.animation.scene.keyframes import line_keys
from pathcontrol.view.animation.scene.tube import simplified

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask

_FINE = 1 / 2000  # of the extent: less than a pixel
_MOST_POINTS = 4000
_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane and what lies in it, in the unit that is shown.

    Attributes:
        title, labels, unit: what the axes are.
        desired: lines that are asked for, (k, 2) each, for each run.
        taken: where each run was at its samples, (k, 2).
        points: where it should have been, (k, 2), or None.
    """

    title: str
    labels: tuple[str, str]
    unit: str
    desired: list[list[Line]]
    taken: list[Array]
    points: list[Array | None]

    def header(self, film: Film, shots: Sequence[Shot]) -> dict[str, Any]:
        """The plane as the header of a film has it."""
        everything = np.concatenate([*self.taken, *(line.points for lines in self.desired for line in lines)])
        fine = max(_FINE * float(np.ptp(everything, axis=0).max()), 1e-12)
        moving = list(enumerate(zip(shots, self.taken, self.points, strict=True)))
        return {
            "title": self.title,
            "x_label": self.labels[0],
            "y_label": self.labels[1],
            "unit": self.unit,
            "desired": [_still(film, line, fine) for lines in _once(self.desired) for line in lines],
            "traces": [_moving(film, i, shot.take, taken, fine) for i, (shot, taken, _) in moving],
            "points": [_moving(film, i, shot.take, p, fine) for i, (shot, _, p) in moving if p is not None],
        }


def plane(shots: Sequence[Shot]) -> Plane:
    """The plane that shows the runs best: that of a drawing, of two joints, or else of the tool."""
    toolpath = next((shot.take.toolpath for shot in shots if shot.take.toolpath is not None), None)
    units = {shot.take.run.unit("q") for shot in shots}
    if toolpath is None and len(units) == 1 and all(shot.take.robot.n == 2 for shot in shots):
        return _joint_plane(shots, units.pop())
    return _tool_plane(shots, toolpath)


def _joint_plane(shots: Sequence[Shot], own_unit: str) -> Plane:
    def shown(q: Array) -> Array:
        return in_degrees(q, own_unit)[0]

    takes = [shot.take for shot in shots]
    return Plane(
        "q1–q2",
        ("q1", "q2"),
        in_degrees(np.zeros(1), own_unit)[1],
        [[Line(shown(line.points)) for line in desired_joints(take)] for take in takes],
        [shown(take.q) for take in takes],
        [None if take.task is None else shown(take.task.q_d(take.s)) for take in takes],
    )


def _tool_plane(shots: Sequence[Shot], toolpath: ToolpathTask | None) -> Plane:
    """Of the base frame, or of the workpiece's of a toolpath; millimetres."""
    pose = np.eye(4) if toolpath is None else toolpath.workpiece
    extents = np.ptp(np.concatenate([_placed(shot.sight, pose) for shot in shots]), axis=0)
    i, j = sorted(np.argsort(-extents, kind="stable")[:2].tolist())

    def shown(x: Array) -> Array:
        return 1e3 * _placed(x, pose)[:, [i, j]]

    takes = [shot.take for shot in shots]
    return Plane(
        f"tool, {'workpiece ' if toolpath is not None else ''}{_AXES[i]}–{_AXES[j]}",
        (_AXES[i], _AXES[j]),
        "mm",
        [[Line(shown(line.points), line.rapid) for line in shot.lines] for shot in shots],
        [shown(take.tool_positions) for take in takes],
        [None if take.desired_positions is None else shown(take.desired_positions) for take in takes],
    )


def _placed(x: Array, pose: Array) -> Array:
    """Points (k, 3) of the base frame in another one, at ``pose`` (4, 4)."""
    return (x - pose[:3, 3]) @ pose[:3, :3]


def _once(desired: list[list[Line]]) -> list[list[Line]]:
    """The lines of each path, which several runs may share, once."""
    return [lines for i, lines in enumerate(desired) if not any(alike(lines, other) for other in desired[:i])]


def _still(film: Film, line: Line, fine: float) -> dict[str, Any]:
    points = simplified(line.points, fine, _MOST_POINTS)
    return {**_columns(film, points), "kind": "rapid" if line.rapid else "cut"}


def _moving(film: Film, run: int, take: Take, points: Array, fine: float) -> dict[str, Any]:
    while len(kept := line_keys(take.time, points, fine)) > _MOST_POINTS:
        fine *= 1.5
    return {"run": run, "times": film.block(take.time[kept]), **_columns(film, points[kept])}


def _columns(film: Film, points: Array) -> dict[str, Any]:
    return {"x": film.block(points[:, 0]), "y": film.block(points[:, 1])}
