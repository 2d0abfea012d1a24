"""Viscous friction of any strength in the plant: the stability function, coupled joints, light links, sticking."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.motion_control import ComputedTorque
from pathcontrol.robot.friction import Coulomb, Viscous
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation.arm.damping import Damping
from pathcontrol.simulation.arm.plant import Plant
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.curves import Lissajous

STEP = 2.5e-3


def chain(rng, n):
    """An arm with ``n`` joints about any axes, and links of 30 g to 10 kg."""
    links = ['<robot name="chain"><link name="l0"/>']
    for i in range(n):
        mass, centre = 10 ** rng.uniform(-1.5, 1), rng.uniform(0.02, 0.3)
        J, axis = mass * centre**2 * rng.uniform(0.05, 1.0), rng.normal(size=3)
        x, y, z = axis / np.linalg.norm(axis)
        links.append(
            f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="0 0 {-rng.uniform(0.1, 0.4) if i else 0}"/><axis xyz="{x} {y} {z}"/></joint>'
            f'<link name="l{i + 1}"><inertial><origin xyz="0 {0.02 * rng.normal()} {-centre}"/><mass value="{mass}"/>'
            f'<inertia ixx="{J}" iyy="{J}" izz="{J}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    return load_robot("".join(links) + "</robot>")


def alone(J):
    """One joint that feels no gravity, with the inertia ``J``."""
    return load_robot(
        '<robot name="disc"><link name="base"/><joint name="spindle" type="continuous"><parent link="base"/>'
        '<child link="disc"/><axis xyz="0 0 1"/></joint><link name="disc"><inertial><mass value="1"/>'
        f'<inertia ixx="1" iyy="1" izz="{J}" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
    )


def lightest(arm, q):
    """1/(M⁻¹)_ii [kg m²], what the torque of each joint alone sets in motion, (n,)."""
    return 1 / np.diag(np.linalg.inv(arm.mass_matrix(q)))


def travel(robot, q, qd, tau, step, steps):
    """(q, q̇) after each step, (steps + 1, n)."""
    q, qd, tau = (np.array(a, dtype=float, ndmin=2) for a in (q, qd, tau))
    plant, states = Plant(robot, step), [(q, qd)]
    for _ in range(steps):
        states.append(plant.advance(*states[-1], tau))
    return tuple(np.array(part)[:, 0] for part in zip(*states, strict=True))


# --- one joint: the linear test equation ----------------------------------------------------------------------


def left_of_a_velocity(x):
    """R(x) of the plant, by a step of a joint alone with x = h b/J, and what it travels in it, in h v."""
    J = 0.3
    disc = alone(J).with_friction(Viscous([x * J / STEP]))
    q, qd = travel(disc, [0.0], [1.0], [0.0], STEP, 1)
    return qd[1, 0], q[1, 0] / STEP


@pytest.mark.parametrize("x", [0.01, 0.1, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 40.0, 100.0, 200.0, 1e4, 1e9])
def test_what_is_left_of_a_velocity_is_that_of_the_exact_exponential(x):
    left, travelled = left_of_a_velocity(x)
    assert 0 <= left < 1
    assert left == pytest.approx(np.exp(-x), abs=9e-4)
    assert 1 - left == pytest.approx(-np.expm1(-x), rel=9e-4)
    # J v + b q does not change, and so the way is right where the velocity is
    assert travelled == pytest.approx((1 - left) / x, rel=1e-9)


def test_four_steps_of_radau_with_the_stability_function_that_the_docstring_gives():
    def radau(x):
        return (1 - x / 3) / (1 + 2 * x / 3 + x**2 / 6)

    for x in (0.1, 1.0, 7.0, 50.0):
        assert left_of_a_velocity(x)[0] == pytest.approx(radau(x / 4) ** 4, abs=1e-12)


def test_the_stiffer_the_less_is_left():
    # R ~ (8/x)⁴: each tenfold x leaves 10⁻⁴ of what it was
    left = [left_of_a_velocity(x)[0] for x in (1e3, 1e4)]
    assert left[0] / left[1] == pytest.approx(1e4, rel=0.1)


# --- coupled joints -------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 10**6), n=st.integers(1, 6))
def test_condensed_friction_is_the_exponential_of_the_coupled_joints(seed, n):
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(n, n)), 10 ** rng.uniform(-2, 3, n) * rng.integers(0, 2, n)
    M = A @ A.T + 0.1 * np.eye(n)
    inertia, travel = Damping(b[None], STEP).condense(M[None], np.ones((1, n), dtype=bool))
    assert np.linalg.eigvalsh(0.5 * (inertia[0] + inertia[0].T)).min() > 0
    # v̇ = M⁻¹(r − Bv) from v = 0, with ∫v and r as further states
    flow = np.zeros((3 * n, 3 * n))
    flow[:n, :n], flow[:n, 2 * n :], flow[n : 2 * n, :n] = -np.linalg.solve(M, np.diag(b)), np.linalg.inv(M), np.eye(n)
    exact = expm(STEP * flow)
    change = STEP * np.linalg.inv(inertia[0])
    root = np.linalg.cholesky(M).T  # in the metric of kinetic energy the error is that of the worst x
    assert np.linalg.norm(root @ (change - exact[:n, 2 * n :]) @ root.T, 2) <= 9e-4 * STEP
    way = STEP * (0.5 * np.eye(n) + travel[0]) @ change
    assert np.linalg.norm(root @ (way - exact[n : 2 * n, 2 * n :]) @ root.T, 2) <= 9e-4 * STEP**2


def test_a_joint_that_is_held_neither_creeps_nor_lends_its_inertia():
    """Where joint 1 sticks, joint 2 moves as if joint 1 were locked, however strong its viscous friction."""
    arm = chain(np.random.default_rng(5), 2)
    q = np.array([0.3, 1.2])
    for x in (0.1, 1.0, 10.0, 100.0):
        b = x / STEP * lightest(arm, q)[1]
        locked = arm.reduced({"j0": q[0]}).with_friction(Viscous([b]))
        held = arm.with_friction(Viscous([1.0, b]) + Coulomb([1e4, 0.0]))
        positions, speeds = travel(held, q, [0.0, 2.0], [0.0, 0.1], STEP, 40)
        single, single_speeds = travel(locked, q[1:], [2.0], [0.1], STEP, 40)
        assert_array_equal(positions[:, 0], q[0])
        assert_array_equal(speeds[:, 0], 0.0)
        assert_allclose(positions[:, 1], single[:, 0], rtol=0, atol=1e-11)
        assert_allclose(speeds[:, 1], single_speeds[:, 0], rtol=0, atol=1e-9)


# --- arms -----------------------------------------------------------------------------------------------------


def test_a_light_link_gets_to_the_speed_of_its_torque_without_ringing():
    rng = np.random.default_rng(1)
    arm = chain(rng, 3)
    q = rng.normal(size=3)
    b, level = 36.0 / STEP * lightest(arm, q), np.array([0.0, 0.0, 1.0])
    tau = arm.gravity(q) + [0.0, 0.0, 3.0 * b[2]] + level * b[2]
    _, speeds = travel(arm.with_friction(Viscous(b) + Coulomb(level * b[2])), q, np.zeros(3), tau, STEP, 10)
    assert_allclose(speeds[1:, 2], 3.0, rtol=0.02)


@pytest.mark.parametrize("x", [0.05, 1.0, 30.0])
def test_damped_motion_converges_to_second_order(x):
    """The ratio of errors is 4, and below it where a step is so long that x ≥ 1; such errors are small as it is."""
    rng = np.random.default_rng(2)
    arm = chain(rng, 3)
    q, qd = rng.normal(size=3), np.zeros(3)
    arm = arm.with_friction(Viscous(x / 4e-3 * lightest(arm, q)))
    tau = arm.gravity(q) + 0.2 * arm.friction.viscous

    def rate(t, y):
        return np.concatenate([y[3:], arm.forward_dynamics(y[:3], y[3:], tau - arm.friction.viscous * y[3:])])

    start = np.concatenate([q, qd])
    exact = solve_ivp(rate, (0, 0.2), start, method="Radau", rtol=1e-11, atol=1e-13).y[:3, -1]
    errors = []
    for steps in (50, 100, 200, 400):
        positions, _ = travel(arm, q, qd, tau, 0.2 / steps, steps)
        errors.append(np.abs(positions[-1] - exact).max())
    assert errors[0] < 2e-7
    ratios = np.divide(errors[:-1], errors[1:])
    assert (ratios > (3.5 if x < 1 else 2.5)).all()
    assert x > 1 or ratios[-1] > 3.7


def test_a_damped_arm_held_by_stiction_does_not_move_by_one_bit():
    rng = np.random.default_rng(3)
    arm = chain(rng, 4)
    q = rng.normal(size=4)
    b = 10 ** rng.uniform(-2, 2, 4) * 2 / STEP * lightest(arm, q)
    held = arm.with_friction(Viscous(b) + Coulomb(1.01 * np.abs(arm.gravity(q)) + 1e-3))
    positions, speeds = travel(held, q, np.zeros(4), np.zeros(4), STEP, 100)
    assert_array_equal(positions, np.broadcast_to(q, positions.shape))
    assert_array_equal(speeds, 0.0)


@pytest.mark.parametrize("seed", range(12))
def test_peaks_at_one_step_a_period_are_those_of_many(seed):
    """‖e_p‖ of a sinusoid from rest, of random arms with h b/2M from 0.01 to 100, with dry friction and without."""
    rng = np.random.default_rng(seed)
    n = 2 + seed % 3
    arm, phases = chain(rng, n), rng.uniform(0, 6, n)
    m = lightest(arm, rng.normal(size=n))
    viscous = Viscous(10 ** rng.uniform(-2, 2, n) * 2 * m / STEP)
    arm = arm.with_friction(viscous + Coulomb(seed % 2 * rng.uniform(0, 3, n) * m))
    task = Lissajous(rng.uniform(0.2, 1.0, n), np.ones(n), phases=phases, speed=rng.uniform(1, 4))
    law = ComputedTorque(arm, task, 400.0, 40.0) if seed % 4 < 2 else ExtendedMotionPlan(arm, task, 400.0, 40.0, k=5.0)
    start, peaks = task.q_d(np.array(task.s0)) + 0.05, []
    for substeps in (1, 64):
        loop = SampledLoop(period=STEP, substeps=substeps)
        errors = np.linalg.norm(simulate(law, start, duration=0.8, loop=loop, progress=False).array("e_p"), axis=-1)[0]
        peaks.append([errors.max(), errors[len(errors) // 2 :].max()])
    assert_allclose(peaks[0], peaks[1], rtol=0.02)
