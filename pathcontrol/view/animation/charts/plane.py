"""The plane chart: joint over joint, or the tool in the plane in which its path extends most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.readable import in_degrees
from pathcontrol.view.animation.drawn_rollout import DrawnRollout
from pathcontrol.view.animation.payload import Film
from pathcontrol.view.animation.rollout import Recording
from pathcontrol.view.animation.scene.desired_path import Line, desired_joints, look_alike
from pathcontrol.view.animation.scene.keyframes import line_keys
from pathcontrol.view.animation.scene.tube import simplify

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask

_FINE = 1 / 2000  # share of the extent, less than a pixel
_MOST_POINTS = 4000
_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane with its lines, in the unit that is shown.

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

    def header(self, film: Film, drawn_rollouts: Sequence[DrawnRollout]) -> dict[str, Any]:
        """Return the plane for the header of a film."""
        everything = np.concatenate([*self.taken, *(line.points for lines in self.desired for line in lines)])
        fine = max(_FINE * float(np.ptp(everything, axis=0).max()), 1e-12)
        moving = list(enumerate(zip(drawn_rollouts, self.taken, self.points, strict=True)))
        return {
            "title": self.title,
            "x_label": self.labels[0],
            "y_label": self.labels[1],
            "unit": self.unit,
            "desired": [_still(film, line, fine) for lines in _drop_repeats(self.desired) for line in lines],
            "traces": [
                _moving(film, i, drawn_rollout.recording, taken, fine) for i, (drawn_rollout, taken, _) in moving
            ],
            "points": [
                _moving(film, i, drawn_rollout.recording, p, fine)
                for i, (drawn_rollout, _, p) in moving
                if p is not None
            ],
        }


def plane(drawn_rollouts: Sequence[DrawnRollout]) -> Plane:
    """Return the plane that shows the runs best: that of a drawing, of two joints, or else of the tool."""
    toolpath = next(
        (
            drawn_rollout.recording.toolpath
            for drawn_rollout in drawn_rollouts
            if drawn_rollout.recording.toolpath is not None
        ),
        None,
    )
    units = {drawn_rollout.recording.run.unit("q") for drawn_rollout in drawn_rollouts}
    if (
        toolpath is None
        and len(units) == 1
        and all(drawn_rollout.recording.robot.n == 2 for drawn_rollout in drawn_rollouts)
    ):
        return _joint_plane(drawn_rollouts, units.pop())
    return _tool_plane(drawn_rollouts, toolpath)


def _joint_plane(drawn_rollouts: Sequence[DrawnRollout], own_unit: str) -> Plane:
    """Return the plane of the two joints."""

    def shown(q: Array) -> Array:
        return in_degrees(q, own_unit)[0]

    recordings = [drawn_rollout.recording for drawn_rollout in drawn_rollouts]
    return Plane(
        "q1–q2",
        ("q1", "q2"),
        in_degrees(np.zeros(1), own_unit)[1],
        [[Line(shown(line.points)) for line in desired_joints(recording)] for recording in recordings],
        [shown(recording.q) for recording in recordings],
        [None if recording.task is None else shown(recording.task.q_d(recording.s)) for recording in recordings],
    )


def _tool_plane(drawn_rollouts: Sequence[DrawnRollout], toolpath: ToolpathTask | None) -> Plane:
    """Return the plane of the base frame, or of a toolpath's workpiece; millimetres."""
    pose = np.eye(4) if toolpath is None else toolpath.workpiece
    extents = np.ptp(
        np.concatenate([_transform(drawn_rollout.sight, pose) for drawn_rollout in drawn_rollouts]), axis=0
    )
    i, j = sorted(np.argsort(-extents, kind="stable")[:2].tolist())

    def shown(x: Array) -> Array:
        return 1e3 * _transform(x, pose)[:, [i, j]]

    recordings = [drawn_rollout.recording for drawn_rollout in drawn_rollouts]
    return Plane(
        f"tool, {'workpiece ' if toolpath is not None else ''}{_AXES[i]}–{_AXES[j]}",
        (_AXES[i], _AXES[j]),
        "mm",
        [[Line(shown(line.points), line.rapid) for line in drawn_rollout.lines] for drawn_rollout in drawn_rollouts],
        [shown(recording.tool_positions) for recording in recordings],
        [
            None if recording.desired_positions is None else shown(recording.desired_positions)
            for recording in recordings
        ],
    )


def _transform(x: Array, pose: Array) -> Array:
    """Return points (k, 3) of the base frame in another one, at ``pose`` (4, 4)."""
    return (x - pose[:3, 3]) @ pose[:3, :3]


def _drop_repeats(desired: list[list[Line]]) -> list[list[Line]]:
    """Return the lines of each path once, as several runs may share them."""
    return [lines for i, lines in enumerate(desired) if not any(look_alike(lines, other) for other in desired[:i])]


def _still(film: Film, line: Line, fine: float) -> dict[str, Any]:
    """Return a line that does not move, for the header."""
    points = simplify(line.points, fine, _MOST_POINTS)
    return {**_columns(film, points), "kind": "rapid" if line.rapid else "cut"}


def _moving(film: Film, run: int, recording: Recording, points: Array, fine: float) -> dict[str, Any]:
    """Return a line that moves with the samples of a run, for the header."""
    while len(kept := line_keys(recording.time, points, fine)) > _MOST_POINTS:
        fine *= 1.5
    line: dict[str, Any] = {"run": run}
    if (rapid := _on_rapids(recording)).any():
        turns = np.flatnonzero(np.diff(rapid))  # the last sample of each cut and of each rapid
        kept = np.union1d(kept, turns)
        line["rapid"] = film.block(rapid[kept], "u1")
    return {**line, "times": film.block(recording.time[kept]), **_columns(film, points[kept])}


def _on_rapids(recording: Recording) -> NDArray[np.bool_]:
    """Return at which samples the arm follows a rapid, (k,)."""
    if recording.toolpath is None:
        return np.zeros(len(recording.time), dtype=bool)
    return np.array([contour.rapid for contour in recording.toolpath.contours])[recording.run.array("path_index")]


def _columns(film: Film, points: Array) -> dict[str, Any]:
    """Return points by coordinate, for the header."""
    return {"x": film.block(points[:, 0]), "y": film.block(points[:, 1])}
