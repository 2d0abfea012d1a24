"""Rotations against SciPy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pathcontrol.robot.rotations import quaternions_of, rotation_between, rotation_of_quaternion, rotation_of_rpy

TURNS = st.floats(-7, 7) | st.sampled_from([0.0, np.pi, -np.pi, np.pi / 2, np.pi - 1e-9])
ANGLES = st.tuples(TURNS, TURNS, TURNS)


@given(ANGLES)
@settings(max_examples=50)
def test_roll_pitch_and_yaw_turn_about_fixed_axes(rpy):
    assert rotation_of_rpy(rpy) == pytest.approx(Rotation.from_euler("xyz", rpy).as_matrix(), abs=1e-14)


@given(st.lists(ANGLES, max_size=4))
@settings(max_examples=100)
def test_quaternions_give_their_rotations_back(angles):
    rotations = np.reshape([rotation_of_rpy(rpy) for rpy in angles], (-1, 3, 3))
    quaternions = quaternions_of(rotations)
    assert quaternions.shape == (len(angles), 4)
    for quaternion, rotation in zip(quaternions, rotations, strict=True):
        assert np.linalg.norm(quaternion) == pytest.approx(1, abs=1e-14)
        assert Rotation.from_quat(quaternion).as_matrix() == pytest.approx(rotation, abs=1e-14)
        assert rotation_of_quaternion(quaternion) == pytest.approx(rotation, abs=1e-14)


@pytest.mark.parametrize("end", [[0, 0, 2], [0, 0, -3], [1, 2, 3], [0, 1e-9, -1], [-5, 0, 0]])
def test_one_direction_is_turned_into_another_by_the_smallest_angle(end):
    rotation = rotation_between([0.0, 0.0, 1.0], end)
    direction = np.array(end) / np.linalg.norm(end)
    assert rotation @ [0, 0, 1] == pytest.approx(direction, abs=1e-8)  # near half a turn cos has no more
    assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-14)
    angle = np.linalg.norm(Rotation.from_matrix(rotation).as_rotvec())
    assert angle == pytest.approx(np.arctan2(np.hypot(*direction[:2]), direction[2]), abs=1e-8)
