"""How far the tool was from the drawing it should follow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.contours import contour_numbers
from pathcontrol.analysis.known import known_task, known_toolpath, of_rollouts, where_known
from pathcontrol.analysis.limit_shares import limit_ratios
from pathcontrol.analysis.progress import progress
from pathcontrol.analysis.tool import LedCurve, made_for, orientation_error, tool_speed
from pathcontrol.analysis.window import Samples, Window, own_samples, samples_of
from pathcontrol.cartesian.recognition import as_toolpath
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.joined.sequence import PathSequence
from pathcontrol.tasks.task import PathTask

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask
    from pathcontrol.toolpaths.contour import Contour


def tool_positions(run: Run, robot: RobotModel | None = None, frame: str | None = None) -> Array:
    """Where the origin of a frame was [m], (rollout, time, 3), in the base frame.

    By default of the run's own robot, and of the frame that its path was made for, or the tool in it.

    Raises:
        InputError: no frame is given, and the path of the run was made for none.
    """
    expect("run", run, Run)
    arm = run.robot if robot is None else robot
    expect("robot", arm, RobotModel)
    name, tip = _tool(known_task(run, None)) if frame is None else (frame, np.eye(4)[3])
    return where_known(lambda q: (arm.frame_pose(q, name) @ tip)[..., :3], run.array("q"), shape=(3,))


def tool_deviation(
    run: Run, robot: RobotModel | None = None, frame: str | None = None, contours: Sequence[Contour] | None = None
) -> Array:
    """Distance of the tool from the geometry of a drawing, or from the curve of its path, [m], (rollout, time).

    The lines, arcs and Bézier curves of the file itself are measured against, not curves that were fitted to them.

    Args:
        run: what happened.
        robot: the arm that it happened to; by default the run's own.
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

    return of_rollouts(deviation, run, None)


class Geometry(Protocol):
    """What a tool may be away from: a contour of a drawing, or the curve of a path."""

    def distance(self, x: Array) -> Array:
        """Distance of points x (N, 3) from it [m], (N,)."""


def geometry_of(task: PathTask, robot: RobotModel) -> Sequence[Geometry]:
    """What the tool of an arm should be on: the contours of a toolpath, or the curve on which each path leads it.

    Raises:
        InputError: the path was made for no frame of the arm.
        TaskError: the path goes on for ever without repeating.
    """
    if (toolpath := as_toolpath(task)) is not None:
        return toolpath.contours
    paths, tool = task.paths if isinstance(task, PathSequence) else [task], made_for(robot, task)
    return [LedCurve(path, tool) for path in paths]


def contour_deviation(run: Run, contours: Sequence[Geometry], x: Array) -> Array:
    """Distance [m], (rollout, time), of x (rollout, time, 3) from the contour of the path that the run was on."""
    if len(contours) == 1 or "path_index" not in run:
        return np.min([where_known(contour.distance, x) for contour in contours], axis=0)
    which, deviation = run.array("path_index"), np.empty(x.shape[:-1])
    for i in np.unique(which):
        deviation[:, which == i] = where_known(contours[i].distance, x[:, which == i])
    return deviation


def toolpath_metrics(
    run: Run,
    robot: RobotModel | None = None,
    task: ToolpathTask | None = None,
    *,
    tolerance: float = 1e-3,
    window: Window = "all",
) -> dict[str, Any]:
    """The numbers of a run along its toolpath, or another, each a list with one entry for each rollout.

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
        run: what happened.
        robot: the arm; by default the run's own.
        task: the toolpath; by default the run's own.
        tolerance: how near [m] the tool has to come to a point of the drawing for it to count as passed.
        window: from when to when [s] peaks and RMS are, by default all of the time until the last path is finished.

    Raises:
        InputError: something is left out that the run does not know.
    """
    task, arm = known_toolpath(run, task), run.robot if robot is None else robot
    own, counted = samples_of(run, "all"), samples_of(run, window)
    on_cuts = np.array([not contour.rapid for contour in task.contours])[run.array("path_index")]
    cutting = np.where(on_cuts, 1.0, np.nan)
    signals = {
        "tool_deviation": tool_deviation(run, arm, task.frame, task.contours),
        "e_p": run.norm("e_p"),
        "e_v": run.norm("e_v"),
    }
    values = {f"{name}_peak": counted.reduced(_largest, v * cutting) for name, v in signals.items()}
    values |= {f"{name}_rms": counted.reduced(_rms, v * cutting) for name, v in signals.items()}
    if "path_finish_time" in run:  # not of a part of a run
        values |= _of_drawing(run, task, arm, tolerance)
    values |= _of_tool(run, task, arm, counted, cutting)
    values["smoothing_deviation"] = np.full(run.rollouts, task.deviation)
    values["tau_demand_peak"] = own.reduced(np.max, np.abs(run.array("tau_demand")))
    values |= limit_ratios(run if robot is None else run.with_robot(arm), own)
    values |= {"progress": progress(run, task), "path_time": run.finish_time}
    return {name: value.tolist() for name, value in values.items()}


def _of_drawing(run: Run, task: ToolpathTask, robot: RobotModel, tolerance: float) -> dict[str, Array]:
    """How much of the drawing was passed in which time, (rollout,) each."""
    stop, found = own_samples(run), []
    for i in range(run.rollouts):
        every = contour_numbers(run.rollout(i), task, robot, tolerance, int(stop[i]))
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


def _of_tool(run: Run, task: ToolpathTask, robot: RobotModel, counted: Samples, cutting: Array) -> dict[str, Array]:
    """Speed and orientation of the tool over the cuts, (rollout,) each."""
    speed = tool_speed(run, robot, task) * cutting
    values = {"tool_speed_mean": counted.reduced(_mean, speed), "tool_speed_peak": counted.reduced(_largest, speed)}
    if task.rotations:
        error = orientation_error(run, task, robot) * cutting
        values["orientation_error_peak"] = counted.reduced(_largest, error)
    return values


def _largest(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan


def _mean(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else np.nan


def _rms(values: Array) -> float:
    return float(np.sqrt(_mean(values**2)))


def _tool(task: PathTask) -> tuple[str, Array]:
    """The frame that a path was made for, and the tip of the tool in it, homogeneous (4,)."""
    if task.frame is None:
        raise InputError(f"the {type(task).__name__} of the run was not made for a frame of the arm; give frame=…")
    return task.frame, (np.eye(4) if task.tool_pose is None else task.tool_pose)[:, 3]
