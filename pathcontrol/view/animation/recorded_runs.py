"""The choice of arm, path and tool for the runs that are animated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._expect import expect
from pathcontrol.errors import InputError
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.config import table
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.batch.task_batch import select_rows
from pathcontrol.tasks.task import PathTask
from pathcontrol.view.animation.rollout import Recording
from pathcontrol.view.animation.scene.palette import run_color
from pathcontrol.view.bodies.body_visuals import LinkVisual, link_visuals
from pathcontrol.view.bodies.sticks import stick_figure
from pathcontrol.view.bodies.tool_rods import tool_rods
from pathcontrol.view.default_tool import with_tool

if TYPE_CHECKING:
    from pathcontrol.robot.arm_dynamics import UrdfSource

FINENESS = 1.5e-4  # share of the arm's reach, a small part of a pixel where the picture shows all of it


def make_recordings(
    run: Run | Mapping[str, Run],
    robot: RobotModel | None,
    task: PathTask | None,
    rollout: int,
    tool: str | None,
) -> list[Recording]:
    """Return one rollout of each run, with the given robot, task and tool, or else its own.

    Raises:
        InputError: there is no run, or run, robot and task do not belong together.
    """
    runs = {controller_name(run): run} if isinstance(run, Run) else run
    if not isinstance(runs, Mapping) or not runs or not all(isinstance(one, Run) for one in runs.values()):
        if not isinstance(run, Mapping):
            expect("run", run, Run)
        raise InputError(
            f"run = {runs!r}, expected a Run, or several by name: {{'name': run, …}}", argument="run", value=runs
        )
    if robot is not None:
        expect("robot", robot, RobotModel)
    if task is not None:
        expect("task", task, PathTask)
    looks: dict[UrdfSource, list[LinkVisual]] = {}
    recordings = []
    for i, (name, one) in enumerate(runs.items()):
        part = one.rollout(rollout)
        arm = part.robot if robot is None else robot
        path = part.task if task is None else select_rows(task, np.array([rollout]))
        if arm.source not in looks:
            looks[arm.source] = link_visuals(arm.source, FINENESS) or stick_figure(arm.source)
        path = path if "s" in one else None  # the desired position on it is unknown
        arm, frame = with_tool(arm, path, tool)
        part, visuals = _cut_at_divergence(part), [*looks[arm.source], *tool_rods(arm)]
        recordings.append(Recording(str(name), part, arm, path, frame, visuals, run_color(i), one.rollouts))
    return recordings


def _cut_at_divergence(run: Run) -> Run:
    """Return all of a rollout up to its divergence."""
    known = np.isfinite(run.array("q")).all((0, 2))
    return run.with_data(run.data.isel(time=known)) if run.status[0] == "diverged" and known.any() else run


def controller_name(run: Run) -> str:
    """Return the name of a run that has no other name: its controller."""
    return str(table(run.config, "controller").get("controller", "unknown controller"))


def film_title(recordings: Sequence[Recording], rollout: int) -> list[str]:
    """Return robots, controllers or the names of the runs, and the duration, in words."""
    robots = ", ".join(dict.fromkeys(recording.robot.name for recording in recordings))
    words = [
        robots,
        ", ".join(recording.name for recording in recordings),
        f"{max(recording.duration for recording in recordings):.4g} s",
    ]
    return [*words, f"rollout {rollout}"] if any(recording.rollouts > 1 for recording in recordings) else words
