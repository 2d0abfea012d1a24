"""Arms that are made of others: locked joints, payloads, armature, friction."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from test_robot_model import G, close, every_robot, frame_of, load, states

from pathcontrol.robot.friction import Coulomb, Viscous
from pathcontrol.robot.loading import load_robot


@pytest.mark.parametrize("name", ["kinova", "cicese_2dof"])
def test_a_continuous_joint_is_one_angle(name):
    robot = load(name)
    endless = np.isinf(robot.limits.lower)
    assert endless.sum() >= 2
    assert_array_equal(endless, np.isinf(robot.limits.upper))
    q, qd = states(robot, 7, (10,))
    turned = q + 2 * np.pi * endless
    # a turn of 2π is rounded to ε · 2π, and each joint adds its own
    close(robot.mass_matrix(turned), robot.mass_matrix(q), 1e-13)
    close(robot.nonlinear_effects(turned, qd), robot.nonlinear_effects(q, qd), 1e-13)
    close(robot.frame_pose(turned, frame_of(name)), robot.frame_pose(q, frame_of(name)), 1e-13)


@pytest.mark.parametrize(
    ("name", "lock"),
    [
        ("cicese_2dof", {"joint_1": 0.4}),
        ("cicese_2dof", {"joint_2": -1.1}),
        ("ur5", {"elbow_joint": 0.7, "shoulder_pan_joint": -0.3, "wrist_3_joint": 2.0}),
        ("kinova", {"j2s6s200_joint_1": 5.0, "j2s6s200_joint_4": -0.6}),
        ("baxter", {"head_pan": 0.5, "left_e1": 0.3, "right_s0": -0.2}),
    ],
)
def test_a_reduced_arm_is_the_whole_one_with_those_joints_held(name, lock):
    robot = load(name)
    reduced = robot.reduced(lock)
    free = [i for i, joint in enumerate(robot.joint_names) if joint not in lock]
    held = [robot.joint_index(joint) for joint in lock]
    assert reduced.joint_names == tuple(robot.joint_names[i] for i in free)

    small = states(reduced, 8, (4,), 3)
    q, qd, qdd = (np.zeros((4, robot.n)) for _ in range(3))
    for whole, part in zip((q, qd, qdd), small, strict=True):
        whole[:, free] = part
    q[:, held] = list(lock.values())

    close(reduced.mass_matrix(small[0]), robot.mass_matrix(q)[:, free][:, :, free], 1e-12)
    close(reduced.coriolis_matrix(*small[:2]), robot.coriolis_matrix(q, qd)[:, free][:, :, free], 1e-11)
    close(reduced.gravity(small[0]), robot.gravity(q)[:, free], 1e-12)
    close(reduced.inverse_dynamics(*small), robot.inverse_dynamics(q, qd, qdd)[:, free], 1e-12)
    for frame in (frame_of(name), robot.frame_names[1]):
        close(reduced.frame_pose(small[0], frame), robot.frame_pose(q, frame), 1e-13)
        close(reduced.frame_jacobian(small[0], frame), robot.frame_jacobian(q, frame)[..., free], 1e-13)


def test_a_reduced_arm_keeps_the_limits_friction_and_encoders_of_its_joints():
    arm = load("cicese_2dof")
    rest = arm.reduced({"joint_1": 0.0})
    assert rest.limit("joint_2") == arm.limit("joint_2")
    assert_array_equal(rest.friction.torque(np.array([-2.0])), arm.friction.torque(np.array([0.0, -2.0]))[1:])
    assert_array_equal(rest.actuation.encoder_counts, arm.actuation.encoder_counts[1:])


def test_locking_at_loading_is_reducing_afterwards():
    pytest.importorskip("example_robot_data")
    lock = {"elbow_joint": 0.7, "wrist_1_joint": -0.3}
    early, late = load_robot("ur5", lock=lock), load("ur5").reduced(lock)
    assert early.joint_names == late.joint_names
    q, qd, qdd = states(early, 9, (3,), 3)
    assert_array_equal(early.inverse_dynamics(q, qd, qdd), late.inverse_dynamics(q, qd, qdd))


@pytest.mark.parametrize("batch", [(), (1,), (4,), (2, 3)])
def test_an_arm_of_one_joint_works_like_any_other(batch):
    arm = load("cicese_2dof").reduced({"joint_1": 0.0})
    q, qd, qdd = states(arm, 10, batch, 3)
    inertia, moment = 0.093 + 3.880 * 0.048**2, 9.81 * 3.880 * 0.048
    tau = inertia * qdd + moment * np.sin(q)
    close(arm.inverse_dynamics(q, qd, qdd), tau)
    close(arm.forward_dynamics(q, qd, tau), qdd)
    close(arm.mass_matrix(q), np.full((*batch, 1, 1), inertia))
    close(arm.coriolis_matrix(q, qd), np.zeros((*batch, 1, 1)))


BAR = np.array([[0.02, 0.003, 0.001], [0.003, 0.03, -0.002], [0.001, -0.002, 0.025]])


@every_robot
@pytest.mark.parametrize("inertia", [None, BAR], ids=["point", "body"])
@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.05, -0.1, 0.2)], ids=["centred", "apart"])
def test_a_payload_adds_its_own_inertia_and_weight(name, inertia, com):
    robot, frame, mass = load(name), frame_of(name), 2.5
    loaded = robot.with_payload(mass, frame, com, inertia)
    (q,) = states(robot, 11, (4,), 1)
    pose, J = robot.frame_pose(q, frame), robot.frame_jacobian(q, frame)
    R, lever = pose[:, :3, :3], pose[:, :3, :3] @ np.array(com)
    # velocity of the centre of mass: v + ω × lever, column by column
    J_c = J[:, :3] + np.cross(J[:, 3:], lever[:, :, None], axis=1)
    added = mass * J_c.swapaxes(-1, -2) @ J_c
    if inertia is not None:
        added += J[:, 3:].swapaxes(-1, -2) @ R @ inertia @ R.swapaxes(-1, -2) @ J[:, 3:]
    close(loaded.mass_matrix(q), robot.mass_matrix(q) + added)
    close(loaded.gravity(q), robot.gravity(q) + mass * G * J_c[:, 2])
    height = pose[:, 2, 3] + lever[:, 2]
    close(loaded.potential_energy(q), robot.potential_energy(q) + mass * G * height)


def test_a_payload_leaves_the_arm_itself_as_it_was():
    robot = load("ur5")
    (q,) = states(robot, 12, (2,), 1)
    before = robot.mass_matrix(q), robot.gravity(q)
    loaded = robot.with_payload(5.0, "tool0")
    assert not np.allclose(loaded.mass_matrix(q), before[0])
    assert_array_equal(robot.mass_matrix(q), before[0])
    assert_array_equal(robot.gravity(q), before[1])
    assert loaded.limits is robot.limits
    assert loaded.friction is robot.friction


def test_payloads_add_up_and_none_is_none():
    robot = load("panda")
    (q,) = states(robot, 13, (3,), 1)
    frame = frame_of("panda")
    twice = robot.with_payload(1.0, frame).with_payload(1.5, frame)
    close(twice.mass_matrix(q), robot.with_payload(2.5, frame).mass_matrix(q))
    close(robot.with_payload(0.0, frame).mass_matrix(q), robot.mass_matrix(q))


@every_robot
def test_armature_adds_to_the_diagonal_only(name):
    robot = load(name)
    rotors = np.linspace(0.1, 2.0, robot.n)
    geared = robot.with_armature(rotors)
    q, qd, qdd = states(robot, 14, (3,), 3)
    close(geared.mass_matrix(q), robot.mass_matrix(q) + np.diag(rotors))
    close(geared.coriolis_matrix(q, qd), robot.coriolis_matrix(q, qd))
    close(geared.gravity(q), robot.gravity(q))
    close(geared.inverse_dynamics(q, qd, qdd), robot.inverse_dynamics(q, qd, qdd) + rotors * qdd)
    close(geared.forward_dynamics(q, qd, geared.inverse_dynamics(q, qd, qdd)), qdd, 1e-11)
    close(geared.with_armature(rotors).mass_matrix(q), robot.mass_matrix(q) + 2 * np.diag(rotors))


def test_friction_is_beside_the_rigid_body_terms():
    arm = load("cicese_2dof")
    q, qd, qdd = states(arm, 15, (3,), 3)
    other = arm.with_friction(Viscous([1.0, 2.0]) + Coulomb([3.0, 4.0]))
    assert_array_equal(other.friction.viscous, [1.0, 2.0])
    assert_array_equal(other.inverse_dynamics(q, qd, qdd), arm.inverse_dynamics(q, qd, qdd))
    assert_array_equal(arm.with_friction(None).friction.torque(qd), np.zeros((3, 2)))
    assert arm.friction.viscous[0] == 2.288
