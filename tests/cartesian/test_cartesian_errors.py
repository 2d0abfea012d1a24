"""Curves that an arm cannot follow: the error says where and why, the arm goes as far as that, the advice helps."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import InputError, RobotModel, TaskError, UnknownNameError, load_robot
from pathcontrol.cartesian.cartesian_path import CartesianPath
from pathcontrol.cartesian.orientation import FixedOrientation, NormalOrientation, TangentOrientation
from pathcontrol.toolpaths.tool_curve import ToolCurve

DOWN = np.diag([1.0, -1.0, -1.0])
UP = np.array([0.0, 0.0, 1.0])
few = settings(max_examples=4)

INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
LINKS = "".join(f'<link name="{name}">{INERTIAL}' for name in ("a", "b", "c"))
GANTRY = f"""<robot name="gantry">
  <link name="base"/>{LINKS}
  <joint name="x" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="z" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
    <limit lower="-0.2" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


@cache
def load(name: str) -> RobotModel:
    if not name.startswith(("<", "cicese")):
        pytest.importorskip("example_robot_data")
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return load_robot(name, lock=fingers if name == "panda" else None)


def told(robot: str, frame: str, curve, orientation=None, kind: type[Exception] = TaskError, **options) -> str:
    with pytest.raises(kind) as error:
        CartesianPath(load(robot), frame, curve, orientation, **({"speed": 0.1} | options))
    return str(error.value)


def end_of(message: str) -> float:
    """The s at which the message says that it ended."""
    return float(re.search(r"s = ([-+.e\d]+) m", message).group(1))


def vector_in(message: str) -> np.ndarray:
    """The displacement that the message advises."""
    return np.array([float(x) for x in re.search(r"move the curve by \(([^)]*)\)", message).group(1).split(",")])


@few
@given(angle=st.floats(-3.0, 3.0))
def test_out_of_reach_is_told_where_the_arm_is_stretched(angle):
    """A line outwards from the 2-joint arm's shoulder leaves the circle of radius 0.9 m; it begins 0.5 m from it."""
    shoulder, out = np.array([0.0, -0.05, 1.2]), np.array([np.cos(angle), 0.0, np.sin(angle)])
    across = np.array([-out[2], 0.0, out[0]])
    start, end = shoulder + 0.5 * out, shoulder + 1.2 * out + 0.1 * across
    length = np.linalg.norm(end - start)
    message = told("cicese_2dof", "tool", ToolCurve.line(start, end))
    direction = (end - start) / length
    along, apart = direction @ (shoulder - start), np.linalg.norm(np.cross(direction, shoulder - start))
    leaves = along + np.sqrt(0.9**2 - apart**2)
    assert end_of(message) == pytest.approx(leaves, abs=1e-4)
    assert f"{100 * end_of(message) / length:.3g} % of it" in message
    assert "out of reach" in message
    gap = np.linalg.norm(end - shoulder) - 0.9
    assert f"the nearest it gets is {gap:.3g} m away" in message
    # the advice is the shortest way, and with a little more of it the arm gets there
    advice = vector_in(message)
    assert np.allclose(advice, -gap * (end - shoulder) / np.linalg.norm(end - shoulder), atol=1e-3)
    CartesianPath(load("cicese_2dof"), "tool", ToolCurve.line(start + 1.1 * advice, end + 1.1 * advice), speed=0.1)


def test_a_curve_beside_the_plane_of_a_planar_arm():
    message = told("cicese_2dof", "tool", ToolCurve.line([0.4, 0.0, 0.9], [0.5, 0.0, 0.9]))
    assert "does not reach the first point of the curve from any posture" in message
    assert "s = 0 m, the point (0.4000, 0.0000, 0.9000) m" in message
    assert np.allclose(vector_in(message), [0, -0.05, 0])
    leaving = told("cicese_2dof", "tool", ToolCurve.line([0.4, -0.05, 0.9], [0.5, 0.0, 0.9]))
    assert "out of reach" in leaving
    assert 0 <= end_of(leaving) < 1e-3


def test_a_position_in_reach_in_another_orientation():
    curve = ToolCurve.line([0.4, 0.0, 0.2], [0.9, 0.0, 0.2])
    message = told("ur5", "tool0", curve, FixedOrientation(DOWN))
    assert "out of reach" in message
    assert "the position alone is in reach" in message
    assert " rad away" in message
    CartesianPath(load("ur5"), "tool0", curve, speed=0.1)


@few
@given(st.sampled_from(["x", "y", "z"]), st.booleans())
def test_a_joint_limit_is_told_by_name_and_place(joint, upper):
    """Each joint of a gantry is a coordinate of its tool."""
    robot, i = load(GANTRY), "xyz".index(joint)
    limit = (robot.limits.upper if upper else robot.limits.lower)[i]
    start = np.array([0.1, 0.1, 0.1])
    end = start + 1.5 * (limit - start[i]) * np.eye(3)[i] + 0.05 * np.eye(3)[(i + 1) % 3]
    message = told(GANTRY, "c", ToolCurve.line(start, end))
    length = np.linalg.norm(end - start)
    assert end_of(message) == pytest.approx(length / 1.5, abs=1e-5 * length)
    assert f"{joint} is at its {'upper' if upper else 'lower'} limit, {limit:g} m" in message
    assert "start posture" in message


def test_a_limit_is_respected_up_to_touching_it():
    """A circle that just touches the limit is followed, one that is 1 µm larger is not."""
    robot, curve = load(GANTRY), ToolCurve.circle([0.0, 0.0, 0.4], 0.5 - 1e-6)
    path = CartesianPath(robot, "c", curve, speed=0.1, tolerance=1e-7)
    assert path.q_d(np.linspace(*path.one_traverse, 5000))[:, 1].max() <= 0.5
    assert path.report.limit_joint == "y"
    assert 0 <= path.report.limit_distance < 2e-6
    beyond = told(GANTRY, "c", ToolCurve.circle([0.0, 0.0, 0.4], 0.5 + 1e-4), tolerance=1e-7)
    assert "y is at its upper limit" in beyond


def test_the_wrist_of_six_joints_becomes_singular():
    """Where the axes of wrist 1 and wrist 3 fall into one; up to there the arm goes, beyond it does not."""
    robot, start = load("ur5"), np.array([0.0, -1.2, 1.8, -0.6, -0.2, 0.0])
    first = robot.frame_pose(start, "tool0")[:3, 3]
    end = first + np.array([0.0, 0.3, 0.0])
    message = told("ur5", "tool0", ToolCurve.line(first, end), "keep", start=start)
    assert "singularity" in message
    assert "wrist_1_joint and wrist_3_joint can move without moving the tool" in message
    stop = end_of(message)
    shorter = ToolCurve.line(first, first + (stop - 2e-3) / 0.3 * (end - first))
    path = CartesianPath(robot, "tool0", shorter, "keep", speed=0.1, start=start)
    assert abs(np.sin(path.q_d(np.array(path.s_end))[4])) < 0.02
    assert path.report.smallest_singular_value < 0.02
    assert path.report.singular_at == path.s_end


def test_a_curve_through_the_axis_of_the_first_joint():
    message = told("cicese_2dof", "tool", ToolCurve.line([0.4, -0.05, 1.2], [-0.4, -0.05, 1.2]))
    assert "singularity" in message
    assert "joint_1 can move without moving the tool" in message
    assert end_of(message) == pytest.approx(0.4, abs=1e-3)


def test_a_singularity_between_two_knots_is_not_stepped_over():
    """A circle that touches the boundary of the workspace within a micrometre of it."""
    curve = ToolCurve.circle([0.3, -0.05, 1.2], 0.6 - 1e-7, normal=[0, -1, 0])
    message = told("cicese_2dof", "tool", curve)
    assert "singularity" in message or "out of reach" in message


def test_whole_turns_do_not_close():
    curve = ToolCurve.circle([0.45, 0.1, 0.2], 0.1)
    message = told("ur5", "tool0", curve, TangentOrientation(-UP))
    assert "wrist_3_joint is -6.28319 rad from where it began" in message or "+6.28319 rad" in message
    assert "closed=False" in message
    path = CartesianPath(load("ur5"), "tool0", curve, TangentOrientation(-UP), speed=0.1, closed=False)
    assert not path.closed
    assert path.s_end == curve.s_end


def test_a_start_posture_that_leads_nowhere():
    curve, start = ToolCurve.line([0.4, 0.0, 0.2], [0.4, 0.2, 0.2]), np.array([0.0, -1.2, 1.8, -2.2, -1.57, 0.0])
    far = told("ur5", "tool0", ToolCurve.line([1.4, 0.0, 0.2], [1.4, 0.2, 0.2]), start=start)
    assert "from this start posture" in far
    assert "give another start posture, or none" in far
    outside = told("ur5", "tool0", curve, kind=InputError, start=[0.0, -1.2, 3.3, 0.0, 0.0, 0.0])
    assert "elbow_joint at 3.3" in outside
    assert "-3.14159 to 3.14159" in outside


def test_an_orientation_that_jumps():
    def jumping(s: np.ndarray) -> np.ndarray:
        return np.stack([np.where(s < 0.1, 0.0, 0.5), 0 * s, 1 + 0 * s], axis=-1)

    curve = ToolCurve.line([0.45, 0.0, 0.3], [0.45, 0.2, 0.3])
    message = told("ur5", "tool0", curve, NormalOrientation(jumping))
    assert end_of(message) == pytest.approx(0.1, abs=1e-4)
    assert "smooth" in message


def test_a_closed_curve_with_an_orientation_that_is_not():
    curve = ToolCurve.circle([0.45, 0.1, 0.3], 0.1)
    leaning = NormalOrientation([[0, 0, 1], [0.1, 0, 1]], at=[curve.s0, curve.s_end])
    message = told("ur5", "tool0", curve, leaning, kind=InputError)
    assert "0.0997 rad from the one at its beginning" in message
    assert "closed=False" in message


LINE = ToolCurve.line([0.4, -0.05, 0.9], [0.5, -0.05, 0.9])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"speed": 0.0}, ["speed = 0"]),
        ({"tolerance": 0.0}, ["tolerance = 0", "1e-09"]),
        ({"angle_tolerance": -1.0}, ["angle_tolerance = -1"]),
        ({"start": [0.0, 0.0, 0.0]}, ["start has shape (3,)"]),
        ({"start": [[0.0, 0.0]]}, ["start has shape (1, 2)", "(2,)"]),
        ({"start": [0.0, np.nan]}, ["start[1] is nan"]),
        ({"orientation": "up"}, ["orientation = 'up'", "TangentOrientation"]),
        ({"orientation": "keep"}, ["give start"]),
        ({"closed": True}, ["closed = True", "open"]),
        ({"tool": [0.0, 0.1]}, ["tool has shape (2,)"]),
        ({"tool": 2 * np.eye(4)}, ["without scale"]),
        ({"curve": [[0.0, 0.0, 0.0]]}, ["points have shape (1, 3)"]),
        ({"frame": "base"}, ["no joint of cicese_2dof moves the frame 'base'"]),
    ],
)
def test_bad_arguments(options, words):
    arguments = {"robot": load("cicese_2dof"), "frame": "tool", "curve": LINE, "speed": 0.1} | options
    with pytest.raises(InputError) as error:
        CartesianPath(**arguments)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_an_unknown_frame():
    with pytest.raises(UnknownNameError, match="no frame 'hand'"):
        CartesianPath(load("cicese_2dof"), "hand", LINE, speed=0.1)
