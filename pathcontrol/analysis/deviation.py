"""How far the tool was from the drawing it should follow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.known import known_toolpath, where_known
from pathcontrol.analysis.metrics import peak, rms
from pathcontrol.cartesian.toolpath_task import ToolpathTask
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.toolpaths.contour import Contour


def tool_positions(run: Run, robot: RobotModel | None = None, frame: str | None = None) -> Array:
    """Where the origin of a frame was [m], (rollout, time, 3), in the base frame.

    By default of the run's own robot, and of the frame that follows its toolpath.
    """
    expect("run", run, Run)
    arm = run.robot if robot is None else robot
    expect("robot", arm, RobotModel)
    name = known_toolpath(run, None).frame if frame is None else frame
    return where_known(lambda q: arm.frame_pose(q, name)[..., :3, 3], run.array("q"))


def tool_deviation(
    run: Run, robot: RobotModel | None = None, frame: str | None = None, contours: Sequence[Contour] | None = None
) -> Array:
    """Distance of the tool from the geometry of a drawing [m], (rollout, time).

    The lines, arcs and Bézier curves of the file itself are measured against, not curves that were fitted to them.

    Args:
        run: what happened.
        robot: the arm that it happened to; by default the run's own.
        frame: the tool's frame; by default that of the run's toolpath.
        contours: the contour of each path of the run in the robot's base frame, or one for all; a run of several
            paths is measured at each sample against the contour of the path it was on. By default those of the run's
            toolpath.

    Raises:
        InputError: something is left out that the run does not know.
    """
    contours = known_toolpath(run, None).contours if contours is None else contours
    x = tool_positions(run, robot, frame)
    if len(contours) == 1 or "path_index" not in run.data.coords:
        return np.min([where_known(contour.distance, x) for contour in contours], axis=0)
    which, deviation = run["path_index"].to_numpy(), np.empty(x.shape[:-1])
    for i in np.unique(which):
        deviation[:, which == i] = where_known(contours[i].distance, x[:, which == i])
    return deviation


def toolpath_metrics(run: Run, robot: RobotModel | None = None, task: ToolpathTask | None = None) -> dict[str, Any]:
    """The numbers of a run along its toolpath, or another, each a list with one entry for each rollout.

    Largest and RMS distance of the tool from the drawing over the cuts, ``tool_deviation`` [m]; how far the smooth
    curves are from it, ``smoothing_deviation`` [m]; peaks and RMS of ‖e_p‖ [rad] and ‖e_v‖ [rad/s] over the cuts;
    the largest torque demand [N m]; and the time after which the last path was finished [s], NaN if it was not.
    """
    task = known_toolpath(run, task)
    cutting = np.array([not contour.rapid for contour in task.contours])[run["path_index"].to_numpy()]
    deviation = tool_deviation(run, robot, task.frame, task.contours)[:, cutting]
    signals = {"tool_deviation": deviation, "e_p": run.norm("e_p")[:, cutting], "e_v": run.norm("e_v")[:, cutting]}
    values = {f"{name}_peak": peak(v) for name, v in signals.items()}
    values |= {f"{name}_rms": rms(v) for name, v in signals.items()}
    values["smoothing_deviation"] = np.full(run.rollouts, task.deviation)
    values["tau_demand_peak"] = np.abs(run.array("tau_demand")).max((1, 2))
    values["path_time"] = run.finish_time
    return {name: value.tolist() for name, value in values.items()}
