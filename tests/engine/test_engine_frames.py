"""Poses and Jacobians of frames by the engine: those of Pinocchio, which is asked where there is no engine."""

from __future__ import annotations

import numpy as np
import pytest
from random_arms import random_arm

from pathcontrol import load_robot
from pathcontrol.engine import frame_kinematics as module
from pathcontrol.engine import library
from pathcontrol.engine.frame_kinematics import frame_kinematics, frame_poses
from pathcontrol.engine.library import load_library
from pathcontrol.robot.constants import arm_constants, frame_carrier

OFFSET = np.array([[0.0, -0.6, 0.8, 0.1], [1.0, 0.0, 0.0, -0.2], [0.0, 0.8, 0.6, 0.3], [0.0, 0.0, 0.0, 1.0]])
SHARED = """<robot name="shared"><link name="base"/><link name="hand"><inertial><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tip"/>
<joint name="tip" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/><origin xyz="0 0 0.5"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="fixed" type="fixed"><parent link="hand"/><child link="tip"/><origin xyz="0.4 0 0" rpy="0 0.5 0"/></joint>
</robot>"""


@pytest.fixture
def without_library(monkeypatch, tmp_path):
    monkeypatch.setattr(library, "_FOLDER", tmp_path)
    load_library.cache_clear()
    yield
    load_library.cache_clear()


def _random(seed, joints):
    robot = random_arm(seed, joints).with_frame("tip", parent=f"l{joints}", pose=OFFSET)
    return robot, np.random.default_rng(seed).normal(0, 2, (4, 5, joints))


@pytest.mark.parametrize(("seed", "joints"), list(enumerate([1, 2, 3, 4, 6, 7, 9, 12, 16])))
def test_frames_of_random_trees_are_where_pinocchio_has_them(seed, joints):
    robot, q = _random(seed, joints)
    frames = list(robot.frame_names)
    expected = robot.frame_poses(q, frames)
    close = 1e-12 * np.abs(expected).max()
    assert np.abs(frame_poses(robot, q, frames) - expected).max() <= close
    for k, frame in enumerate(frames):
        pose, jacobian = frame_kinematics(robot, q, frame)
        assert np.abs(pose - expected[..., k, :, :]).max() <= close
        assert np.abs(jacobian - robot.frame_jacobian(q, frame)).max() <= close
    moved = robot.with_frame("moved", parent="tip", pose=OFFSET)
    for found, wanted in zip(
        frame_kinematics(robot, q, "tip", OFFSET), moved.frame_kinematics(q, "moved"), strict=True
    ):
        assert found.shape == wanted.shape
        assert np.abs(found - wanted).max() <= close


def test_rows_are_the_same_alone_and_those_too_far_for_its_sines_are_of_pinocchio():
    robot, q = _random(5, 7)
    rows = q.reshape(-1, 7).copy()
    rows[3, 2], rows[4, 1], rows[5, 0] = 999_999.0, -1e6, np.nan
    together = frame_kinematics(robot, rows, "tip", OFFSET)
    for k, row in enumerate(rows):
        for one, all_of_them in zip(frame_kinematics(robot, row, "tip", OFFSET), together, strict=True):
            assert np.array_equal(one, all_of_them[k], equal_nan=True)
    assert np.array_equal(frame_poses(robot, rows[4:6], ["tip"]), robot.frame_poses(rows[4:6], ["tip"]), equal_nan=True)
    size = np.abs(rows[3]).max()  # of a slide, perhaps
    assert np.abs(frame_poses(robot, rows[3], ["tip"]) - robot.frame_poses(rows[3], ["tip"])).max() <= 1e-12 * size
    assert frame_poses(robot, rows[:0], ["tip", "l2"]).shape == (0, 2, 4, 4)
    assert frame_poses(robot, rows, []).shape == (20, 0, 4, 4)


def test_without_the_library_pinocchio_is_asked(without_library):
    robot, q = _random(4, 6)
    pose, jacobian = robot.frame_kinematics(q, "tip")
    assert np.array_equal(frame_poses(robot, q, ["tip", "l2"]), robot.frame_poses(q, ["tip", "l2"]))
    assert all(map(np.array_equal, frame_kinematics(robot, q, "tip"), (pose, jacobian)))
    moved = robot.with_frame("moved", parent="tip", pose=OFFSET).frame_kinematics(q, "moved")
    for found, wanted in zip(frame_kinematics(robot, q, "tip", OFFSET), moved, strict=True):
        assert np.abs(found - wanted).max() <= 1e-13 * np.abs(wanted).max()


def test_an_arm_that_the_engine_gets_wrong_is_left_to_pinocchio(monkeypatch):
    robot, q = _random(3, 4)
    wrong = arm_constants(robot)
    wrong.origin[1, 0] += 1e-6
    monkeypatch.setattr(module, "arm_constants", lambda _: wrong)
    assert np.array_equal(frame_poses(robot, q, ["tip"]), robot.frame_poses(q, ["tip"]))


def test_a_name_of_a_link_and_a_joint_is_that_of_the_link():
    robot, q = load_robot(SHARED), np.array([[0.3]])
    assert np.allclose(frame_poses(robot, q, ["tip"]), robot.frame_poses(q, ["tip"]), rtol=0, atol=1e-15)
    body, offset = frame_carrier(robot, "tip")
    assert body == 0
    assert np.isclose(np.linalg.norm(offset), 0.4, rtol=1e-15)
