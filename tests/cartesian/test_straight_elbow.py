"""Curves past a nearly straight elbow keep their branch; those that leave the reach are refused, for that reason."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import CartesianPath, FixedOrientation, NormalOrientation, TaskError, ToolCurve, load_robot
from pathcontrol.cartesian.ik.constraint import ToolConstraint
from pathcontrol.cartesian.ik.correction import Branch, branch_at
from pathcontrol.cartesian.orientation import FreeOrientation
from pathcontrol.cartesian.tool import Tool

SHOULDER, LINK = np.array([0.0, -0.05, 1.2]), 0.45  # of the bundled arm
seeds = st.integers(0, 2**32 - 1)


def elbow(points: np.ndarray) -> np.ndarray:
    """|q_2| of two equal links that reach points (N, 3): |p − shoulder| = 2 l cos(q_2/2)."""
    return 2 * np.arccos(np.linalg.norm(points - SHOULDER, axis=-1) / (2 * LINK))


def circle_past(distance: float, seed: int) -> ToolCurve:
    """A circle in the plane of the bundled arm whose farthest point is so far from the shoulder [m]."""
    rng = np.random.default_rng(seed)
    radius, out = rng.uniform(0.03, 0.2), rng.uniform(0, 2 * np.pi)
    first = out + np.pi + rng.uniform(-1.2, 1.2)  # it begins on the near side
    center = SHOULDER + (distance - radius) * np.array([np.cos(out), 0.0, np.sin(out)])
    return ToolCurve.circle(center, radius, [0.0, 1.0, 0.0], [np.cos(first), 0.0, np.sin(first)])


@pytest.mark.parametrize("closed", [None, False])
@settings(max_examples=4)
@given(degrees=st.floats(1.0, 5.0), seed=seeds)
def test_the_bundled_arm_keeps_its_elbow_on_one_side(closed, degrees, seed):
    """The elbow angle is the closed form's all along, and of one sign."""
    curve = circle_past(2 * LINK * np.cos(np.radians(degrees) / 2), seed)
    path = CartesianPath(load_robot("cicese_2dof"), "tool", curve, speed=0.1, closed=closed)
    s = np.linspace(path.s0, curve.s_end, 2001)
    q = path.q_d(s)
    assert len(np.unique(np.sign(q[:, 1]))) == 1
    # 10 µm at the tool are 10 µm / (l sin q_2) at the elbow
    expected = elbow(curve.position(s))
    assert (np.abs(np.abs(q[:, 1]) - expected) < 1e-5 / (LINK * np.sin(expected)) + 1e-6).all()
    assert np.abs(q[0] - q[-1]).max() < 1e-6 or closed is False


@settings(max_examples=4)
@given(beyond=st.floats(1e-4, 0.01), seed=seeds)
def test_a_circle_that_leaves_the_reach_is_told_so_and_where(beyond, seed):
    curve = circle_past(2 * LINK + beyond, seed)
    with pytest.raises(TaskError, match="out of reach") as error:
        CartesianPath(load_robot("cicese_2dof"), "tool", curve, speed=0.1, closed=False)
    end = float(re.search(r"s = ([-+.e\d]+) m", str(error.value)).group(1))
    s = np.linspace(curve.s0, curve.s_end, 100_001)
    first = s[np.argmax(np.linalg.norm(curve.position(s) - SHOULDER, axis=-1) > 2 * LINK)]
    assert end == pytest.approx(first, abs=2e-3 * curve.length)


def test_a_line_through_the_shoulder_is_refused_as_singular():
    """There the elbow is folded; on the other side the arm could go on only with a jump of half a turn."""
    half = np.array([0.3, 0.0, 0.1])
    line = ToolCurve.line(SHOULDER + half, SHOULDER - half)
    with pytest.raises(TaskError, match="singularity"):
        CartesianPath(load_robot("cicese_2dof"), "tool", line, speed=0.1)


@pytest.mark.parametrize(("held", "degrees", "seed"), [("fixed", -5.0, 3), ("normal", 1.0, 0), ("free", -5.0, 3)])
def test_a_ur5_keeps_its_elbow_on_one_side(held, degrees, seed):
    """A circle in the plane of the arm touches from within the sphere that the wrist reaches with this elbow."""
    pytest.importorskip("example_robot_data")
    robot, rng = load_robot("ur5"), np.random.default_rng(seed)
    q = np.array([rng.uniform(-2, 2), rng.uniform(-1.6, -0.3), np.radians(degrees), rng.uniform(-2.5, -0.7), -1.5, 0.0])
    pose, upper = robot.frame_pose(q, "tool0"), robot.frame_pose(q, "upper_arm_link")
    across = upper[:3, 1]  # the axis of shoulder and elbow
    out = robot.frame_pose(q, "wrist_1_link")[:3, 3] - upper[:3, 3]
    out -= (out @ across) * across
    out /= np.linalg.norm(out)
    radius = rng.uniform(0.03, 0.1)
    curve = ToolCurve.circle(pose[:3, 3] - radius * out, radius, across, -out)
    turned = {"fixed": FixedOrientation(pose[:3, :3]), "normal": NormalOrientation(-pose[:3, 2]), "free": None}[held]
    path = CartesianPath(robot, "tool0", curve, turned, speed=0.1)
    s = np.linspace(path.s0, curve.s_end, 2001)
    assert np.linalg.norm(robot.frame_pose(path.q_d(s), "tool0")[:, :3, 3] - curve.position(s), axis=-1).max() < 1e-5
    if held != "free":  # a free wrist helps
        assert len(np.unique(np.sign(path.q_d(s)[:, 2]))) == 1
        assert np.abs(path.q_d(s)[:, 2]).min() < np.radians(6)  # which of the wrist's ways is taken is not said


@given(seed=seeds)
def test_branches_differ_where_the_sign_of_the_determinant_does(seed):
    """Of the two-link arm det J = −l² sin q_2 in its plane, whatever the rows of f that never change."""
    robot, rng = load_robot("cicese_2dof"), np.random.default_rng(seed)
    curve = circle_past(0.8, 0)
    constraint = ToolConstraint.of(Tool(robot, "tool"), curve, FreeOrientation(), (1e-5, 1e-4))
    a, b = rng.uniform(-np.pi, np.pi, (2, 50, 2))
    s = np.zeros(50)
    differs = branch_at(constraint, a, s).differs(branch_at(constraint, b, s))
    assert np.array_equal(differs, np.sin(a[:, 1]) * np.sin(b[:, 1]) < 0)
    assert not Branch(*branch_at(constraint, a, s)).differs(branch_at(constraint, a, s)).any()
