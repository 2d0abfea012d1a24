"""Joints without room to move count as locked, and a tool that leaves what its joints reach is told just that."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import CartesianPath, NormalOrientation, RobotModel, TaskError, ToolCurve, load_robot
from pathcontrol.cartesian.ik.joint_range import distance_to_limits

UP = np.array([0.0, 0.0, 1.0])
SPHERICAL = [("0 0 1", 0.0), ("0 1 0", 0.0), ("0 0 1", 0.0)]  # axes that meet in one point, each with its height
SIX = [("0 0 1", 0.3), ("0 1 0", 0.0), ("0 1 0", 0.4), ("0 0 1", 0.4), *SPHERICAL[1:]]
TIP = 0.1  # m


def chain(joints: list[tuple[str, float]], limits: dict[int, tuple[float, float]]) -> RobotModel:
    """An arm of turning joints j1, j2, … with a tip above the last; limits are ±3.1 but where others are given."""
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    parts = ['<link name="l0"/>']
    for i, (axis, height) in enumerate(joints, 1):
        lower, upper = limits.get(i, (-3.1, 3.1))
        parts.append(f"""<link name="l{i}">{body}</link><joint name="j{i}" type="revolute"><parent link="l{i - 1}"/>
          <child link="l{i}"/><origin xyz="0 0 {height}"/><axis xyz="{axis}"/>
          <limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint>""")
    parts.append(f"""<link name="tip"/><joint name="t" type="fixed"><parent link="l{len(joints)}"/><child link="tip"/>
      <origin xyz="0 0 {TIP}"/></joint>""")
    return load_robot(f'<robot name="chain">{"".join(parts)}</robot>')


@pytest.mark.parametrize(("joint", "held"), [(4, None), (5, None), (6, None), (6, NormalOrientation(UP))])
def test_a_frozen_joint_is_a_locked_one(joint, held):
    """The same curve by the arm whose joint is locked, from the same posture, is the same path of the others."""
    angle, curve = 0.25, ToolCurve.circle([0.5, 0.1, 0.4], 0.1)
    frozen = chain(SIX, {joint: (angle, angle)})
    path = CartesianPath(frozen, "tip", curve, held, speed=0.1)
    s = np.linspace(path.s0, curve.s_end, 301)
    q = path.q_d(s)
    assert np.abs(q[:, joint - 1] - angle).max() < 1e-9
    assert np.linalg.norm(frozen.frame_pose(q, "tip")[:, :3, 3] - curve.position(s), axis=-1).max() < 1e-5
    assert path.report.limit_joint != f"j{joint}"
    assert path.report.limit_distance == pytest.approx(
        np.delete(distance_to_limits(frozen, q), joint - 1, 1).min(), 1e-3
    )
    others = [i for i in range(6) if i != joint - 1]
    locked = CartesianPath(
        frozen.reduced({f"j{joint}": angle}), "tip", curve, held, speed=0.1, start=path.start_posture[others]
    )
    assert np.abs(locked.q_d(s) - q[:, others]).max() < 1e-3


@pytest.mark.parametrize("joint", [2, 3])
def test_a_joint_without_room_is_named_where_it_is_missed(joint):
    arm = chain(SIX, {joint: (0.0, 0.0)})
    with pytest.raises(TaskError, match=f"j{joint} cannot move, since both of its limits are 0 rad") as error:
        CartesianPath(arm, "tip", ToolCurve.circle([0.5, 0.1, 0.4], 0.1), speed=0.1)
    assert "give room between lower and upper" in str(error.value)


def test_nothing_is_said_of_joints_where_all_have_room():
    with pytest.raises(TaskError, match="out of reach") as error:
        CartesianPath(chain(SIX, {}), "tip", ToolCurve.line([0.5, 0.0, 0.5], [1.5, 0.0, 0.5]), speed=0.1)
    assert "cannot move" not in str(error.value)


@settings(max_examples=5)
@given(inwards=st.floats(8e-6, 1e-3), lean=st.floats(-0.5, 0.5))
def test_a_tool_that_leaves_the_sphere_about_its_wrist_is_out_of_reach(inwards, lean):
    """The circle touches the sphere at its beginning; d = δ(1 − cos φ) to first order from there on."""
    arm, first = chain(SPHERICAL, {}), np.array([np.cos(lean), 0.0, np.sin(lean)])
    across = np.array([-first[2], 0.0, first[0]])
    curve = ToolCurve.circle(inwards * first, TIP - inwards, across, first)
    with pytest.raises(TaskError, match="out of reach") as error:
        CartesianPath(arm, "tip", curve, speed=0.1, closed=False)
    end = float(re.search(r"s = ([-+.e\d]+) m", str(error.value)).group(1))
    left = TIP - np.linalg.norm(curve.position(np.array([end, end + 1e-3 * curve.length])), axis=-1)
    assert left[0] < 0.6e-5  # half the tolerance is what it allows the postures themselves
    assert left[1] > 0.4e-5
    assert "jump" not in str(error.value)


@pytest.mark.parametrize("frame", ["l4", "l6"])
def test_where_the_axes_of_the_wrist_meet_at_the_end_of_reach(frame):
    """The point where they meet gets 0.8 m from the shoulder, along a ray and no farther."""
    shoulder, out = np.array([0.0, 0.0, 0.3]), np.array([0.8, 0.0, 0.6])
    line = ToolCurve.line(shoulder + 0.5 * out, shoulder + 1.1 * out)
    with pytest.raises(TaskError, match="out of reach") as error:
        CartesianPath(chain(SIX, {}), frame, line, speed=0.1)
    assert float(re.search(r"s = ([-+.e\d]+) m", str(error.value)).group(1)) == pytest.approx(0.3, abs=1e-3)
