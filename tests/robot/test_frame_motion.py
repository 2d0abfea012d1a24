"""Velocity and acceleration of a frame, against the Jacobian and against differences of poses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import InputError, UnknownNameError, load_robot

FRAMES = {"cicese_2dof": "tool", "ur5": "tool0", "panda": "panda_hand_tcp"}
every_robot = pytest.mark.parametrize("name", FRAMES)
few = settings(max_examples=10, deadline=None)
seeds = st.integers(0, 2**32 - 1)


@cache
def load(name):
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return load_robot(name, lock=fingers if name == "panda" else {})


def motion(robot, seed, batch=()):
    rng = np.random.default_rng(seed)
    return rng.uniform(-np.pi, np.pi, (*batch, robot.n)), *rng.normal(0, 2, (2, *batch, robot.n))


@every_robot
@few
@given(seed=seeds)
def test_velocity_is_the_jacobian_times_the_joint_velocity(name, seed):
    robot = load(name)
    q, qd, qdd = motion(robot, seed, (3,))
    velocity, _ = robot.frame_motion(q, qd, qdd, FRAMES[name])
    expected = (robot.frame_jacobian(q, FRAMES[name]) @ qd[..., None])[..., 0]
    assert np.allclose(velocity, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@every_robot
@few
@given(seed=seeds)
def test_acceleration_is_the_rate_of_the_velocity(name, seed):
    robot, h = load(name), 1e-5
    q, qd, qdd = motion(robot, seed)

    def velocity(t):
        return robot.frame_motion(q + qd * t + qdd * t**2 / 2, qd + qdd * t, qdd, FRAMES[name])[0]

    _, acceleration = robot.frame_motion(q, qd, qdd, FRAMES[name])
    # the central difference costs h²‖q̇‖⁴ of truncation and ε/h of rounding
    atol = 1e-8 * max(1.0, np.linalg.norm(qd)) ** 4
    assert np.allclose(acceleration, (velocity(h) - velocity(-h)) / (2 * h), rtol=0, atol=atol)


@every_robot
@few
@given(seed=seeds)
def test_the_linear_parts_are_the_derivatives_of_the_position(name, seed):
    robot, h = load(name), 1e-4
    q, qd, qdd = motion(robot, seed)
    t = h * np.array([-1.0, 0.0, 1.0])[:, None]
    before, here, after = robot.frame_pose(q + qd * t + qdd * t**2 / 2, FRAMES[name])[:, :3, 3]
    velocity, acceleration = (x[:3] for x in robot.frame_motion(q, qd, qdd, FRAMES[name]))
    # h²‖q̇‖⁴ of truncation; rounding divided by h² is 1e-8
    atol = 1e-7 * max(1.0, np.linalg.norm(qd)) ** 4
    assert np.allclose(velocity, (after - before) / (2 * h), rtol=0, atol=atol)
    assert np.allclose(acceleration, (after - 2 * here + before) / h**2, rtol=0, atol=10 * atol)


def test_an_arm_at_rest_has_no_acceleration_in_spite_of_gravity():
    robot = load("cicese_2dof")
    for moment in robot.frame_motion([0.3, 0.4], np.zeros(2), np.zeros(2), "tool"):
        assert not moment.any()


@pytest.mark.parametrize("batch", [(), (4,), (2, 3), (0,)])
def test_every_batch_shape_and_broadcasting(batch):
    robot = load("cicese_2dof")
    q, qd, qdd = motion(robot, 1, batch)
    velocity, acceleration = robot.frame_motion(q, qd, qdd, "tool")
    assert velocity.shape == acceleration.shape == (*batch, 6)
    for index in np.ndindex(*batch):
        alone = robot.frame_motion(q[index], qd[index], qdd[index], "tool")
        assert np.array_equal(alone, (velocity[index], acceleration[index]))
    still = robot.frame_motion(q, qd, np.zeros(2), "tool")[1]
    assert np.array_equal(still, robot.frame_motion(q, qd, np.zeros_like(q), "tool")[1])


def test_bad_arguments_are_named():
    robot = load("cicese_2dof")
    with pytest.raises(UnknownNameError, match="no frame 'hand'"):
        robot.frame_motion(np.zeros(2), np.zeros(2), np.zeros(2), "hand")
    with pytest.raises(InputError, match=r"qdd has shape \(3,\)"):
        robot.frame_motion(np.zeros(2), np.zeros(2), np.zeros(3), "tool")
    with pytest.raises(InputError, match=r"batch axes do not fit together: q \(2, 2\), qd \(3, 2\)"):
        robot.frame_motion(np.zeros((2, 2)), np.zeros((3, 2)), np.zeros(2), "tool")
