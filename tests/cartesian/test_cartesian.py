"""Paths of the joints along curves in space: on the curve, smooth, closed, within limits, on arms of 2 to 7 joints."""

from __future__ import annotations

import json
import pickle
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pathcontrol import ExtendedMotionPlan, Projection, RobotModel, check_task, load_robot, simulate
from pathcontrol.cartesian.cartesian_path import CartesianPath
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.correction import correct
from pathcontrol.cartesian.ik.redundancy import PostureCost
from pathcontrol.cartesian.orientation import FixedOrientation, FreeOrientation, NormalOrientation, TangentOrientation
from pathcontrol.cartesian.tool import Tool
from pathcontrol.toolpaths.tool_curve import ToolCurve

DOWN = np.diag([1.0, -1.0, -1.0])
UP = np.array([0.0, 0.0, 1.0])
HOME = {"ur5": [0.0, -1.2, 1.8, -2.2, -1.57, 0.0], "panda": [0.0, -0.3, 0.0, -2.0, 0.0, 1.8, 0.7]}
FRAMES = {"cicese_2dof": "tool", "ur5": "tool0", "panda": "panda_hand_tcp"}
HELD = {
    "position": None,
    "normal": NormalOrientation(UP),
    "orientation": FixedOrientation(DOWN),
    "tangent": TangentOrientation(-UP),
}
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=3)
fewer = settings(max_examples=2)  # of tests that solve several paths for each


@cache
def load(name: str) -> RobotModel:
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return load_robot(name, lock=fingers if name == "panda" else None)


def into_plane(points: np.ndarray) -> np.ndarray:
    """Points about (0.5, 0, 0.3), where the six- and seven-joint arms work, moved to where the 2-joint arm does."""
    return np.stack([points[..., 0] - 0.05, 0 * points[..., 0] - 0.05, 0.9 + points[..., 1]], axis=-1)


def random_curve(kind: str, seed: int, plane: bool) -> ToolCurve:
    rng = np.random.default_rng(seed)
    center = np.array([0.5, 0.0, 0.3]) + rng.uniform(-0.05, 0.05, 3)
    if kind == "line":
        reach = rng.normal(size=3)
        ends = center + 0.12 * np.outer([-1, 1], reach / np.linalg.norm(reach))
        return ToolCurve.line(*(into_plane(ends) if plane else ends))
    if kind == "circle":
        normal = np.array([0.0, 1.0, 0.0]) if plane else rng.normal(size=3) + 3 * UP
        return ToolCurve.circle(into_plane(center) if plane else center, rng.uniform(0.03, 0.1), normal)
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    round_about = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    points = center + 0.1 * round_about + 0.015 * rng.normal(size=(8, 3))
    return ToolCurve.spline(into_plane(points) if plane else points, closed=True)


def pose(robot: RobotModel, frame: str, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and rotation by Pinocchio's forward kinematics of joints, not the calls the library makes."""
    model = robot.pinocchio_model
    data, placement = model.createData(), model.frames[robot.frame_id(frame)]
    poses = []
    for qi in q:
        pin.forwardKinematics(model, data, qi)
        poses.append((data.oMi[placement.parentJoint] * placement.placement).homogeneous)
    return np.array(poses)[:, :3, 3], np.array(poses)[:, :3, :3]


def places(path: CartesianPath, count: int = 400, seed: int = 0) -> np.ndarray:
    return np.sort(np.random.default_rng(seed).uniform(*path.one_traverse, count))


CASES = [
    ("cicese_2dof", "position"),
    ("ur5", "position"),
    ("ur5", "normal"),
    ("ur5", "orientation"),
    ("ur5", "tangent"),
    ("panda", "position"),
    ("panda", "normal"),
    ("panda", "orientation"),
]


@pytest.mark.parametrize(("name", "held"), CASES)
@few
@given(seed=seeds, kind=st.sampled_from(["line", "circle", "spline"]))
def test_the_tool_is_on_the_curve_and_turned_as_asked(name, held, seed, kind):
    robot, curve = load(name), random_curve(kind, seed, name == "cicese_2dof")
    path = CartesianPath(
        robot, FRAMES[name], curve, HELD[held], speed=0.05, closed=False if held == "tangent" else None
    )
    check_task(path, robot.n)
    s = places(path)
    q = path.q_d(s)
    position, rotation = pose(robot, FRAMES[name], q)
    deviation = np.linalg.norm(position - curve.position(s), axis=-1)
    assert deviation.max() <= path.tolerance
    assert deviation.max() <= 1.5 * path.report.position_deviation + 1e-12
    assert (robot.limits.lower <= q).all()
    assert (q <= robot.limits.upper).all()
    z, x = rotation[..., 2], rotation[..., 0]
    if held in ("normal", "orientation"):
        assert np.linalg.norm(np.cross(z, -UP), axis=-1).max() <= 1e-4
        assert (z @ -UP > 0).all()
    if held == "orientation":
        assert Rotation.from_matrix(rotation @ DOWN.T).magnitude().max() <= 1e-4
    if held == "tangent":
        along = curve.at(s).dp / np.linalg.norm(curve.at(s).dp, axis=-1, keepdims=True)
        assert np.linalg.norm(np.cross(x, along), axis=-1).max() <= 1e-4
        assert (z @ -UP > 0).all()


@pytest.mark.parametrize(("name", "held"), [("cicese_2dof", "position"), ("ur5", "normal"), ("panda", "orientation")])
@few
@given(seed=seeds, speed=st.floats(0.01, 0.5))
def test_the_path_is_smooth_and_closes_and_the_tool_moves_at_the_feed(name, held, seed, speed):
    robot, curve = load(name), random_curve("spline", seed, name == "cicese_2dof")
    path = CartesianPath(robot, FRAMES[name], curve, HELD[held], speed=speed, start=HOME.get(name))
    assert path.closed
    assert path.period == pytest.approx(curve.length)
    assert_twice_continuously_differentiable(path)
    s, h = places(path, 50), 1e-6
    point = path.at(s)
    assert np.allclose(point.velocity, path.dq_d(s) * path.theta(s)[:, None])
    # by differences of the pose along the joint velocity
    moved = [pose(robot, FRAMES[name], point.q_d + sign * h * point.velocity)[0] for sign in (1, -1)]
    feed = np.linalg.norm(moved[0] - moved[1], axis=-1) / (2 * h)
    assert np.allclose(feed, speed, rtol=1e-3)
    assert np.allclose(path.dtheta(s), (path.theta(s + h) - path.theta(s - h)) / (2 * h), rtol=1e-3, atol=1e-4 * speed)


def assert_twice_continuously_differentiable(path: CartesianPath) -> None:
    """At the knots, of which the first and the last are the seam of a closed path."""
    knots, h = path.knots, 1e-9
    for f in (path.q_d, path.dq_d, path.ddq_d):
        scale = np.abs(f(places(path))).max()
        assert np.abs(f(knots + h) - f(knots - h)).max() < 1e-5 * scale
    assert np.allclose(path.q_d(path.s0 + path.period - 1e-12), path.q_d(np.array(path.s0)), atol=1e-9)


@pytest.mark.parametrize("name", ["ur5", "panda"])
@fewer
@given(seed=seeds, turn=st.floats(-0.8, 0.8))
def test_a_curve_turned_about_the_first_axis_turns_the_first_joint(name, seed, turn):
    """The base's axis is vertical: q_1 grows by the angle, all other joints do the same."""
    robot, frame, curve = load(name), FRAMES[name], random_curve("spline", seed, False)
    about = Rotation.from_rotvec(turn * UP).as_matrix()
    parts = curve.at(curve.knots)
    turned = ToolCurve(curve.knots, *(part @ about.T for part in parts), closed=True)
    path = CartesianPath(robot, frame, curve, NormalOrientation(UP), speed=0.1, start=HOME[name])
    start = HOME[name] + turn * np.eye(robot.n)[0]
    other = CartesianPath(robot, frame, turned, NormalOrientation(UP), speed=0.1, start=start)
    s = places(path, 50)
    difference = other.q_d(s) - path.q_d(s)
    assert np.abs(difference - turn * np.eye(robot.n)[0]).max() < 1e-6


@fewer
@given(seed=seeds)
def test_a_tool_is_an_offset_of_the_frame(seed):
    """With a fixed orientation R a tip at t follows p where the frame follows p − R t."""
    robot, curve, tip = load("ur5"), random_curve("spline", seed, False), np.array([0.02, -0.01, 0.1])
    points = curve.at(curve.knots)
    moved = ToolCurve(curve.knots, points.p - DOWN @ tip, points.dp, points.ddp, closed=True)
    bare = CartesianPath(robot, "tool0", moved, FixedOrientation(DOWN), speed=0.1, start=HOME["ur5"])
    start = bare.start_posture
    for tool in (tip, np.vstack([np.column_stack([np.eye(3), tip]), [0, 0, 0, 1]])):
        carried = CartesianPath(robot, "tool0", curve, FixedOrientation(DOWN), speed=0.1, tool=tool, start=start)
        assert np.abs(carried.q_d(places(bare)) - bare.q_d(places(bare))).max() < 1e-5


def test_the_start_posture_is_kept_and_so_is_its_orientation():
    robot, q = load("panda"), np.array(HOME["panda"])
    position, rotation = pose(robot, "panda_hand_tcp", q[None])
    curve = ToolCurve.line(position[0], position[0] + [0.0, 0.2, -0.2])
    path = CartesianPath(robot, "panda_hand_tcp", curve, "keep", speed=0.1, start=q)
    assert np.abs(path.start_posture - q).max() < 1e-9
    kept = pose(robot, "panda_hand_tcp", path.q_d(places(path)))[1] @ rotation[0].T
    assert Rotation.from_matrix(kept).magnitude().max() < 1e-4
    near = CartesianPath(robot, "panda_hand_tcp", curve, speed=0.1, start=q + 0.05)
    assert np.abs(near.start_posture - q - 0.05).max() < 0.1
    assert np.linalg.norm(pose(robot, "panda_hand_tcp", near.start_posture[None])[0] - position) < 1e-5


def test_a_path_can_be_sent_elsewhere_and_says_what_it_is():
    curve = ToolCurve.circle([0.5, 0.0, 0.3], 0.05)
    path = CartesianPath(load("ur5"), "tool0", curve, HELD["normal"], speed=0.1, start=HOME["ur5"])
    copy, s = pickle.loads(pickle.dumps(path)), places(path, 20)
    assert np.array_equal(copy.q_d(s), path.q_d(s))
    assert copy.report == path.report
    described = json.loads(json.dumps(path.describe()))
    assert described["orientation"] == "NormalOrientation"
    assert described["knots"] == len(path.knots)
    assert described["speed"] == 0.1


def test_points_are_a_spline():
    points = np.array([[0.4, -0.05, 0.9], [0.5, -0.05, 1.0], [0.55, -0.05, 1.1], [0.6, -0.05, 1.1]])
    path = CartesianPath(load("cicese_2dof"), "tool", points, speed=0.1)
    assert np.abs(pose(load("cicese_2dof"), "tool", path.q_d(path.curve.knots))[0] - points).max() < 1e-5


def test_a_smaller_tolerance_takes_more_knots_and_is_kept():
    curve = random_curve("spline", 7, False)
    paths = [
        CartesianPath(
            load("panda"), "panda_hand_tcp", curve, HELD["normal"], speed=0.1, start=HOME["panda"], tolerance=tolerance
        )
        for tolerance in (1e-5, 1e-7, 1e-8)
    ]
    knots = [path.report.knots for path in paths]
    assert knots[0] < knots[1] < knots[2]
    for path in paths:
        s = places(path)
        deviation = np.linalg.norm(pose(load("panda"), "panda_hand_tcp", path.q_d(s))[0] - curve.position(s), axis=-1)
        assert deviation.max() <= path.tolerance


def test_the_report_says_what_is_so():
    robot, curve = load("panda"), random_curve("circle", 2, False)
    path = CartesianPath(robot, "panda_hand_tcp", curve, HELD["orientation"], speed=0.1)
    report, s = path.report, places(path, 2000)
    q = path.q_d(s)
    distance = np.minimum(q - robot.limits.lower, robot.limits.upper - q).min(0)
    assert report.limit_joint == robot.joint_names[int(np.argmin(distance))]
    assert report.limit_distance == pytest.approx(distance.min(), abs=1e-3)
    jacobian = robot.frame_jacobian(q, "panda_hand_tcp")
    jacobian[:, :3] /= report.length
    values = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
    assert report.smallest_singular_value == pytest.approx(values.min(), rel=1e-3)
    assert report.smallest_singular_value <= values.min() * (1 + 1e-9)
    assert report.fastest == pytest.approx(np.linalg.norm(path.dq_d(s), axis=-1).max(), rel=1e-2)
    assert report.knots == len(path.knots)


@fewer
@given(seed=seeds)
def test_corrected_postures_are_the_nearest_that_hold_the_tool(seed):
    """q − q_rest is a combination of the rows of ∂f/∂q, and every posture nearby that holds the tool is farther off."""
    robot, rng = load("panda"), np.random.default_rng(seed)
    curve = random_curve("circle", seed, False)
    for orientation in (FreeOrientation(), HELD["normal"], HELD["orientation"]):
        constraint = ToolConstraint.of(Tool(robot, "panda_hand_tcp"), curve, orientation, (1e-5, 1e-4))
        path = CartesianPath(robot, "panda_hand_tcp", curve, orientation, speed=0.1, start=HOME["panda"])
        s = places(path, 20, seed)
        rest = path.q_d(s) + 0.1 * rng.uniform(-1, 1, (20, 7))
        found = correct(constraint, PostureCost.nearest(rest, robot.limits), path.q_d(s), s)
        assert found.converged.all()
        f, slope = constraint.at(found.q, s)
        assert np.abs(f).max() < 1e-9
        free = np.linalg.svd(slope)[2][:, constraint.rank :]
        assert np.abs(free @ (found.q - rest)[..., None]).max() < 1e-7
        beside = found.q + 1e-2 * (rng.uniform(-1, 1, (20, 1, 7 - constraint.rank)) @ free)[:, 0]
        others = correct(constraint, PostureCost.nearest(beside, robot.limits), beside, s).q
        farther = np.linalg.norm(others - rest, axis=-1) - np.linalg.norm(found.q - rest, axis=-1)
        assert (farther > -1e-9).all()


INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
LINKS = "".join(f'<link name="{name}">{INERTIAL}' for name in ("a", "b", "c", "tip"))
SCARA = f"""<robot name="scara">
  <link name="base"/>{LINKS}
  <joint name="one" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="lift" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.3 0 0"/><axis xyz="0 0 -1"/>
    <limit lower="0" upper="0.2" effort="1" velocity="1"/></joint>
  <joint name="turn" type="revolute"><parent link="c"/><child link="tip"/><origin rpy="3.141592653589793 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-4" upper="4" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.mark.parametrize(("held", "rank"), [("position", 3), ("normal", 3), ("orientation", 4)])
def test_an_arm_of_four_joints_keeps_what_it_cannot_change(held, rank):
    """A SCARA arm's tool points down whatever it does: rows of the constraint that never change are no obstacle."""
    robot, curve = load_robot(SCARA), ToolCurve.circle([0.35, 0.1, -0.1], 0.08, normal=[0.2, 0.0, 1.0])
    path = CartesianPath(robot, "tip", curve, HELD[held], speed=0.1)
    assert ToolConstraint.of(Tool(robot, "tip"), curve, path.orientation, (1e-5, 1e-4)).rank == rank
    s = places(path)
    position, rotation = pose(robot, "tip", path.q_d(s))
    assert np.linalg.norm(position - curve.position(s), axis=-1).max() < 1e-5
    assert np.allclose(rotation[..., 2], -UP, atol=1e-9)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_pose_and_jacobian_in_one_call_are_those_of_two(batch):
    robot = load("cicese_2dof")
    q = np.random.default_rng(0).normal(size=(*batch, 2))
    both = robot.frame_kinematics(q, "tool")
    assert np.array_equal(both[0], robot.frame_pose(q, "tool"))
    assert np.array_equal(both[1], robot.frame_jacobian(q, "tool"))


@pytest.mark.parametrize("law", [Projection, ExtendedMotionPlan])
def test_an_arm_follows_the_curve(ideal_arm, law):
    curve = ToolCurve.circle([0.45, -0.05, 0.9], 0.1, normal=[0, -1, 0])
    path = CartesianPath(ideal_arm, "tool", curve, speed=0.3)
    gains = (800.0, [45.0, 100.0]) if law is Projection else (800.0, [45.0, 100.0], 50.0)
    run = simulate(law(ideal_arm, path, *gains), path.start_posture, duration=1.5 * path.period / 0.3, progress=False)
    late = run.time > 1
    off = curve.distance(pose(ideal_arm, "tool", run.array("q")[0, late])[0])
    assert off.max() < 1e-3
    assert run.array("s")[0, -1] > 1.3 * path.period
