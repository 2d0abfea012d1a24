"""The tasks of software in the loop: the paper's experiment, a contour of the tool, or an experiment file."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.cartesian_path import CartesianPath
from pathcontrol.comparison.paper import START_DEG, paper_controllers
from pathcontrol.control.base import Controller
from pathcontrol.control.projection import Projection
from pathcontrol.errors import InputError
from pathcontrol.experiments.runner import load_setup
from pathcontrol.hardware.envelope import Envelope
from pathcontrol.robot.extent import extent
from pathcontrol.robot.loading import load_robot
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.toolpaths.tool_curve import ToolCurve
from pathcontrol.view.default_tool import default_tool

_GAIN, _DAMPING = 400.0, 40.0  # 1/s², 1/s
_PLACE = np.array([0.48, 0.0, 0.37])  # of the reach, of the middle of the contour
_RADIUS, _FEED = 0.1, 0.15  # of the reach, and per second
_FAST = 30.0  # rad/s, of arms whose URDF has no limit of velocity


class SilTask(NamedTuple):
    """The law, arm and start of a session of software in the loop.

    Attributes:
        law: the law with its task.
        plant: the arm with its friction.
        q: where it starts [rad], (n,).
        period: control period [s].
        envelope: that of the loop.
    """

    law: Controller
    plant: RobotModel
    q: Array
    period: float
    envelope: Envelope


def make_sil_task(robot: str | None, task: str | None) -> SilTask:
    """Return what is driven, by a robot and a task: ``"paper"``, ``"contour"``, or the name of an experiment file.

    Without a task the bundled arm of two joints does the paper's, any other arm a contour.

    Raises:
        InputError: the task needs another arm, or there is no such file.
        ExperimentError: the file is invalid.
    """
    if task is not None and task not in ("paper", "contour"):
        return _read_task(robot, task)
    arm = load_robot("cicese_2dof" if robot is None else robot)
    named = task or ("paper" if arm.n == 2 else "contour")
    return _make_paper(arm) if named == "paper" else _make_contour(arm)


def _make_paper(arm: RobotModel) -> SilTask:
    """Return the first experiment of the paper at 1 kHz."""
    if arm.n != 2:
        raise InputError(
            f"task = 'paper' is for an arm of two joints, {arm.name} has {arm.n}; give contour",
            argument="task",
            value="paper",
        )
    law = paper_controllers(arm)["extended_motion_plan"]
    return SilTask(law, arm, np.deg2rad(START_DEG), 1e-3, _make_envelope(arm, tube=np.inf))


def _make_contour(arm: RobotModel) -> SilTask:
    """Return a circle of the tool in front of the arm."""
    frame = default_tool(arm)
    reach = extent(arm, frame).reach
    circle = ToolCurve.circle((_PLACE * reach).tolist(), _RADIUS * reach, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    path = CartesianPath(arm, frame, circle, speed=_FEED * reach)
    law = Projection(arm, path, _GAIN, _DAMPING)
    return SilTask(law, arm, np.asarray(path.q_d(np.array(path.s0))).reshape(arm.n), 1e-3, _make_envelope(arm))


def _read_task(robot: str | None, task: str) -> SilTask:
    """Return the law, arm, start and period of an experiment file."""
    if robot is not None:
        raise InputError(
            "the experiment file names its robot; leave robot out, or give task = 'paper' or 'contour'",
            argument="robot",
            value=robot,
        )
    if not Path(task).is_file():
        raise InputError(
            f"task = {task!r}, expected 'paper', 'contour' or an experiment file", argument="task", value=task
        )
    setup = load_setup(task)
    if len(setup.controllers) > 1:
        raise InputError(f"{task!r} is a sequence of paths, expected one path", argument="task", value=task)
    period = setup.loop.period if isinstance(setup.loop, SampledLoop) else 1e-3
    return SilTask(setup.controller, setup.plant, setup.q, period, _make_envelope(setup.controller.robot, tube=np.inf))


def _make_envelope(arm: RobotModel, tube: float = 0.5) -> Envelope:
    """Return an envelope that bears a busy computer, with a limit of velocity also where the URDF has none."""
    known = np.isfinite(arm.limits.velocity) & (arm.limits.velocity > 0)
    velocity = np.where(known & (arm.limits.velocity < 1e3), arm.limits.velocity, _FAST)
    closed = arm.limits.lower < arm.limits.upper
    lower, upper = np.where(closed, arm.limits.lower, -np.inf), np.where(closed, arm.limits.upper, np.inf)
    return Envelope(velocity=velocity, lower=lower, upper=upper, patience=20, lost=50.0, tube=tube)
