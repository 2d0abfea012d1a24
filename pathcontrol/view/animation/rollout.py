"""A rollout for an animation, with its arm, path and tool."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.recognition import as_toolpath
from pathcontrol.engine.frame_kinematics import frame_poses
from pathcontrol.errors import InputError
from pathcontrol.tasks.batch.task_batch import TaskBatch
from pathcontrol.view.bodies.body_shapes import Color
from pathcontrol.view.bodies.body_visuals import LinkVisual

if TYPE_CHECKING:
    from pathcontrol.cartesian.toolpath_task import ToolpathTask
    from pathcontrol.robot.model import RobotModel
    from pathcontrol.simulation.run import Run
    from pathcontrol.tasks.task import PathTask

_ABSURD = 1e6  # rad, or m: beyond any arm
_PROBES = 1001  # samples of a path
_AT_ONCE = 20_000  # samples, so that memory for long runs is not needed twice


@dataclass(frozen=True, eq=False)
class Recording:
    """A rollout with its arm, path and tool, and the poses that follow from them.

    Attributes:
        name: what it is called.
        run: the rollout, as a run of its own.
        robot: the arm.
        task: the path it should follow, or None.
        tool: the frame whose path is drawn.
        visuals: what the arm looks like.
        color: the colour that stands for it.
        rollouts: how many rollouts there are of it.
    """

    name: str
    run: Run
    robot: RobotModel
    task: PathTask | None
    tool: str
    visuals: list[LinkVisual]
    color: Color
    rollouts: int = 1

    def __post_init__(self) -> None:
        check_filmed(self.run, self.robot, self.task)

    @cached_property
    def time(self) -> Array:
        """The times of the samples from the start of the film [s], (k,), in single precision, as the film has them."""
        return (self.run.time - self.run.time[0]).astype(np.float32).astype(np.float64)

    @property
    def duration(self) -> float:
        """The duration [s]."""
        return float(self.run.time[-1] - self.run.time[0])

    @property
    def q(self) -> Array:
        """The joint positions [rad], (k, n)."""
        return self.run.array("q")[0]

    @cached_property
    def s(self) -> Array:
        """The path parameter within the path, (k,)."""
        s = self.run.array("s")[0]
        return s if self.task is None else np.clip(s, *self._domain(self.task))

    @property
    def toolpath(self) -> ToolpathTask | None:
        """The task if it is a drawing that the tool follows, contour by contour."""
        return as_toolpath(self.task) if "path_index" in self.run else None

    @cached_property
    def poses(self) -> dict[str, Array]:
        """The poses of the visible links, and of the tool, at all samples [m], (k, 4, 4) each."""
        frames = list(dict.fromkeys([*(visual.link for visual in self.visuals), self.tool]))
        parts = np.array_split(self.q, -(-len(self.q) // _AT_ONCE))
        stacked = np.concatenate([frame_poses(self.robot, part, frames) for part in parts])
        return {frame: stacked[:, i] for i, frame in enumerate(frames)}

    @property
    def tool_positions(self) -> Array:
        """The positions of the tool [m], (k, 3)."""
        return self.poses[self.tool][:, :3, 3]

    @cached_property
    def desired_positions(self) -> Array | None:
        """The desired positions of the tool, at q_d(s(t)) [m], (k, 3); None without a path."""
        return None if self.task is None else self.tool_at(self.task.q_d(self.s))

    def tool_at(self, q: Array) -> Array:
        """Return positions of the tool [m], (k, 3), at joint positions (k, n)."""
        return frame_poses(self.robot, q, [self.tool])[..., 0, :3, 3]

    @staticmethod
    def _domain(task: PathTask) -> tuple[float, float]:
        """Return the interval of s that is drawn."""
        return (-np.inf, np.inf) if task.closed else (task.s0, task.s_end)


def check_filmed(run: Run, robot: RobotModel, task: PathTask | None) -> None:
    """Check that run, robot and task belong together, and that the run can be shown.

    Raises:
        InputError: they do not, or the times or the joint positions of the run make no film.
    """
    joints = tuple(run.joints)
    if joints != robot.joint_names:
        raise InputError(
            f"the run is of the joints {joints}, {robot.name} has {robot.joint_names}",
            argument="robot",
            value=list(robot.joint_names),
        )
    if task is not None and task.n != robot.n:
        raise InputError(
            f"the task is for {task.n} joints, {robot.name} has {robot.n}", argument="task", value=task.n, limit=robot.n
        )
    if task is not None and not isinstance(task, TaskBatch):
        _check_path(run, task)
    if not len(run.time):
        raise InputError("the run has no samples")
    if not (np.isfinite(run.time).all() and (np.diff(run.time) > 0).all()):
        raise InputError("the times of the run do not increase")
    if not (np.abs(run.array("q")) <= _ABSURD).all():
        first = run.time[int(np.argmax(~(np.abs(run.array("q")) <= _ABSURD).all((0, 2))))]
        raise InputError(
            f"the run has joint positions that are not finite, or beyond {_ABSURD:g} rad, at {first:.4g} s; to show "
            "what was before, cut the data: run.with_data(run.data.sel(time=slice(0, …)))",
            limit=_ABSURD,
            time=float(first),
        )


def _check_path(run: Run, task: PathTask) -> None:
    """Check that the path is where an arm could be, at the parameters of the run and from its begin to its end."""
    s = run.array("s").ravel() if "s" in run else np.empty(0)
    s = np.concatenate([s, np.linspace(*task.sampled_interval, _PROBES)])
    s = s if task.closed else np.clip(s, task.s0, task.s_end)
    near = (np.abs(task.q_d(s)) <= _ABSURD).all(-1)  # a parameter that is no number has no place either
    if not near.all():
        raise InputError(
            f"the path of the run has joint positions that are not finite, or beyond {_ABSURD:g} rad, at "
            f"s = {s[np.argmin(near)]:.4g}; it cannot be shown",
            limit=_ABSURD,
            s=float(s[np.argmin(near)]),
        )
