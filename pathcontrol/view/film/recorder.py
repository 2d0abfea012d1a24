"""A run as a film: the arm, the path its tool should take and the one it took, in one HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array, scalar
from pathcontrol._files import whole_file
from pathcontrol.errors import InputError
from pathcontrol.view.bodies.shapes import Color
from pathcontrol.view.bodies.sticks import stick_figure
from pathcontrol.view.bodies.visuals import leaf_links, link_visuals
from pathcontrol.view.film.camera import Camera, view_direction
from pathcontrol.view.film.stage import Stage
from pathcontrol.view.page.html import page

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run
    from pathcontrol.tasks.base import PathTask

DESIRED: Color = (0.33, 0.62, 0.85, 1.0)
MARKER: Color = (0.0, 0.35, 0.62, 1.0)
TAKEN: Color = (0.84, 0.37, 0.0, 1.0)
LINE_WIDTH = 0.002  # radius of the line the tool has drawn, of the diagonal of the scene …
FINE_LINE_WIDTH = 0.012  # … or of that of the line, if that is less: a small drawing stays legible
THINNEST = 0.0003  # of the diagonal of the scene


@dataclass(frozen=True, eq=False)
class Animation:
    """A recorded scene that moves; made by :func:`record`.

    Attributes:
        title: robot, controller and duration, in words.
        legend: what each colour is.
        commands: the scene as Meshcat's commands.
        camera: where to look from.
        times: times of the frames from the start of the run [s], (frames,).
    """

    title: tuple[str, ...]
    legend: Mapping[str, Color]
    commands: tuple[bytes, ...]
    camera: Camera
    times: Array

    def html(self) -> str:
        """The page: it plays from ``file://``, needs no network, and fetches nothing."""
        return page(self.title, self.legend, self.commands, self.camera)

    def save(self, path: str | Path) -> Path:
        """Write the page, whole or not at all."""
        path = Path(path)
        with whole_file(path) as temporary:
            temporary.write_text(self.html(), encoding="utf-8")
        return path


def record(
    run: Run,
    robot: RobotModel,
    task: PathTask | None = None,
    *,
    rollout: int = 0,
    tool: str | None = None,
    fps: float = 50.0,
) -> Animation:
    """Film one rollout of a run; no server, no browser and no network take part.

    Args:
        run: what happened.
        robot: the arm that it happened to.
        task: the path it should have followed; it is drawn if it is given.
        rollout: which of the rollouts, counted from 0.
        tool: the frame whose path is drawn; by default the last of ``robot.frame_names`` that is a link
            carrying no other, such as ``tool`` or ``tool0``.
        fps: frames a second; between samples of the run the joints move linearly.

    Raises:
        InputError: run, robot and task do not belong together, or there is no such rollout.
        UnknownNameError: the robot has no frame ``tool``.
    """
    one = run.rollout(rollout)
    _check(one, robot, task)
    tool = default_tool(robot) if tool is None else tool
    stage = Stage(one, robot, tool, scalar("fps", fps, positive=True))
    body = stage.add_arm(link_visuals(robot.source) or stick_figure(robot.source))
    taken = stage.tool_path()
    desired = taken[:0] if task is None else stage.desired_path(task)
    seen = np.concatenate([body, taken, desired])
    stage.add_ground(seen)
    legend = _add_lines(stage, task, desired, taken, _line_width(seen, np.concatenate([taken, desired])))
    camera = Camera.framing(seen, view_direction(desired if len(desired) else taken, body))
    return Animation(_title(run, robot, rollout), legend, stage.finish(), camera, stage.times)


def default_tool(robot: RobotModel) -> str:
    """The last of the robot's frames that is a link carrying no other link."""
    leaves = leaf_links(robot.source)
    return [name for name in robot.frame_names if name in leaves][-1]


def _line_width(seen: Array, line: Array) -> float:
    """Radius of the line that the tool draws [m]."""
    scene, drawing = (float(np.linalg.norm(np.ptp(points, axis=0))) for points in (seen, line))
    return max(min(LINE_WIDTH * scene, FINE_LINE_WIDTH * drawing), THINNEST * scene)


def _add_lines(stage: Stage, task: PathTask | None, desired: Array, taken: Array, width: float) -> dict[str, Color]:
    """Draw the lines that have a length, and the desired point; return what each colour is."""
    legend = {}
    if len(desired) > 1:
        stage.add_line("desired path", desired, DESIRED, 2 * width, lining=True)
        legend["desired path"] = DESIRED
    if task is not None:
        stage.add_desired_point(task, MARKER, 4 * width)
        legend["desired point"] = MARKER
    if len(taken) > 1:
        stage.add_line("path taken", taken, TAKEN, width)
        legend["path taken"] = TAKEN
    return legend


def _check(run: Run, robot: RobotModel, task: PathTask | None) -> None:
    joints = tuple(str(name) for name in run.data["joint"].to_numpy())
    if joints != robot.joint_names:
        raise InputError(f"the run is of the joints {joints}, {robot.name} has {robot.joint_names}")
    if task is not None and task.n != robot.n:
        raise InputError(f"the task is for {task.n} joints, {robot.name} has {robot.n}")
    if not np.isfinite(run.array("q")).all():
        raise InputError("the run has joint positions that are not finite")


def _title(run: Run, robot: RobotModel, rollout: int) -> tuple[str, ...]:
    controller = str(run.config.get("controller", {}).get("controller", "unknown controller"))
    words = [robot.name, controller, f"{run.time[-1] - run.time[0]:g} s"]
    return (*words, f"rollout {rollout}") if run.rollouts > 1 else tuple(words)
