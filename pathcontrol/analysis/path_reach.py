"""The reach of a path, in the space of the joints and in that of the tool that it was made for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol._json import to_json
from pathcontrol.errors import InputError, TaskError
from pathcontrol.geometry.closest_point.curve import Curve, Interval
from pathcontrol.geometry.reach import least_radius, narrowest_bottleneck
from pathcontrol.robot.model import RobotModel
from pathcontrol.tasks.base import refuse_batch
from pathcontrol.tasks.joined.path_sequence import PathSequence
from pathcontrol.tasks.task import PathTask

Limit = Literal["curvature", "bottleneck", "none"]
_TOOL = "tool of the path"


@dataclass(frozen=True, eq=False)
class Reach:
    """The reach of a path: every point that is nearer to it has one nearest point only.

    Attributes:
        value: the reach [rad or m], inf for a straight path.
        limit: what it is limited by: ``"curvature"``, a ``"bottleneck"`` between two branches, or ``"none"``.
        s: the parameter where that is; of a bottleneck that of its first end.
        other: the parameter of the other end of a bottleneck; ``s`` again for a curvature, NaN without a limit.
        radius: the least radius of curvature [rad or m], inf for a straight path.
        radius_s: its parameter.
        bottleneck: half the width of the narrowest bottleneck that is narrower than the curvature allows, 0 where the
            path crosses itself, and inf without one [rad or m].
        unit: ``"rad"`` in the space of the joints, or ``"m"`` where they slide or for a tool.
        tool: the reach of the path of the tool, where the path was made for one and its arm is known; else ``None``.
    """

    value: float
    limit: Limit
    s: float
    other: float
    radius: float
    radius_s: float
    bottleneck: float
    unit: str
    tool: Reach | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return all values by their names, as JSON takes them: what is not finite is ``None``."""
        names = ("value", "s", "other", "radius", "radius_s", "bottleneck")
        numbers = to_json({name: getattr(self, name) for name in names})
        tool = {} if self.tool is None else {"tool": self.tool.to_dict()}
        return {"limit": self.limit, "unit": self.unit} | numbers | tool


def reach(task: PathTask, robot: RobotModel | None = None, *, frame: str | None = None) -> Reach:
    """Return the reach of a path: the largest distance within which every posture has one nearest point on it.

    It is the smaller of the least radius of curvature and of half the narrowest bottleneck between two branches
    (H. Federer, Curvature measures, Trans. Amer. Math. Soc. 93, 1959), and 0 for a path that crosses itself. Both are
    refined between samples. Within it the projection is unique and smooth: the theorem of :class:`Projection` holds
    from V(0) < ½k_p reach². An open path has bottlenecks at its ends, too.

    Args:
        task: the path; distances between postures are those of its joints.
        robot: the arm, for the path of the tool; by default the one that the path was made for.
        frame: a frame of the arm whose path is looked at in place of the tool's.

    Raises:
        TaskError: the path neither ends nor repeats, or does not move somewhere.
        InputError: it is a batch or a sequence of paths, or a ``frame`` is given without a ``robot``.
        UnknownNameError: the arm has no such frame.
    """
    expect("task", task, PathTask, error=TaskError)
    refuse_batch("task", task)
    if isinstance(task, PathSequence):
        raise InputError(
            "task is a sequence of paths, each with a reach of its own; give one of task.paths",
            argument="task",
            value=task,
        )
    interval = Interval(*task.one_traverse, task.closed)
    tool = _tool_curve(task, _find_robot(task, robot, frame), frame)
    unit = (
        "rad"
        if robot is None or set(robot.position_units) == {"rad"}
        else " or ".join(sorted(set(robot.position_units)))
    )
    other = None if tool is None else _reach_of(tool, interval, task.knots, "m")
    joints = Curve(task.q_d, task.dq_d, task.ddq_d)
    return _reach_of(joints, interval, task.knots, unit, other)


def _reach_of(curve: Curve, interval: Interval, knots: Array | None, unit: str, tool: Reach | None = None) -> Reach:
    """Return the reach of a curve."""
    _check_moving(curve, interval)
    bend, samples = least_radius(curve, interval, knots)
    narrow = narrowest_bottleneck(curve, interval, bend.radius, samples)
    value, limit, s, other = bend.radius, "curvature", bend.s, bend.s
    if narrow.half < bend.radius:
        value, limit, s, other = narrow.half, "bottleneck", narrow.s, narrow.other
    elif not np.isfinite(bend.radius):
        limit, s, other = "none", np.nan, np.nan
    return Reach(value, limit, s, other, bend.radius, bend.s, narrow.half, unit, tool)  # type: ignore[arg-type]


def _check_moving(curve: Curve, interval: Interval) -> None:
    """Check that a curve moves everywhere that it is looked at."""
    s = np.linspace(interval.lower, interval.upper, 257)
    speed = np.linalg.norm(curve.dp(s), axis=-1)
    if not (speed > 1e-9 * speed.max()).all():
        raise TaskError(
            f"the path does not move at s = {s[speed.argmin()]:.4g}, so it has no tangent, and no reach, there",
            s=float(s[speed.argmin()]),
        )


def _find_robot(task: PathTask, robot: RobotModel | None, frame: str | None) -> RobotModel | None:
    """Return the arm of the tool, ``None`` where it is not known or the path was made for no tool."""
    if robot is not None:
        expect("robot", robot, RobotModel)
        if robot.n != task.n:
            raise InputError(
                f"{robot.name} has {robot.n} joints, the task {task.n}; expected as many",
                argument="robot",
                value=robot.n,
                limit=task.n,
            )
    own = getattr(task, "robot", None)
    found = own if robot is None and isinstance(own, RobotModel) else robot
    if frame is not None and found is None:
        raise InputError(f"frame = {frame!r} is of an arm; give robot=load_robot(...)", argument="frame", value=frame)
    known = task.frame is not None and found is not None and task.frame in found.frame_names
    return found if frame is not None or known else None


def _tool_curve(task: PathTask, robot: RobotModel | None, frame: str | None) -> Curve | None:
    """Return the path of the tool [m]; ``None`` where there is none."""
    if robot is None:
        return None
    name, arm = frame if frame is not None else task.frame, robot
    assert name is not None
    if frame is None and task.tool_pose is not None:
        name, arm = _TOOL, robot.with_frame(_TOOL, name, task.tool_pose)

    def motion(s: Array, order: int) -> Array:
        moved = arm.frame_motion(task.q_d(s), task.dq_d(s), task.ddq_d(s), name)
        return moved[order - 1][..., :3]

    return Curve(
        lambda s: arm.frame_pose(task.q_d(s), name)[..., :3, 3], lambda s: motion(s, 1), lambda s: motion(s, 2)
    )
