"""Joints that are locked, with their mimics and limits, and those that are kept."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_massless import arm, hand, solid

import pathcontrol as pc
from pathcontrol.errors import InputError, UnknownNameError, UrdfError
from pathcontrol.robot.recipe import recipe_of, robot_of


@settings(max_examples=10)
@given(st.floats(-1, 1), st.sampled_from([-1.0, -0.5, 1.0, 2.0]), st.sampled_from([0.0, 0.1]))
def test_locking_the_leader_locks_its_mimics(angle, multiplier, offset):
    text = hand(multiplier, offset)
    second = multiplier * angle + offset
    third = multiplier * second + offset
    robot = pc.load_robot(text, lock={"j3": angle})
    assert robot.joint_names == ("j1", "j2")
    whole = pin.buildModelFromXML(text)
    q = np.array([0.3, -0.4])
    data = whole.createData()
    pin.framesForwardKinematics(whole, data, np.array([*q, angle, second, third]))
    pose = data.oMf[whole.getFrameId("l5", pin.BODY)].homogeneous
    np.testing.assert_allclose(robot.frame_pose(q, "l5"), pose, atol=1e-12)
    again = robot_of(json.loads(json.dumps(recipe_of(robot))))
    np.testing.assert_array_equal(again.frame_pose(q, "l5"), robot.frame_pose(q, "l5"))
    np.testing.assert_array_equal(again.mass_matrix(q), robot.mass_matrix(q))


def test_keep_and_tip_lock_all_else():
    q = np.array([0.3, -0.4])
    by_hand = pc.load_robot(hand(), lock={"j3": 0.0, "j4": 0.1, "j5": 0.05})
    for options in ({"keep": ["j1", "j2"]}, {"tip": "l2"}, {"tip": "j2"}, {"keep": ["j1"], "tip": "l2"}):
        robot = pc.load_robot(hand(), **options)
        assert robot.joint_names == ("j1", "j2")
        np.testing.assert_allclose(robot.mass_matrix(q), by_hand.mass_matrix(q), rtol=1e-12)
    moved = pc.load_robot(hand(), keep=["j1", "j2"], lock={"j3": 0.4})
    np.testing.assert_array_equal(moved.gravity(q), pc.load_robot(hand(), lock={"j3": 0.4}).gravity(q))
    text = arm("", *(solid(1, 0.01, 0.01, 0.01) for _ in range(4)))
    for options in ({"keep": ["j1", "j3"]}, {"keep": "j2"}, {"tip": "l3"}):
        one, other = pc.load_robot(text, **options), pc.load_robot(text).reduced(**options)
        assert one.joint_names == other.joint_names
        np.testing.assert_array_equal(one.mass_matrix(np.ones(one.n)), other.mass_matrix(np.ones(one.n)))


def test_a_locked_joint_that_cannot_be_at_zero_is_at_its_limit():
    text = arm("", *(solid(1, 0.01, 0.01, 0.01) for _ in range(2)))
    head, tail = text.split('name="j2"')
    text = f'{head}name="j2"' + tail.replace('lower="-2"', 'lower="0.5"')
    kept, locked = pc.load_robot(text, keep=["j1"]), pc.load_robot(text, lock={"j2": 0.5})
    np.testing.assert_array_equal(kept.frame_pose([0.2], "l2"), locked.frame_pose([0.2], "l2"))


def test_wrong_choices_are_told():
    for options, error, message in (
        ({"keep": ["j1", "j9"]}, UnknownNameError, "keep: the robot has no movable joint 'j9'; it has j1, j2"),
        ({"tip": "nothing"}, UnknownNameError, "tip = 'nothing': there is no such frame"),
        ({"keep": ["j1"], "lock": {"j1": 0.0}}, InputError, "j1: to be locked and kept"),
        ({"keep": ["j1", "j2", "j4"]}, InputError, "j4 follows another joint"),
        ({"tip": "l0"}, UrdfError, "0 of 5 joints can move"),
        ({}, UrdfError, "it mimics joint 'j3'"),
    ):
        with pytest.raises(error, match=message):
            pc.load_robot(hand(), **options)


def test_two_arms_are_one_by_its_tip():
    pytest.importorskip("example_robot_data")
    baxter = pc.load_robot("baxter", tip="left_wrist")
    assert baxter.n == 7
    assert all(name.startswith("left_") for name in baxter.joint_names)
    panda = pc.load_robot("panda", lock={"panda_finger_joint1": 0.02})
    assert panda.n == 7
    fingers = itertools.pairwise(panda.frame_poses(np.zeros(7), ["panda_leftfinger", "panda_rightfinger"])[:, :3, 3])
    assert [np.linalg.norm(b - a) for a, b in fingers] == [pytest.approx(0.04)]
