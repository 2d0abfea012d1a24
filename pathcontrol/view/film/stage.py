"""One rollout being filmed: the arm, the lines and the moving point, put into a scene one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.view.bodies.shapes import Color, Sphere
from pathcontrol.view.bodies.visuals import LinkVisual
from pathcontrol.view.film.ground import ground_grid
from pathcontrol.view.film.motion import Track, at_times, frame_times
from pathcontrol.view.film.scene import Scene, path
from pathcontrol.view.film.tube import distinct, simplified, tube

if TYPE_CHECKING:
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run
    from pathcontrol.tasks.base import PathTask

GRID: Color = (0.76, 0.79, 0.82, 1.0)

_PATH_SAMPLES = 2001
_TRACE_SAMPLES = 5001
_FRAMED_POSES = 50


class Stage:
    """The scene so far, and what moves in it.

    Attributes:
        times: times of the frames from the start of the rollout [s], (frames,).
        scene: the objects.
        tracks: how those that move do.
    """

    def __init__(self, run: Run, robot: RobotModel, tool: str, fps: float) -> None:
        self.robot, self.tool, self.fps = robot, tool, fps
        self.time = run.time - run.time[0]
        self.q, self.s = run.array("q")[0], run.array("s")[0]
        self.times = frame_times(self.time, fps)
        self.scene, self.tracks = Scene(), dict[str, Track]()

    def tool_path(self) -> Array:
        """Where the tool has been [m], (k, 3), at samples of the run."""
        return distinct(self._tool_positions(self.q[:: -(-len(self.q) // _TRACE_SAMPLES)]))

    def desired_path(self, task: PathTask) -> Array:
        """Where the tool should have been [m], (k, 3): once along the path, or over the run's s."""
        try:
            first, last = task.one_traverse
        except TaskError:
            first, last = self.s.min(), self.s.max()
        return distinct(self._tool_positions(task.q_d(np.linspace(first, last, _PATH_SAMPLES))))

    def add_arm(self, visuals: Sequence[LinkVisual]) -> Array:
        """Put the links on stage; return where the corners of their boxes get to [m], (k, 3), tool first."""
        links = list(dict.fromkeys(visual.link for visual in visuals))
        names = {link: path("arm", i, link) for i, link in enumerate(links)}
        stacked = self.robot.frame_poses(at_times(self.time, self.q, self.times), links)
        poses = {link: stacked[:, i] for i, link in enumerate(links)}
        for i, visual in enumerate(visuals):
            name = path(names[visual.link], i, visual.name)
            self.scene.add(name, visual.shape, visual.color, visual.origin)
        for link in links:
            self._move(names[link], poses[link])
        some = slice(None, None, -(-len(self.times) // _FRAMED_POSES))
        corners = [_moved(poses[visual.link][some], visual.corners) for visual in visuals]
        return np.concatenate([self._tool_positions(self.q[:1]), *corners])

    def add_line(self, name: str, points: Array, color: Color, radius: float, *, lining: bool = False) -> None:
        """Draw a line [m], (k, 3), as a tube."""
        shape = tube(simplified(points, radius / 12), radius)
        self.scene.add(f"lines/{name}", shape, color, lining=lining)

    def add_desired_point(self, task: PathTask, color: Color, radius: float) -> None:
        """Show where the tool should be: at q_d(s(t))."""
        s = np.clip(at_times(self.time, self.s, self.times), task.s0, task.s_end)
        poses = np.tile(np.eye(4), (len(s), 1, 1))
        poses[:, :3, 3] = self._tool_positions(task.q_d(s))
        self.scene.add("desired point/ball", Sphere(radius), color)
        self._move("desired point", poses)

    def add_ground(self, points: Array) -> None:
        """Draw the ground under points [m], (k, 3)."""
        self.scene.add_segments("ground", ground_grid(points), GRID)

    def finish(self) -> tuple[bytes, ...]:
        """The commands of the whole film."""
        if self.tracks:
            self.scene.animate(self.tracks, self.fps)
        return tuple(self.scene.commands)

    def _move(self, name: str, poses: Array) -> None:
        track = Track.from_poses(self.times, poses)
        self.scene.place(name, poses[0])
        if track.moves:
            self.tracks[name] = track

    def _tool_positions(self, q: Array) -> Array:
        return self.robot.frame_pose(q, self.tool)[..., :3, 3]


def _moved(poses: Array, points: Array) -> Array:
    """Points (k, 3) at poses (m, 4, 4): (m k, 3)."""
    return (points @ poses[:, :3, :3].swapaxes(-1, -2) + poses[:, None, :3, 3]).reshape(-1, 3)
