"""A run along a toolpath contour by contour: how long each took, how fast, how near to the drawing, how much of it."""

from __future__ import annotations

from itertools import groupby
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.coverage import Points, even_points, passed, refined
from pathcontrol.analysis.known import where_known
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments import Polyline

_MOST = 20_000  # points of a segment
_FINER = 0.5  # of the tolerance, between points of a drawing


class ContourNumbers(NamedTuple):
    """What a run did on one contour.

    Attributes:
        name: what the file calls it.
        rapid: whether it is a positioning move.
        length: of the drawing [m].
        time: from its begin to its end [s], NaN where it was not finished.
        feed: speed asked for [m/s].
        speed: mean speed of the tool [m/s], NaN where it was not begun.
        deviation: largest distance of the tool from the drawing [m].
        missed: largest distance of the drawing from the tool's way [m].
        coverage: share of its length that the tool passed within the tolerance.
    """

    name: str
    rapid: bool
    length: float
    time: float
    feed: float
    speed: float
    deviation: float
    missed: float
    coverage: float


def contour_numbers(
    run: Run, task: ToolpathTask, robot: RobotModel, tolerance: float = 1e-3, stop: int | None = None
) -> list[ContourNumbers]:
    """The numbers of each contour in their order; rapids between them included.

    Args:
        run: a run along ``task``, of one rollout.
        task: the toolpath.
        robot: the arm.
        tolerance: how near [m] the tool has to come to a point of the drawing for it to count as passed.
        stop: how many samples count; all by default.
    """
    q = run.array("q")[:, :stop]
    x = where_known(lambda q: robot.frame_pose(q, task.frame)[..., :3, 3], q)[0]
    speed = tool_speed(run, robot, task.frame)[0, :stop]
    which, finish = run["path_index"].to_numpy()[:stop], run.data["path_finish_time"].to_numpy()
    found = []
    for contour, paths in _grouped(task):
        there = np.isin(which, paths)
        begin = 0.0 if paths[0] == 0 else finish[paths[0] - 1]
        way, known = x[there], np.isfinite(x[there]).all(-1)
        share, missed = passed(contour_points(contour, tolerance), way, tolerance)
        found.append(
            ContourNumbers(
                contour.name,
                contour.rapid,
                contour.length,
                float(finish[paths[-1]] - begin),
                feed_of(contour, task),
                float(np.mean(speed[there])) if there.any() else np.nan,
                float(contour.distance(way[known]).max(initial=0.0)) if known.any() else np.nan,
                missed,
                share,
            )
        )
    return found


#: the columns of :func:`contour_table`
HEADS = (
    "contour",
    "",
    "time [s]",
    "feed [mm/s]",
    "mean speed [mm/s]",
    "tool from it [µm]",
    "it from the tool [µm]",
    "passed",
)


def contour_table(run: Run, robot: RobotModel | None = None) -> list[list[str]]:
    """The numbers of each contour of a run along a toolpath as texts for a reader, heads first; empty for another run.

    Raises:
        InputError: the run does not know its robot.
    """
    task = run.task
    if not isinstance(task, ToolpathTask) or "path_finish_time" not in run.data.coords or "qd" not in run.data:
        return []
    arm = run.robot if robot is None else robot
    return [list(HEADS), *(_texts(i, one) for i, one in enumerate(contour_numbers(run, task, arm)))]


def _texts(number: int, one: ContourNumbers) -> list[str]:
    begun = np.isfinite(one.speed)
    return [
        one.name or str(number),
        "rapid" if one.rapid else "",
        f"{one.time:.4g}" if np.isfinite(one.time) else "not finished" if begun else "not begun",
        f"{1e3 * one.feed:.4g}",
        *((f"{1e3 * one.speed:.4g}", f"{1e6 * one.deviation:.4g}", f"{1e6 * one.missed:.4g}") if begun else "–––"),
        f"{100 * one.coverage:.4g} %",
    ]


def feed_of(contour: Contour, task: ToolpathTask) -> float:
    """The speed [m/s] that is asked for on a contour."""
    if contour.rapid:
        return float(task.rapid_speed)
    return float(contour.feed or task.feed or np.nan)


def tool_speed(run: Run, robot: RobotModel, frame: str) -> Array:
    """‖J(q)q̇‖ [m/s], (rollout, time): how fast the origin of a frame moved."""

    def speed(q: Array, qd: Array) -> Array:
        _, jacobian = robot.frame_kinematics(q, frame)
        return np.linalg.norm((jacobian[..., :3, :] @ qd[..., None])[..., 0], axis=-1)

    return where_known(speed, run.array("q"), run.array("qd"))


def feed_along(task: ToolpathTask, robot: RobotModel, s: Array) -> Array:
    """The speed [m/s], (*batch,), at which the plan leads the tool at s: the feed, or less where it is limited."""
    _, jacobian = robot.frame_kinematics(task.q_d(s), task.frame)
    return np.linalg.norm((jacobian[..., :3, :] @ task.dq_d(s)[..., None])[..., 0], axis=-1) * task.theta(s)


def contour_points(contour: Contour, tolerance: float) -> Points:
    """Points of a contour [m], (k, 3), no farther apart than half of the ``tolerance``, each on the contour itself."""
    parts = []
    for segment in contour.segments:
        if isinstance(segment, Polyline):
            parts.append(refined(segment.points, _FINER * tolerance))
        else:
            count = int(np.clip(np.ceil(segment.length / (_FINER * tolerance)), 32, _MOST))
            parts.append(segment.point(np.linspace(0.0, 1.0, count + 1)))
    return even_points(np.concatenate(parts))


def _grouped(task: ToolpathTask) -> list[tuple[Contour, list[int]]]:
    """Each contour with the paths that follow it: several where the arm stops at corners."""
    every = list(enumerate(task.contours))
    return [
        (task.contours[paths[0]], paths)
        for _, group in groupby(every, key=lambda pair: id(pair[1]))
        if (paths := [i for i, _ in group])
    ]
