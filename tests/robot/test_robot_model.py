"""Laws of rigid-body dynamics and kinematics that any arm must keep, on several arms."""

import copy
import pickle
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from pathcontrol.errors import InputError, UnknownNameError, UrdfError
from pathcontrol.robot.catalogue import known_robots
from pathcontrol.robot.friction import Viscous
from pathcontrol.robot.loading import load_robot

EPS = np.finfo(float).eps
G = 9.81

#: name: (joints, joints to lock, the frame that carries tools)
ROBOTS = {
    "cicese_2dof": (2, {}, "tool"),
    "double_pendulum": (2, {}, "link2"),
    "ur5": (6, {}, "tool0"),
    "kinova": (6, {}, "j2s6s200_end_effector"),
    "panda": (7, {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}, "panda_hand_tcp"),
    "baxter": (
        15,
        {f"{side}_gripper_{finger}_finger_joint": 0.0 for side in "lr" for finger in "lr"},
        "left_gripper",
    ),
}
every_robot = pytest.mark.parametrize("name", ROBOTS)
few = settings(max_examples=8, deadline=None)
seeds = st.integers(0, 2**32 - 1)


@cache
def load(name):
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    return load_robot(name, lock=ROBOTS[name][1])


def frame_of(name):
    return ROBOTS[name][2]


def states(robot, seed, batch=(), count=2):
    """``count`` random arrays: angles within one turn, then velocities, accelerations, … of a few units."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (*batch, robot.n))
    return (q, *(rng.normal(0, 2, (*batch, robot.n)) for _ in range(count - 1)))


def times(M, v):
    """M v for batches."""
    return (M @ v[..., None])[..., 0]


def close(value, expected, relative=1e-12):
    """Equal to ``relative`` of the largest entry: a sum of terms of both signs is as good as its largest."""
    scale = max(np.abs(expected).max(initial=0), np.abs(value).max(initial=0), 1e-3)
    assert_allclose(value, expected, rtol=0, atol=relative * scale)


# --- what it is ---------------------------------------------------------------------------------------------


@every_robot
def test_joints_are_as_many_as_expected_and_named(name):
    robot = load(name)
    assert robot.n == ROBOTS[name][0] == len(robot.joint_names) == len(set(robot.joint_names))
    assert not set(ROBOTS[name][1]) & set(robot.joint_names)
    for i, joint in enumerate(robot.joint_names):
        assert robot.joint_index(joint) == i
    assert frame_of(name) in robot.frame_names


@every_robot
def test_limits_by_name_are_those_by_index(name):
    robot = load(name)
    for i, joint in enumerate(robot.joint_names):
        limit = robot.limit(joint)
        assert set(limit) == {"lower", "upper", "velocity", "effort"}
        assert all(limit[key] == getattr(robot.limits, key)[i] for key in limit)
        assert limit["lower"] <= limit["upper"]  # equal in double_pendulum: its URDF has zeros


def test_limits_are_those_of_the_data_sheet():
    ur5 = load("ur5")
    assert ur5.limit("wrist_3_joint")["effort"] == 28.0
    assert ur5.limit("elbow_joint")["effort"] == 150.0
    panda = load("panda")
    assert panda.limit("panda_joint4")["upper"] == pytest.approx(-0.0698)
    assert panda.limit("panda_joint4")["lower"] == pytest.approx(-3.0718)


def test_limits_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        load("cicese_2dof").limits.effort[0] = 0.0


# --- dynamics -----------------------------------------------------------------------------------------------


@every_robot
@few
@given(seed=seeds)
def test_mass_matrix_is_symmetric_and_positive_definite(name, seed):
    robot = load(name)
    (q,) = states(robot, seed, (4,), 1)
    M = robot.mass_matrix(q)
    assert_array_equal(M, M.swapaxes(-1, -2))
    assert (np.linalg.eigvalsh(M) > 0).all()


@every_robot
@few
@given(seed=seeds)
def test_columns_of_the_mass_matrix_are_torques_of_unit_accelerations(name, seed):
    """By Newton and Euler's recursion, which the mass matrix is not computed with."""
    robot = load(name)
    (q,) = states(robot, seed, (), 1)
    model, still = pin.Model(robot.pinocchio_model), np.zeros(robot.n)
    model.gravity = pin.Motion.Zero()
    data = model.createData()
    columns = [pin.rnea(model, data, q, still, unit) for unit in np.eye(robot.n)]
    close(robot.mass_matrix(q), np.stack(columns, axis=-1))


@every_robot
@few
@given(seed=seeds)
def test_mass_rate_minus_twice_coriolis_is_skew(name, seed):
    robot = load(name)
    q, qd = states(robot, seed)
    h = 1e-5
    rate = (robot.mass_matrix(q + h * qd) - robot.mass_matrix(q - h * qd)) / (2 * h)
    S = rate - 2 * robot.coriolis_matrix(q, qd)
    # the central difference costs h²‖q̇‖³ of truncation and ε/h of rounding, both near 1e-10 of M
    scale = np.abs(robot.mass_matrix(q)).max() * max(1.0, np.linalg.norm(qd)) ** 3
    assert_allclose(S, -S.T, rtol=0, atol=1e-9 * scale)


@every_robot
@few
@given(seed=seeds)
def test_coriolis_matrix_is_the_one_of_christoffel_symbols(name, seed):
    robot = load(name)
    q, qd = states(robot, seed)
    model = robot.pinocchio_model
    close(robot.coriolis_matrix(q, qd), pin.computeCoriolisMatrix(model, model.createData(), q, qd), 1e-11)


@every_robot
@few
@given(seed=seeds)
def test_coriolis_is_the_matrix_times_a_velocity_and_symmetric_in_both(name, seed):
    robot = load(name)
    q, x, y = states(robot, seed, (3,), 3)
    close(robot.coriolis(q, x, y), times(robot.coriolis_matrix(q, x), y), 1e-11)
    close(robot.coriolis(q, x, y), robot.coriolis(q, y, x), 1e-11)


@every_robot
@few
@given(seed=seeds)
def test_inverse_dynamics_is_the_sum_of_its_terms(name, seed):
    robot = load(name)
    q, qd, qdd, v = states(robot, seed, (3,), 4)
    M, C, g = robot.mass_matrix(q), robot.coriolis_matrix(q, qd), robot.gravity(q)
    close(robot.nonlinear_effects(q, qd), times(C, qd) + g, 1e-11)
    close(robot.inverse_dynamics(q, qd, qdd), times(M, qdd) + times(C, qd) + g, 1e-11)
    close(robot.inverse_dynamics(q, qd, qdd, velocity=v), times(M, qdd) + times(C, v) + g, 1e-11)
    close(robot.inverse_dynamics(q, qd, qdd, velocity=qd), robot.inverse_dynamics(q, qd, qdd), 1e-11)


@every_robot
@few
@given(seed=seeds)
def test_forward_dynamics_inverts_inverse_dynamics(name, seed):
    robot = load(name)
    q, qd, qdd = states(robot, seed, (3,), 3)
    tau = robot.inverse_dynamics(q, qd, qdd)
    # rounding of τ is magnified by M⁻¹
    worst = np.linalg.norm(np.linalg.inv(robot.mass_matrix(q)), axis=(-2, -1)).max()
    tolerance = 100 * EPS * worst * np.abs(tau).max()
    assert_allclose(robot.forward_dynamics(q, qd, tau), qdd, rtol=0, atol=tolerance)


@every_robot
@few
@given(seed=seeds)
def test_power_is_the_rate_of_energy(name, seed):
    robot = load(name)
    q, qd, qdd = states(robot, seed, (), 3)

    def energy(t):
        at, moving = q + t * qd + 0.5 * t * t * qdd, qd + t * qdd
        return robot.kinetic_energy(at, moving) + robot.potential_energy(at)

    h = 1e-4
    # five points: truncation of order h⁴ ‖q̇‖⁵, rounding of order ε/h
    rate = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    scale = np.abs(energy(0.0)) + np.linalg.norm(qd) * np.abs(robot.inverse_dynamics(q, qd, qdd)).max()
    assert rate == pytest.approx(qd @ robot.inverse_dynamics(q, qd, qdd), abs=1e-9 * scale)


@every_robot
@few
@given(seed=seeds)
def test_gravity_is_the_gradient_of_potential_energy(name, seed):
    robot = load(name)
    (q,) = states(robot, seed, (), 1)
    h = 1e-3
    steps = h * np.eye(robot.n)
    energy = robot.potential_energy
    gradient = 8 * (energy(q + steps) - energy(q - steps)) - (energy(q + 2 * steps) - energy(q - 2 * steps))
    # weights at heights of a metre or so: ε/h of rounding and h⁴/30 of truncation, below 2e-12 of them
    weight = G * pin.computeTotalMass(robot.pinocchio_model)
    assert_allclose(robot.gravity(q), gradient / (12 * h), rtol=0, atol=2e-12 * weight)


@every_robot
def test_kinetic_energy_is_half_the_quadratic_form(name):
    robot = load(name)
    q, qd = states(robot, 1, (5,))
    close(robot.kinetic_energy(q, qd), 0.5 * (qd * times(robot.mass_matrix(q), qd)).sum(-1))


# --- kinematics ---------------------------------------------------------------------------------------------


@every_robot
@few
@given(seed=seeds)
def test_poses_are_rigid_motions(name, seed):
    robot = load(name)
    (q,) = states(robot, seed, (3,), 1)
    poses = robot.frame_poses(q, robot.frame_names)
    assert poses.shape == (3, len(robot.frame_names), 4, 4)
    R = poses[..., :3, :3]
    # URDFs give axes and angles with some six digits, but as rotations they are normalised
    assert_allclose(R @ R.swapaxes(-1, -2), np.broadcast_to(np.eye(3), R.shape), rtol=0, atol=1e-13)
    assert_allclose(np.linalg.det(R), 1.0, rtol=0, atol=1e-13)
    assert_array_equal(poses[..., 3, :], np.broadcast_to([0.0, 0.0, 0.0, 1.0], poses.shape[:-1]))
    last = robot.frame_names[-1]
    assert_array_equal(poses[:, -1], robot.frame_pose(q, last))


@every_robot
@few
@given(seed=seeds)
def test_jacobian_is_the_derivative_of_the_pose(name, seed):
    robot, frame = load(name), frame_of(name)
    (q,) = states(robot, seed, (), 1)
    h = 1e-5
    steps = h * np.eye(robot.n)
    rate = (robot.frame_pose(q + steps, frame) - robot.frame_pose(q - steps, frame)) / (2 * h)
    R = robot.frame_pose(q, frame)[:3, :3]
    linear = rate[:, :3, 3].T
    spin = rate[:, :3, :3] @ R.T  # skew, of the angular velocity in axes of the base
    angular = np.array([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]])
    J = robot.frame_jacobian(q, frame)
    # h²/6 of truncation and ε/h of rounding, each below 2e-11 per metre of arm
    assert_allclose(J, np.concatenate([linear, angular]), rtol=0, atol=1e-9)


# --- variations ---------------------------------------------------------------------------------------------


def test_variations_keep_each_other():
    arm = load("cicese_2dof").with_friction(Viscous([1.0, 2.0])).with_payload(1.0, "tool").with_threads(2)
    assert arm.threads == 2
    assert_array_equal(arm.friction.viscous, [1.0, 2.0])
    few_joints = arm.with_armature([0.5, 0.5]).reduced({"joint_1": 0.0})
    assert few_joints.threads == 2
    assert_array_equal(few_joints.friction.viscous, [2.0])
    assert_allclose(few_joints.mass_matrix([0.0]), 0.093 + 3.880 * 0.048**2 + 0.45**2 + 0.5, rtol=1e-12)


# --- what is refused ----------------------------------------------------------------------------------------


def test_an_unknown_robot_lists_the_known_ones():
    with pytest.raises(UnknownNameError, match="cicese_2dof") as caught:
        load_robot("cicese_3dof")
    assert "'cicese_3dof'" in str(caught.value)
    assert all(name in str(caught.value) for name in known_robots())
    assert isinstance(caught.value, LookupError)


@pytest.mark.parametrize("name", ["talos", "anymal"])
def test_a_floating_base_is_refused(name):
    pytest.importorskip("example_robot_data")
    assert name not in known_robots()
    with pytest.raises(UnknownNameError, match="floating base"):
        load_robot(name)


def test_models_travel_between_processes():
    robot = load_robot("cicese_2dof").with_payload(1.0, "tool")
    again = pickle.loads(pickle.dumps(robot))
    q = np.array([0.3, -0.4])
    assert_array_equal(again.mass_matrix(q), robot.mass_matrix(q))
    assert_array_equal(copy.deepcopy(robot).gravity(q), robot.gravity(q))
    assert again.joint_names == robot.joint_names


def test_threads_are_checked():
    with pytest.raises(InputError, match="threads = 0"):
        load_robot("cicese_2dof", threads=0)


@pytest.mark.parametrize("source", ["nowhere/arm.urdf", "arm.urdf"])
def test_a_missing_file_is_named(source, tmp_path):
    with pytest.raises(UrdfError, match=r"cannot read the URDF file .*arm\.urdf"):
        load_robot(tmp_path / source)
    with pytest.raises(UrdfError, match=r"cannot read the URDF file .*arm\.urdf"):
        load_robot(source)


def test_a_file_and_its_text_are_the_same_arm(tmp_path):
    arm = load("cicese_2dof")
    path = tmp_path / "arm.urdf"
    path.write_text(arm.source.text, encoding="utf-8")
    q, qd, qdd = states(arm, 16, (3,), 3)
    for source in (path, str(path), arm.source.text):
        other = load_robot(source)
        assert_array_equal(other.inverse_dynamics(q, qd, qdd), arm.inverse_dynamics(q, qd, qdd))


@pytest.mark.parametrize(
    ("refused", "error", "said"),
    [
        (lambda r: r.frame_pose([0, 0], "hand"), UnknownNameError, "'hand'.*tool"),
        (lambda r: r.frame_jacobian([0, 0], "hand"), UnknownNameError, "'hand'.*tool"),
        (lambda r: r.with_payload(1.0, "hand"), UnknownNameError, "'hand'.*tool"),
        (lambda r: r.limit("elbow"), UnknownNameError, "'elbow'.*joint_1, joint_2"),
        (lambda r: r.joint_index("elbow"), UnknownNameError, "'elbow'.*joint_1, joint_2"),
        (lambda r: r.joint_index("tool_joint"), UnknownNameError, "'tool_joint'"),
        (lambda r: r.reduced({"elbow": 0.0}), UnknownNameError, "'elbow'.*joint_1, joint_2"),
        (lambda r: r.reduced({"joint_1": 0.0, "joint_2": 0.0}), InputError, "all 2 joints"),
        (lambda r: r.reduced({"joint_1": np.nan}), InputError, "angle of joint_1"),
        (lambda r: r.gravity(0.0), InputError, r"q has shape \(\).*2 joints"),
        (lambda r: r.gravity([1.0, 2.0, 3.0]), InputError, r"q has shape \(3,\).*2 joints"),
        (lambda r: r.potential_energy([[1.0]]), InputError, r"q has shape \(1, 1\)"),
        (lambda r: r.gravity(["a", "b"]), InputError, "q = .*numbers"),
        (lambda r: r.inverse_dynamics([0, 0], [0, 0, 0], [0, 0]), InputError, r"qd has shape \(3,\)"),
        (lambda r: r.forward_dynamics([0, 0], [0, 0], [1]), InputError, r"tau has shape \(1,\)"),
        (
            lambda r: r.inverse_dynamics([0, 0], [0, 0], [0, 0], velocity=[0]),
            InputError,
            r"velocity has shape \(1,\)",
        ),
        (
            lambda r: r.inverse_dynamics(np.zeros((3, 2)), np.zeros((4, 2)), np.zeros(2)),
            InputError,
            r"do not fit.*q \(3, 2\), qd \(4, 2\)",
        ),
        (lambda r: r.with_payload(-1.0, "tool"), InputError, "mass = -1"),
        (lambda r: r.with_payload(np.inf, "tool"), InputError, "mass = inf"),
        (lambda r: r.with_payload(1.0, "tool", com=[0, 0]), InputError, r"\(2,\).*expected \(3,\)"),
        (lambda r: r.with_payload(1.0, "tool", com=[0, 0, np.nan]), InputError, "com"),
        (lambda r: r.with_payload(1.0, "tool", inertia=[1, 1, 1]), InputError, r"\(3, 3\)"),
        (lambda r: r.with_payload(1.0, "tool", inertia=-np.eye(3)), InputError, "semi-definite"),
        (lambda r: r.with_payload(1.0, "tool", inertia=np.triu(np.ones((3, 3)))), InputError, "symmetric"),
        (lambda r: r.with_armature([1.0]), InputError, r"armature has shape \(1,\)"),
        (lambda r: r.with_armature([1.0, -1.0]), InputError, r"armature = .*-1\.0"),
        (lambda r: r.with_friction(Viscous([1.0])), InputError, "for 1 joints, cicese_2dof has 2"),
        (lambda r: r.with_threads(0), InputError, "threads = 0"),
    ],
)
def test_bad_arguments_are_refused_by_value(refused, error, said):
    with pytest.raises(error, match=said):
        refused(load("cicese_2dof"))
