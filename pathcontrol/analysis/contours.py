"""The numbers of a run contour by contour, or path by path: time, speed, deviation and coverage."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.analysis.coverage import Points, even_points, measure_coverage, refine, traverse
from pathcontrol.analysis.tool_following import PlannedToolCurve, feed_along, find_tool, tool_motion
from pathcontrol.cartesian.recognition import as_toolpath
from pathcontrol.cartesian.tool import Tool
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    from pathcontrol.toolpaths.contour import Contour

_MOST = 20_000  # limit of points on a segment
_FINER = 0.5  # distance between points of a drawing, as a share of the tolerance


class ContourNumbers(NamedTuple):
    """The numbers of a run on one contour of a toolpath, or on one path of a sequence.

    Attributes:
        name: its name in the file.
        rapid: True for a positioning move.
        length: length of the drawing [m].
        time: time from its begin to its end [s], NaN where it was not finished.
        feed: commanded speed [m/s].
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
    run: Run,
    task: PathSequence,
    robot: RobotModel,
    tolerance: float = 1e-3,
    stop: int | None = None,
    away: Array | None = None,
) -> list[ContourNumbers]:
    """Return the numbers of each contour in order, with the rapids between them.

    In a sequence of other paths each path is a contour: the curve on which it leads the tool.

    Args:
        run: a run along ``task``, of one rollout.
        task: the toolpath, or a sequence of paths made for a frame of the arm.
        robot: the arm.
        tolerance: how near [m] the tool has to come to a point of the drawing for it to count as passed.
        stop: how many samples count; all by default.
        away: the distance of the tool from the present contour [m], (time,), where it is known already.
    """
    tool = Tool(robot, str(task.frame), task.tool_pose)
    x, speed = (values[0, :stop] for values in tool_motion(run, robot, task))
    which, finish = run.array("path_index")[:stop], run.array("path_finish_time")
    found = []
    for contour, paths in _group_paths(task, tool):
        there = np.isin(which, paths)
        begin = 0.0 if paths[0] == 0 else finish[paths[0] - 1]
        way = x[there]
        points = contour.points if isinstance(contour, PlannedToolCurve) else contour_points(contour, tolerance)
        share, missed = measure_coverage(points, way, tolerance)
        found.append(
            ContourNumbers(
                contour.name,
                contour.rapid,
                contour.length,
                float(finish[paths[-1]] - begin),
                feed_of(contour, task, paths, robot),
                float(np.mean(speed[there])) if there.any() else np.nan,
                _farthest(contour, way, None if away is None else away[:stop][there]),
                missed,
                share,
            )
        )
    return found


def _farthest(contour: Contour | PlannedToolCurve, way: Array, away: Array | None) -> float:
    """Return the largest distance [m] of a way (k, 3) from a contour, in ``away`` if known; NaN of an unknown way."""
    known = np.isfinite(way).all(-1)
    if not known.any():
        return np.nan
    distance = contour.distance(way[known]) if away is None else away[known]
    return float(distance.max(initial=0.0))


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
    """Return the numbers of each contour of a run, or of each path of a sequence, as texts for a reader.

    Column heads come first; the table is empty for a run of another kind.

    Raises:
        InputError: the run does not know its robot.
    """
    task = run.task
    if not isinstance(task, PathSequence) or "path_finish_time" not in run or "qd" not in run:
        return []
    arm = run.robot if robot is None else robot
    if find_tool(arm, task) is None:
        return []
    return [list(HEADS), *(_texts(i, one) for i, one in enumerate(contour_numbers(run, task, arm)))]


def _texts(number: int, one: ContourNumbers) -> list[str]:
    """Return one row of the table."""
    begun = np.isfinite(one.speed)
    return [
        one.name or str(number),
        "rapid" if one.rapid else "",
        f"{one.time:.4g}" if np.isfinite(one.time) else "not finished" if begun else "not begun",
        f"{1e3 * one.feed:.4g}",
        *((f"{1e3 * one.speed:.4g}", f"{1e6 * one.deviation:.4g}", f"{1e6 * one.missed:.4g}") if begun else "–––"),
        f"{100 * one.coverage:.4g} %",
    ]


def feed_of(contour: Contour | PlannedToolCurve, task: PathSequence, paths: Sequence[int], robot: RobotModel) -> float:
    """Return the commanded speed [m/s] on a contour that some ``paths`` follow; the mean along other paths."""
    toolpath = as_toolpath(task)
    if toolpath is None or isinstance(contour, PlannedToolCurve):
        return _feed_of_path(task.paths[paths[0]], robot)
    if contour.rapid:
        return float(toolpath.rapid_speed)
    return float(contour.feed or toolpath.feed or np.nan)


def _feed_of_path(path: PathTask, robot: RobotModel) -> float:
    """Return the commanded speed [m/s] of the tool on a path, its mean over s where it changes."""
    from pathcontrol.cartesian.cartesian_path import CartesianPath

    if isinstance(path, CartesianPath):
        return path.speed
    return float(np.mean(feed_along(path, robot, traverse(path))))


def contour_points(contour: Contour, tolerance: float) -> Points:
    """Return points on a contour [m], (k, 3), at most half of the ``tolerance`` apart."""
    from pathcontrol.toolpaths.segments.segment import Polyline

    parts = []
    for segment in contour.segments:
        if isinstance(segment, Polyline):
            parts.append(refine(segment.points, _FINER * tolerance))
        else:
            count = int(np.clip(np.ceil(segment.length / (_FINER * tolerance)), 32, _MOST))
            parts.append(segment.point(np.linspace(0.0, 1.0, count + 1)))
    return even_points(np.concatenate(parts))


def _group_paths(task: PathSequence, tool: Tool) -> Sequence[tuple[Contour | PlannedToolCurve, list[int]]]:
    """Return each contour with the paths that follow it, several where the arm stops at corners."""
    toolpath = as_toolpath(task)
    if toolpath is None:
        return [(PlannedToolCurve(path, tool), [i]) for i, path in enumerate(task.paths)]
    every = list(enumerate(toolpath.contours))
    return [
        (toolpath.contours[paths[0]], paths)
        for _, group in groupby(every, key=lambda pair: id(pair[1]))
        if (paths := [i for i, _ in group])
    ]
