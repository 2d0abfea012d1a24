"""The deviation of the tool from the drawing that it should follow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.contours import contour_numbers
from pathcontrol.analysis.limit_shares import limit_ratios
from pathcontrol.analysis.metric_helpers import apply_by_task, apply_where_finite, resolve_task, resolve_toolpath
from pathcontrol.analysis.progress import progress
from pathcontrol.analysis.tool_following import PlannedToolCurve, orientation_error, require_tool, tool_motion
from pathcontrol.analysis.window import Samples, Window, own_samples, samples_of
from pathcontrol.cartesian.recognition import as_toolpath
from pathcontrol.engine.frame_kinematics import frame_poses
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask
    from pathcontrol.toolpaths.contour import Contour


def tool_positions(run: Run, robot: RobotModel | None = None, frame: str | None = None) -> Array:
    """Return the positions of the origin of a frame [m], (rollout, time, 3), in the base frame.

    The default is the run's own robot, and the frame that its path was made for, or the tool in it.

    Raises:
        InputError: no frame is given, and the path of the run was made for none.
    """
    expect("run", run, Run)
    arm = run.robot if robot is None else robot
    expect("robot", arm, RobotModel)
    name, tip = _find_tool(resolve_task(run, None)) if frame is None else (frame, np.eye(4)[3])
    return apply_where_finite(
        lambda q: (frame_poses(arm, q, [name])[..., 0, :, :] @ tip)[..., :3], run.array("q"), shape=(3,)
    )


def tool_deviation(
    run: Run, robot: RobotModel | None = None, frame: str | None = None, contours: Sequence[Contour] | None = None
) -> Array:
    """Return the distance of the tool from the geometry of a drawing, or from the curve of its path, [m].

    It has the shape (rollout, time). The geometry is that of the lines, arcs and Bézier curves of the file itself, not
    of curves fitted to them.

    Args:
        run: the run.
        robot: the arm; by default the run's own.
        frame: the tool's frame; by default the one that the run's path was made for.
        contours: the contour of each path of the run in the robot's base frame, or one for all; a run of several
            paths is measured at each sample against the contour of the path it was on. By default those of the run's
            toolpath; of another path made for a frame of the arm the curve on which it leads the tool.

    Raises:
        InputError: something is left out that the run does not know.
    """
    if contours is not None:
        return contour_deviation(run, contours, tool_positions(run, robot, frame))

    def deviation(part: Run, task: PathTask) -> Array:
        plan = part.model if robot is None else robot
        return contour_deviation(part, geometry_of(task, plan), tool_positions(part, robot, frame))

    return apply_by_task(deviation, run, None)


class Geometry(Protocol):
    """The interface of a reference curve of the tool: a contour of a drawing, or the curve of a path."""

    def distance(self, x: Array) -> Array:
        """Return the distance of points x (N, 3) from it [m], (N,)."""


def geometry_of(task: PathTask, robot: RobotModel) -> Sequence[Geometry]:
    """Return the reference curves of a tool: the contours of a toolpath, or the curve on which each path leads it.

    Raises:
        InputError: the path was made for no frame of the arm.
        TaskError: the path goes on for ever without repeating.
    """
    if (toolpath := as_toolpath(task)) is not None:
        return toolpath.contours
    paths, tool = task.paths if isinstance(task, PathSequence) else [task], require_tool(robot, task)
    return [PlannedToolCurve(path, tool) for path in paths]


def contour_deviation(run: Run, contours: Sequence[Geometry], x: Array) -> Array:
    """Return the distance [m], (rollout, time), of x (rollout, time, 3) from the contour of the present path."""
    if len(contours) == 1 or "path_index" not in run:
        return np.min([apply_where_finite(contour.distance, x) for contour in contours], axis=0)
    which, deviation = run.array("path_index"), np.empty(x.shape[:-1])
    for i in np.unique(which):
        deviation[:, which == i] = apply_where_finite(contours[i].distance, x[:, which == i])
    return deviation


def toolpath_metrics(
    run: Run,
    robot: RobotModel | None = None,
    task: ToolpathTask | None = None,
    *,
    tolerance: float = 1e-3,
    window: Window = "all",
) -> dict[str, Any]:
    """Return the metrics of a run along its toolpath, or another, each a list with one entry for each rollout.

    Over the cuts: largest and RMS distance of the tool from the drawing, ``tool_deviation`` [m]; the other way round
    the largest distance of a point of the drawing from the tool's way, ``drawing_deviation_peak`` [m]; the share of
    the drawing's length that the tool passed within ``tolerance``, ``coverage``; mean and largest speed of the tool
    beside the ``feed`` that was asked for, all [m/s], and the time that the cuts took, ``cut_time`` [s]; the largest
    ``orientation_error_peak`` [rad], left out where the tool may turn as it likes; peaks and RMS of ‖e_p‖ [rad] and
    ‖e_v‖ [rad/s].

    How far the smooth curves are from the drawing, ``smoothing_deviation`` [m]; the largest torque demand [N m]; the
    largest shares that position, velocity and torque have of their limits; the share of the path that was passed,
    ``progress``; and the time after which the last path was finished [s], NaN if it was not.

    Args:
        run: the run.
        robot: the arm; by default the run's own.
        task: the toolpath; by default the run's own.
        tolerance: how near [m] the tool has to come to a point of the drawing for it to count as passed.
        window: from when to when [s] peaks and RMS are, by default all of the time until the last path is finished.

    Raises:
        InputError: something is left out that the run does not know.
    """
    task, arm = resolve_toolpath(run, task), run.robot if robot is None else robot
    own, counted = samples_of(run, "all"), samples_of(run, window)
    on_cuts = np.array([not contour.rapid for contour in task.contours])[run.array("path_index")]
    cutting = np.where(on_cuts, 1.0, np.nan)
    position, speed = tool_motion(run, arm, task)
    signals = {
        "tool_deviation": contour_deviation(run, task.contours, position),
        "e_p": run.norm("e_p"),
        "e_v": run.norm("e_v"),
    }
    values = {f"{name}_peak": counted.reduce(_largest, v * cutting) for name, v in signals.items()}
    values |= {f"{name}_rms": counted.reduce(_rms, v * cutting) for name, v in signals.items()}
    if "path_finish_time" in run:  # a part of a run has none
        values |= _measure_drawing(run, task, arm, tolerance, signals["tool_deviation"])
    values |= _measure_tool(run, task, arm, counted, speed * cutting, cutting)
    values["smoothing_deviation"] = np.full(run.rollouts, task.deviation)
    values["tau_demand_peak"] = own.reduce(np.max, np.abs(run.array("tau_demand")))
    values |= limit_ratios(run if robot is None else run.with_robot(arm), own)
    values |= {"progress": progress(run, task), "path_time": run.finish_time}
    return {name: value.tolist() for name, value in values.items()}


def _measure_drawing(
    run: Run, task: ToolpathTask, robot: RobotModel, tolerance: float, away: Array
) -> dict[str, Array]:
    """Return how much of the drawing was passed in which time, (rollout,) each."""
    stop, found = own_samples(run), []
    for i in range(run.rollouts):
        every = contour_numbers(run.rollout(i), task, robot, tolerance, int(stop[i]), away[i])
        cuts = [one for one in every if not one.rapid]
        length = sum(one.length for one in cuts)
        found.append(
            (
                sum(one.length * one.coverage for one in cuts) / length if cuts else np.nan,
                max((one.missed for one in cuts), default=np.nan),
                sum(one.time for one in cuts),
                length / sum(one.length / one.feed for one in cuts) if cuts else np.nan,
            )
        )
    return dict(zip(("coverage", "drawing_deviation_peak", "cut_time", "feed"), np.array(found).T, strict=True))


def _measure_tool(
    run: Run, task: ToolpathTask, robot: RobotModel, counted: Samples, speed: Array, cutting: Array
) -> dict[str, Array]:
    """Return speed and orientation error of the tool over the cuts, (rollout,) each, of its speed there."""
    values = {"tool_speed_mean": counted.reduce(_mean, speed), "tool_speed_peak": counted.reduce(_largest, speed)}
    if task.rotations:
        error = orientation_error(run, task, robot) * cutting
        values["orientation_error_peak"] = counted.reduce(_largest, error)
    return values


def _largest(values: Array) -> float:
    """Return the largest value that is not NaN."""
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan


def _mean(values: Array) -> float:
    """Return the mean of the values that are not NaN."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else np.nan


def _rms(values: Array) -> float:
    """Return the RMS of the values that are not NaN."""
    return float(np.sqrt(_mean(values**2)))


def _find_tool(task: PathTask) -> tuple[str, Array]:
    """Return the frame that a path was made for, and the tip of the tool in it, homogeneous (4,)."""
    if task.frame is None:
        raise InputError(
            f"the {type(task).__name__} of the run was not made for a frame of the arm; give frame=…", argument="frame"
        )
    return task.frame, (np.eye(4) if task.tool_pose is None else task.tool_pose)[:, 3]
