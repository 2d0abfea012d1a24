"""The tool of a run compared with its path: speed, position and orientation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pathcontrol._arrays import Array
from pathcontrol.analysis.coverage import Points, even_points, traverse
from pathcontrol.analysis.metric_helpers import apply_where_finite
from pathcontrol.cartesian.tool import Tool, ToolKinematics
from pathcontrol.errors import InputError
from pathcontrol.geometry.closest_point import ClosestPoint, Curve
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run
from pathcontrol.tasks.task import PathTask


class ToolSignals(NamedTuple):
    """The signals of a tool over time, (rollout, time) each; NaN where unknown or not counted.

    Attributes:
        speed: ‖J(q)q̇‖ [m/s].
        feed: ‖J(q_d)q_d'‖ϑ [m/s], the speed that the path commands at s.
        orientation: angle between the tool and itself at q_d(s) [rad], as far as the path prescribes it.
        position: position of the tool [m], (rollout, time, 3).
    """

    speed: Array
    feed: Array
    orientation: Array
    position: Array


class PlannedToolCurve:
    """The curve [m] on which a path leads the tool of an arm, as q = q_d(s).

    For a Cartesian path it is the path within its tolerance. It consists of cubics
    between at least a thousand points. For a circle that is exact to 1e-11 of its radius.

    Raises:
        TaskError: the path goes on for ever without repeating.
    """

    name, rapid = "", False

    def __init__(self, task: PathTask, tool: Tool) -> None:
        from scipy.interpolate import CubicHermiteSpline  # takes a tenth of a second to load

        s = traverse(task)
        there = tool.kinematics(task.q_d(s))
        self.points: Points = even_points(there.position)
        slope, beyond = _velocity(there, task.dq_d(s)), "periodic" if task.closed else None
        curve = CubicHermiteSpline(s, there.position, slope, extrapolate=beyond)
        self._curve = curve
        self._closest = ClosestPoint(Curve(curve, curve.derivative(), curve.derivative(2)), s[0], s[-1], task.closed)

    @property
    def length(self) -> float:
        """The length [m]."""
        return float(self.points.length.sum())

    def distance(self, x: Array) -> Array:
        """Return the distance of points x (N, 3) from it [m], (N,)."""
        return np.linalg.norm(self._curve(self._closest(x)) - x, axis=-1)


def find_tool(robot: RobotModel, task: PathTask) -> Tool | None:
    """Return the tool of an arm that a path was made for; None if there is none, or the arm has no such frame."""
    if task.frame is None or task.frame not in robot.frame_names or task.n != robot.n:
        return None
    return Tool(robot, task.frame, task.tool_pose)


def tool_speed(run: Run, robot: RobotModel, task: PathTask) -> Array:
    """Return ‖J(q)q̇‖ [m/s], (rollout, time): the speed of the tool that a path was made for."""
    tool = require_tool(robot, task)

    def speed(q: Array, qd: Array) -> Array:
        return np.linalg.norm(_velocity(tool.kinematics(q), qd), axis=-1)

    return apply_where_finite(speed, run.array("q"), run.array("qd"))


def tool_motion(run: Run, robot: RobotModel, task: PathTask) -> tuple[Array, Array]:
    """Return the position [m], (rollout, time, 3), of the tool that a path was made for, and its :func:`tool_speed`."""
    tool = require_tool(robot, task)

    def motion(q: Array, qd: Array) -> Array:
        there = tool.kinematics(q)
        return np.concatenate([there.position, np.linalg.norm(_velocity(there, qd), axis=-1)[..., None]], axis=-1)

    found = apply_where_finite(motion, run.array("q"), run.array("qd"), shape=(4,))
    return found[..., :3], found[..., 3]


def feed_along(task: PathTask, robot: RobotModel, s: Array) -> Array:
    """Return the speed [m/s], (*batch,), at which the plan leads the tool at s: the feed, or less where limited."""
    there = require_tool(robot, task).kinematics(task.q_d(s))
    return np.linalg.norm(_velocity(there, task.dq_d(s)), axis=-1) * task.theta(s)


def orientation_error(run: Run, task: PathTask, robot: RobotModel) -> Array:
    """Return the angle [rad], (rollout, time), between the tool and itself at q_d(s), see :func:`angle_between`."""
    tool = require_tool(robot, task)

    def angle(s: Array, q: Array) -> Array:
        return angle_between(tool.kinematics(task.q_d(s)).rotation, tool.kinematics(q).rotation, task.rotations)

    return apply_where_finite(angle, run.array("s"), run.array("q"))


def angle_between(wanted: Array, there: Array, rotations: int = 3) -> Array:
    """Return the angle [rad], (*batch,), of R R_dᵀ for rotations R_d and R (*batch, 3, 3); 2: of their z axes."""
    if rotations == 2:
        across = np.linalg.norm(np.cross(wanted[..., 2], there[..., 2]), axis=-1)
        return np.arctan2(across, (wanted[..., 2] * there[..., 2]).sum(-1))
    # ‖R − R_d‖ = 2√2 sin(θ/2), which is exact for small angles too
    chord = np.linalg.norm(there - wanted, axis=(-2, -1)) / np.sqrt(8.0)
    return 2 * np.arcsin(np.minimum(chord, 1.0))


def tool_signals(run: Run, task: PathTask, s: Array, q: Array, qd: Array) -> ToolSignals | None:
    """Return the signals of a run at s (rollout, time), q and q̇ (rollout, time, n), where all are finite.

    The simulated arm of each rollout is compared with the commands of the path to the arm that the law computes with.
    It is None where the path was made for no tool, or the run does not know its arm.
    """
    try:
        robots, plan = run.robots, find_tool(run.model, task)
    except InputError:
        return None
    tools = {id(robot): find_tool(robot, task) for robot in robots}
    if plan is None or None in tools.values():
        return None
    known = np.isfinite(s) & np.isfinite(q).all(-1) & np.isfinite(qd).all(-1)
    found = ToolSignals(*(np.full((*known.shape, *more), np.nan) for more in ((), (), (), (3,))))
    for tool, rows in _by_tool(robots, tools):
        at = known & rows[:, None]
        if at.any():
            for into, values in zip(found, _signals(task, tool, plan, s[at], q[at], qd[at]), strict=True):
                into[at] = values
    return found


def _signals(task: PathTask, tool: Tool, plan: Tool, s: Array, q: Array, qd: Array) -> ToolSignals:
    """Return the signals of one arm at some moments, (N,) each."""
    there, asked = tool.kinematics(q), plan.kinematics(task.q_d(s))
    return ToolSignals(
        np.linalg.norm(_velocity(there, qd), axis=-1),
        np.linalg.norm(_velocity(asked, task.dq_d(s)), axis=-1) * task.theta(s),
        angle_between(asked.rotation, there.rotation, task.rotations),
        there.position,
    )


def _by_tool(robots: list[RobotModel], tools: dict[int, Tool | None]) -> Iterator[tuple[Tool, NDArray[np.bool_]]]:
    """Yield each tool and which rollouts have it, (rollout,)."""
    names = np.array([id(robot) for robot in robots])
    for name, tool in tools.items():
        assert tool is not None
        yield tool, names == name


def require_tool(robot: RobotModel, task: PathTask) -> Tool:
    """Return the tool that a path was made for.

    Raises:
        InputError: the path was made for none.
    """
    if task.frame is None:
        raise InputError(
            f"the {type(task).__name__} was not made for a frame of the arm, so it has no tool",
            argument="task",
            value=task,
        )
    return Tool(robot, task.frame, task.tool_pose)


def _velocity(there: ToolKinematics, qd: Array) -> Array:
    """Return J_v q̇, (*batch, 3)."""
    return (there.jacobian[..., :3, :] @ qd[..., None])[..., 0]
