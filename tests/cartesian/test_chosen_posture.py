"""Of the postures found the preferred is above the base plane, elbow up; the path says so, and sequences join."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.continuation import Stop, Trail
from pathcontrol.cartesian.ik.preference import sort_by_preference
from pathcontrol.cartesian.orientation import FreeOrientation
from pathcontrol.cartesian.tool import Tool
from pathcontrol.toolpaths.gcode.strokes import ContourBuilder

FRAMES = {"ur5": "tool0", "ur10": "tool0", "panda": "panda_hand_tcp", "cicese_2dof": "tool"}
REACH = {"ur5": 0.85, "ur10": 1.25, "panda": 0.85}
DOWN = np.diag([1.0, -1.0, -1.0])
HELD = [None, pc.NormalOrientation([0.0, 0.0, 1.0]), pc.FixedOrientation(DOWN)]


@cache
def load(name: str) -> pc.RobotModel:
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return pc.load_robot(name, lock=fingers if name == "panda" else None)


def workpiece(name: str, rng: np.random.Generator) -> pc.ToolCurve:
    """A circle in front of the arm."""
    if name == "cicese_2dof":
        return pc.ToolCurve.circle([rng.uniform(-0.4, 0.4), -0.05, rng.uniform(0.7, 1.6)], 0.05, [0.0, 1.0, 0.0])
    angle, distance = rng.uniform(-1, 1), REACH[name] * rng.uniform(0.4, 0.75)
    center = [distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.02, 0.35)]
    return pc.ToolCurve.circle(center, rng.uniform(0.03, 0.1))


@pytest.mark.parametrize("name", FRAMES)
def test_workpieces_in_front_of_the_arm_are_reached_from_above_the_base_plane(name):
    robot, rng = load(name), np.random.default_rng(7)
    for i in range(3):
        curve = workpiece(name, rng)
        path = pc.CartesianPath(robot, FRAMES[name], curve, None if name == "cicese_2dof" else HELD[i], speed=0.1)
        height = robot.frame_poses(path.q_d(np.linspace(path.s0, curve.s_end, 201)), robot.joint_names)[..., 2, 3]
        assert height.min() > -2e-3
        assert path.report.lowest_height == pytest.approx(height.min(), abs=5e-3)
        assert path.posture == path.report.posture
        assert "all joints above the base plane" in path.posture
        assert path.posture in repr(path)
        assert path.describe()["posture"] == path.posture
        assert path.report.smallest_singular_value > 0.05


def test_what_is_below_is_said_with_its_joint_and_depth():
    robot = load("ur5")
    start = [0.0, 1.0, -1.4, -1.2, -1.57, 0.0]  # elbow down
    pose = robot.frame_pose(np.array(start), "tool0")
    curve = pc.ToolCurve.line(pose[:3, 3], pose[:3, 3] + [0.02, 0.02, 0.0])
    path = pc.CartesianPath(robot, "tool0", curve, pc.FixedOrientation(pose[:3, :3]), speed=0.1, start=start)
    height = robot.frame_poses(path.q_d(np.linspace(path.s0, path.s_end, 201)), robot.joint_names)[..., 2, 3]
    assert path.report.lowest_joint == robot.joint_names[int(np.argmin(height.min(0)))]
    assert path.posture.startswith("from the start given")
    assert f"down to {-path.report.lowest_height:.3g} m below the base plane" in path.posture


def test_trails_are_preferred_above_then_comfortable_then_elbow_up():
    """Of the bundled arm joint 2 is 0.45 cos q_1 below the shoulder at 1.2 m; trails of one posture each."""
    robot = load("cicese_2dof")
    curve = pc.ToolCurve.line([0.4, -0.05, 0.9], [0.5, -0.05, 0.9])
    constraint = ToolConstraint.of(Tool(robot, "tool"), curve, FreeOrientation(), (1e-5, 1e-4))

    def trail(q_1: float, comfort: float) -> Trail:
        return Trail([0.0], [np.array([q_1, 0.3])], comfort, Stop.NONE)

    up, down, uncomfortable, poor = trail(2.5, 0.5), trail(0.5, 0.9), trail(3.0, 0.4), trail(2.9, 0.1)
    ranked = sort_by_preference(constraint, [poor, down, uncomfortable, up])
    assert [id(one) for one in ranked] == [id(one) for one in (up, down, uncomfortable, poor)]
    for sign in (1, -1):  # the mirrored arm is as high: nothing else counts
        assert sort_by_preference(constraint, [down, trail(sign * 2.5, 0.6)])[0].q[0][0] == sign * 2.5


def square(x: float, y: float) -> pc.Contour:
    builder = ContourBuilder([x, y, 0.0])
    for dx, dy in ((0.05, 0.0), (0.05, 0.05), (0.0, 0.05)):
        builder.line_to([x + dx, y + dy, 0.0])
    builder.close()
    return builder.contour(feed=0.05)


def test_the_contours_of_a_toolpath_are_followed_on_one_branch():
    robot, pose = load("ur5"), np.eye(4)
    pose[:3, 3] = [0.45, -0.1, 0.1]
    task = pc.ToolpathTask(robot, "tool0", pc.Toolpath((square(0, 0), square(0.1, 0.1))), pose, orientation="down")
    q = np.concatenate([path.q_d(np.linspace(path.s0, path.s_end, 101)) for path in task.paths])
    assert len(np.unique(np.sign(q[:, 2]))) == 1  # elbow
    assert len(np.unique(np.sign(np.sin(q[:, 4])))) == 1  # wrist
    assert np.abs(np.diff(q, axis=0)).max() < 0.1
    assert robot.frame_poses(q, robot.joint_names)[..., 2, 3].min() > -2e-3
    assert "all joints above the base plane" in task.posture
    assert task.describe()["posture"] == task.posture


def test_paths_that_do_not_join_are_refused_with_numbers():
    robot = load("cicese_2dof")
    paths = [pc.Line([0.0, 0.0], [0.4, 0.2], 0.5), pc.Line([0.4, 1.7], [0.0, 0.0], 0.5)]
    laws = [pc.ExtendedMotionPlan(robot, path, 800.0, 45.0, 5.0) for path in paths]
    message = r"path 1 begins 1\.5 rad away from the end of path 0, at joint 2: at 1\.7 after 0\.2"
    with pytest.raises(pc.InputError, match=message):
        pc.PathSequence(paths)
    with pytest.raises(pc.InputError, match=message):
        pc.simulate_sequence(laws, [0.0, 0.0], duration=0.1, progress=False)
    run = pc.simulate_sequence(laws, [0.0, 0.0], duration=0.1, gaps=True, progress=False)
    assert run.status[0] == "running"
    ring = pc.ExtendedMotionPlan(robot, pc.Circle(0.3, 1.0), 800.0, 45.0, 5.0)  # closed, from (0.3, 0)
    with pytest.raises(pc.InputError, match="path 1 begins"):
        pc.simulate_sequence([laws[0], ring], [0.0, 0.0], duration=0.1, progress=False)
