"""The compiled kernels against Pinocchio, brute force, and the reference in Python."""

from __future__ import annotations

import itertools
from ctypes import addressof

import numpy as np
import pytest
from random_arms import random_arm

from pathcontrol import FrameForce, load_robot
from pathcontrol.engine.arm_constants import arm_struct, inverse_dynamics, mass_matrix, momentum
from pathcontrol.engine.library import load_library
from pathcontrol.engine.structs import Memory
from pathcontrol.errors import EngineError
from pathcontrol.robot.constants import arm_constants, frame_carrier
from pathcontrol.simulation.arm.dry_friction import stick_slip

ARMS = [(seed, joints) for seed, joints in enumerate([1, 2, 3, 4, 5, 6, 7, 9, 12, 16, 6, 7])]


@pytest.mark.parametrize(("seed", "joints"), ARMS)
def test_dynamics_of_random_trees_are_those_of_pinocchio(seed, joints):
    robot = random_arm(seed, joints)
    q, qd, qdd = np.random.default_rng(seed).normal(0, 2, (3, 20, joints))
    arm = arm_struct(robot)
    tau, M = robot.inverse_dynamics(q, qd, qdd), robot.mass_matrix(q)
    assert np.abs(inverse_dynamics(arm, q, qd, qdd) - tau).max() <= 1e-12 * np.abs(tau).max()
    assert np.abs(mass_matrix(arm, q) - M).max() <= 1e-12 * np.abs(M).max()


@pytest.mark.parametrize(("seed", "joints"), ARMS)
def test_momentum_and_its_rate_are_those_of_pinocchio(seed, joints):
    """ṗ = τ + ∂T/∂q − g, and ∂T/∂q is half of q̇ᵀ(∂M/∂q)q̇, here by central differences too."""
    robot = random_arm(seed, joints)
    q, qd = np.random.default_rng(seed).normal(0, 2, (2, 20, joints))
    p, gradient = momentum(arm_struct(robot), q, qd)
    assert np.abs(p - robot.momentum(q, qd)).max() <= 1e-12 * np.abs(p).max()
    expected = robot.momentum_rate(q, qd, np.zeros(joints)) + robot.gravity(q)
    size = np.abs(expected).max() + np.abs(p).max()  # a single joint has no gradient
    assert np.abs(gradient - expected).max() <= 1e-12 * size
    step = 1e-6 * np.eye(joints)
    energies = [[robot.kinetic_energy(q + sign * one, qd) for one in step] for sign in (1, -1)]
    assert np.allclose(np.subtract(*energies).T / 2e-6, gradient, rtol=1e-6, atol=1e-6 * size)


@pytest.mark.parametrize("name", ["cicese_2dof", "ur5", "panda", "xarm7"])
def test_dynamics_of_real_arms_with_rotors_and_payloads(name):
    lock = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0} if name == "panda" else None
    robot = load_robot(name, lock=lock)
    robot = robot.with_armature(np.linspace(0.01, 0.1, robot.n)).with_payload(
        1.3, robot.frame_names[-1], com=[0.1, 0, 0.05]
    )
    q, qd, qdd = np.random.default_rng(1).normal(0, 1.5, (3, 20, robot.n))
    tau, M = robot.inverse_dynamics(q, qd, qdd), robot.mass_matrix(q)
    assert np.abs(inverse_dynamics(arm_struct(robot), q, qd, qdd) - tau).max() <= 1e-12 * np.abs(tau).max()
    assert np.abs(mass_matrix(arm_struct(robot), q) - M).max() <= 1e-12 * np.abs(M).max()


def test_an_arm_that_the_engine_gets_wrong_is_refused_by_joint(monkeypatch):
    robot = random_arm(3, 4)
    wrong = arm_constants(robot)
    wrong.mass[2] *= 1.001
    monkeypatch.setattr("pathcontrol.engine.arm_constants.arm_constants", lambda _: wrong)
    with pytest.raises(EngineError, match=r"joint 'j\d' of tree3"):
        arm_struct(robot)


@pytest.mark.parametrize("seed", range(6))
def test_a_force_on_a_frame_is_carried_by_its_jacobian(seed):
    robot = random_arm(seed, 6).with_frame("tip", parent="l6", pose=[0.1, -0.2, 0.3])
    body, offset = frame_carrier(robot, "tip")
    q = np.random.default_rng(seed).normal(size=(1, 6))
    constants = arm_constants(robot)
    pose = np.eye(4)
    chain = [body]
    while constants.parent[chain[-1]] >= 0:
        chain.append(int(constants.parent[chain[-1]]))
    for i in reversed(chain):
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = constants.rotation[i], constants.origin[i]
        turn = np.eye(4)
        if constants.slides[i]:
            turn[2, 3] = q[0, i]
        else:
            c, s = np.cos(q[0, i]), np.sin(q[0, i])
            turn[:2, :2] = [[c, -s], [s, c]]
        pose = pose @ step @ turn
    where = pose[:3, :3] @ offset + pose[:3, 3]
    assert np.abs(where - robot.frame_pose(q[0], "tip")[:3, 3]).max() < 1e-12
    assert isinstance(FrameForce(robot, "tip", [1.0, 2.0, 3.0]).robot, type(robot))


def _compiled_stick_slip(M, p, low, high, guess):
    v = np.empty_like(p)
    arrays = [np.ascontiguousarray(a, dtype=float) for a in (M, p, low, high, guess, v)]
    load_library().pathcontrol_stick_slip(p.shape[1], len(p), *(a.ctypes.data for a in arrays))
    return arrays[-1]


def _enumerated(M, p, low, high):
    """The velocity of the one combination of sticking and slipping that satisfies all conditions, by trying all."""
    n, best, found = len(p), np.inf, None
    for states in itertools.product((-1, 0, 1), repeat=n):
        slips = np.flatnonzero(states)
        force = np.where(np.array(states) > 0, high, low)
        v = np.zeros(n)
        if slips.size:
            v[slips] = np.linalg.solve(M[np.ix_(slips, slips)], (p - force)[slips])
        needed = p - M @ v
        violation = max(
            [0.0, *(-v[i] * states[i] for i in slips)]
            + [max(needed[i] - high[i], low[i] - needed[i], 0.0) for i in range(n) if not states[i]]
        )
        if violation < best:
            best, found = violation, v
    return found


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_stick_slip_is_the_one_solution_found_by_trying_all(n):
    rng = np.random.default_rng(n)
    A = rng.normal(size=(40, n, n))
    M = A @ A.swapaxes(1, 2) + 0.05 * np.eye(n)
    p, high = rng.normal(size=(40, n)), rng.exponential(0.7, (40, n)) * rng.integers(0, 2, (40, n))
    low = -high * rng.uniform(0.3, 1.5, (40, n))
    high[::5], low[::5] = 0.0, 0.0  # without friction
    p[1::7] = high[1::7]  # on the verge of slipping
    expected = np.array([_enumerated(*row) for row in zip(M, p, low, high, strict=True)])
    for guess in (np.zeros_like(p), np.sign(p), -np.sign(p)):
        assert np.abs(_compiled_stick_slip(M, p, low, high, guess) - expected).max() < 1e-9


def test_stick_slip_agrees_with_the_reference_on_seven_joints():
    rng = np.random.default_rng(7)
    A = rng.normal(size=(200, 7, 7))
    M, p, high = A @ A.swapaxes(1, 2) + 0.01 * np.eye(7), rng.normal(size=(200, 7)), rng.exponential(0.5, (200, 7))
    v = _compiled_stick_slip(M, p, -high, high, np.sign(p))
    expected = stick_slip(M, p, -high, high)
    assert np.array_equal(v == 0, expected == 0)
    assert np.abs(v - expected).max() < 1e-9 * np.abs(expected).max()


def test_stick_slip_of_no_positive_definite_matrix_ends_without_numbers_or_anything_finite():
    M = np.array([[[1.0, 2.0], [2.0, 1.0]]])
    v = _compiled_stick_slip(M, np.array([[1.0, -1.0]]), -np.ones((1, 2)), np.ones((1, 2)), np.zeros((1, 2)))
    assert v.shape == (1, 2)


def test_memory_gives_rows_of_what_is_shared_and_of_what_each_rollout_has():
    memory = Memory()
    assert memory.rows(3.0, 2).stride == 0
    assert memory.rows([1.0, 2.0], 2).stride == 0
    assert memory.rows([[1.0], [2.0], [3.0]], 2).stride == 2
    assert memory.numbers([1.0, 2.0]).stride == 1
    assert addressof(memory.keep(arm_struct(load_robot("cicese_2dof"))))
