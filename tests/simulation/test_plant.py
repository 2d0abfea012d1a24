"""The simulated arm against exact solutions, energy, closed forms of dry friction, and smoothed friction."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.robot.friction import Coulomb, Stribeck, Viscous
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation.arm.plant import Plant
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.curves import Circle

EPS = np.finfo(float).eps

#: one joint that feels no gravity, so that everything about it is a closed form
TURNTABLE = """
<robot name="turntable">
  <link name="base"/>
  <joint name="spindle" type="continuous">
    <parent link="base"/><child link="disc"/><axis xyz="0 0 1"/>
  </joint>
  <link name="disc">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>
"""
INERTIA = 0.5


@pytest.fixture(scope="module")
def arm():
    return load_robot("cicese_2dof")


@pytest.fixture(scope="module")
def ur5():
    pytest.importorskip("example_robot_data")
    return load_robot("ur5")


@pytest.fixture(scope="module")
def turntable():
    return load_robot(TURNTABLE)


def travel(robot, q, qd, tau, step, steps):
    """(q, q̇) after each step, (steps + 1, N, n), under a constant torque."""
    q, qd = (np.array(a, dtype=float, ndmin=2) for a in (q, qd))
    tau = np.broadcast_to(np.asarray(tau, dtype=float), q.shape)
    plant, positions, speeds = Plant(robot, step), [q], [qd]
    for _ in range(steps):
        q, qd = plant.advance(q, qd, tau)
        positions.append(q)
        speeds.append(qd)
    return np.array(positions), np.array(speeds)


def total_energy(robot, q, qd):
    return robot.kinetic_energy(q, qd) + robot.potential_energy(q)


# --- smooth motion ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "damping"), [("arm", None), ("ur5", 0.3), ("arm", 3.0), ("ur5", None)])
def test_smooth_motion_converges_to_second_order(name, damping, request):
    robot = request.getfixturevalue(name)
    n = robot.n
    robot = robot.with_friction(None if damping is None else Viscous(damping * np.linspace(0.5, 1.0, n)))
    rng = np.random.default_rng(1)
    q, qd = rng.normal(size=(2, n))
    tau = robot.gravity(q) + rng.normal(size=n)

    def rate(t, y):
        accelerating = tau - robot.friction.viscous * y[n:]
        return np.concatenate([y[n:], robot.forward_dynamics(y[:n], y[n:], accelerating)])

    start = np.concatenate([q, qd])
    exact = solve_ivp(rate, (0, 0.2), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for steps in (100, 200, 400):
        positions, speeds = travel(robot, q, qd, tau, 0.2 / steps, steps)
        errors.append(np.abs(np.concatenate([positions[-1, 0], speeds[-1, 0]]) - exact).max())
    # 4 and a term that falls with the step; a first-order scheme gives 2, a third-order one 8
    assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, atol=0.1)
    assert errors[-1] < 1e-5


def test_without_friction_energy_is_kept_to_second_order(arm):
    free = arm.with_friction(None)
    drifts = []
    for step in (2e-3, 1e-3):
        # the arm falls from the horizontal and swings for 1 s
        positions, speeds = travel(free, [np.pi / 2, 0.5], [0.0, 0.0], 0.0, step, round(1 / step))
        energy = total_energy(free, positions[:, 0], speeds[:, 0])
        drifts.append(np.abs(energy - energy[0]).max())
    swing = free.potential_energy([np.pi / 2, 0.5]) - free.potential_energy([0.0, 0.0])
    assert drifts[0] < 1e-4 * swing
    # second order or better: the drift of a swing there and back may partly cancel
    assert drifts[0] / drifts[1] > 3.5


def test_friction_never_gives_energy(arm):
    rng = np.random.default_rng(2)
    q, qd = rng.normal(size=(2, 6, 2)) * [[[1.0]], [[3.0]]]
    step = 5e-3
    positions, speeds = travel(arm, q, qd, 0.0, step, 600)
    energy = total_energy(arm, positions, speeds)
    # In the step in which a joint comes to rest or turns round it still moves by up to h/2 |v|, where the
    # true joint would have stopped earlier: gravity may do that much work. In no other step does energy rise.
    turned = (np.sign(speeds[1:]) != np.sign(speeds[:-1])) & (speeds[:-1] != 0)
    weight = np.abs(arm.gravity(positions[:-1])) * np.abs(speeds[:-1])
    allowed = (turned * weight).sum(-1) * step / 2
    assert (np.diff(energy, axis=0) <= allowed * 1.001 + 1e-11 * energy[:-1]).all()
    assert_array_equal(speeds[-1], 0.0)  # 3 s later all of it stands still
    assert (energy[-1] < energy[0]).all()


def test_a_batch_is_a_loop(arm):
    rng = np.random.default_rng(3)
    q, qd, tau = rng.normal(size=(3, 12, 2))
    qd[:4] = 0.0  # some stick, some slip, some do both
    qd[4:6, 0] = 0.0
    tau = 8 * tau
    plant = Plant(arm, 2.5e-3)
    for _ in range(20):
        next_q, next_qd = plant.advance(q, qd, tau)
        for k in range(len(q)):
            alone = plant.advance(q[k : k + 1], qd[k : k + 1], tau[k : k + 1])
            # one at a time or in a batch, LAPACK may order its sums differently
            assert_allclose(alone[0][0], next_q[k], rtol=1e-13, atol=1e-15)
            assert_allclose(alone[1][0], next_qd[k], rtol=1e-12, atol=1e-14)
        q, qd = next_q, next_qd


def test_the_state_handed_in_is_left_alone(arm):
    q, qd, tau = np.ones((1, 2)), np.zeros((1, 2)), np.zeros((1, 2))
    Plant(arm, 1e-3).advance(q, qd, tau)
    assert_array_equal(q, np.ones((1, 2)))
    assert_array_equal(qd, np.zeros((1, 2)))
    assert_array_equal(tau, np.zeros((1, 2)))


# --- sticking -----------------------------------------------------------------------------------------------


def tilt(arm, torque):
    """The posture with the second link along the first in which gravity asks ``torque`` of joint 1."""
    return np.array([np.arcsin(torque / arm.gravity([np.pi / 2, 0.0])[0]), 0.0])


def test_an_arm_held_by_stiction_does_not_move_by_one_bit(arm):
    plus, minus = (level[0] for level in arm.friction.levels(np.zeros(2)))
    q = np.array([tilt(arm, 0.9 * minus), tilt(arm, -0.9 * plus), tilt(arm, 0.3 * minus)])
    positions, speeds = travel(arm, q, np.zeros_like(q), 0.0, 2.5e-3, 200)
    assert (arm.gravity(q[0])[0] > plus).all()  # held by the greater of the two levels
    assert_array_equal(positions[-1], q)
    assert_array_equal(speeds, 0.0)


def test_six_joints_held_by_stiction_do_not_move_by_one_bit(ur5):
    rng = np.random.default_rng(4)
    q = rng.uniform(-np.pi, np.pi, (4, 6))
    held = ur5.with_friction(Viscous(np.ones(6)) + Coulomb(1.01 * np.abs(ur5.gravity(q)).max(0) + 0.01))
    positions, speeds = travel(held, q, np.zeros_like(q), 0.0, 2.5e-3, 100)
    assert_array_equal(positions[-1], q)
    assert_array_equal(speeds, 0.0)


@pytest.mark.parametrize("direction", [1, -1])
def test_stiction_ends_at_the_level_of_its_direction(arm, direction):
    plus, minus = (level[0] for level in arm.friction.levels(np.zeros(2)))
    # the arm would fall against its tilt: tilted by +q₁ it is held by the level for q̇₁ < 0
    level = minus if direction > 0 else plus
    # 1e-9 below and above: far beyond rounding, far below the difference of the two levels
    for excess in (-1e-9, 1e-9):
        q = tilt(arm, direction * level * (1 + excess))
        _, speeds = travel(arm, q, [0.0, 0.0], 0.0, 2.5e-3, 100)
        moved = speeds[-1, 0, 0]
        assert moved == 0.0 if excess < 0 else moved * direction < 0


def test_static_friction_holds_more_than_sliding_friction(turntable):
    sticky = turntable.with_friction(Stribeck([1.0], [1.5], [0.1]))
    _, speeds = travel(sticky, [0.0], [0.0], [1.4], 1e-3, 100)
    assert_array_equal(speeds, 0.0)
    _, speeds = travel(sticky, [0.0], [0.0], [1.6], 1e-3, 1000)
    # once it runs, only the Coulomb level is left, and q̈ = (1.6 − 1)/J is constant
    assert speeds[-1, 0, 0] - speeds[-2, 0, 0] == pytest.approx(1e-3 * 0.6 / INERTIA, rel=1e-9)
    _, speeds = travel(sticky, [0.0], [1.0], [1.2], 1e-3, 1000)
    assert (np.diff(speeds[:, 0, 0]) > 0).all()


def test_a_held_joint_carries_the_other_one(arm):
    """With joint 1 stuck, joint 2 swings as if joint 1 were locked."""
    hard = arm.with_friction(Coulomb([1e3, 0.0]))
    pendulum = arm.reduced({"joint_1": 0.3}).with_friction(None)
    positions, speeds = travel(hard, [0.3, 1.2], [0.0, 2.0], 0.0, 2e-3, 400)
    alone, alone_speeds = travel(pendulum, [1.2], [2.0], 0.0, 2e-3, 400)
    assert_array_equal(positions[:, 0, 0], 0.3)
    # the same scheme on the same equation: only rounding, which a pendulum adds up but does not magnify much
    assert_allclose(positions[:, 0, 1], alone[:, 0, 0], rtol=0, atol=1e-10)
    assert_allclose(speeds[:, 0, 1], alone_speeds[:, 0, 0], rtol=0, atol=1e-10)


# --- sliding to a stop --------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [1.0, -1.0])
@pytest.mark.parametrize("damping", [0.0, 0.8])
@pytest.mark.parametrize("step", [1e-2, 1e-3])
def test_a_sliding_joint_stops_when_and_where_the_closed_form_says(turntable, start, damping, step):
    plus, minus = 1.3, 2.1
    level, speed = (plus if start > 0 else minus), abs(start)
    if damping:
        stop = INERTIA / damping * np.log1p(damping * speed / level)
        way = (INERTIA * speed - level * stop) / damping
    else:
        stop, way = INERTIA * speed / level, INERTIA * speed**2 / (2 * level)
    disc = turntable.with_friction(Viscous([damping]) + Coulomb([plus], [minus]))
    positions, speeds = travel(disc, [0.0], [start], [0.0], step, int(2 * stop / step))
    positions, speeds = positions[:, 0, 0], speeds[:, 0, 0]
    at_rest = int(np.argmax(speeds == 0))
    assert at_rest > 0
    # it stops in the step in which the closed form does
    assert abs(at_rest * step - stop) < step
    assert_array_equal(speeds[at_rest:], 0.0)
    assert_array_equal(positions[at_rest:], positions[at_rest])
    # the error of the last step: a deceleration F/J, and b v/J with a small v, for at most h
    assert abs(positions[-1] - np.sign(start) * way) < level / INERTIA * step**2
    if not damping:  # until then the deceleration is constant, and any second-order scheme is exact
        times = step * np.arange(at_rest)
        exact = np.sign(start) * (speed - level / INERTIA * times)
        assert_allclose(speeds[:at_rest], exact, rtol=0, atol=1e-13)


def test_a_joint_driven_back_reverses_without_a_pause(turntable):
    level, torque, step, steps = 1.3, -5.0, 1e-3, 1000
    disc = turntable.with_friction(Coulomb([level]))
    _, speeds = travel(disc, [0.0], [1.0], [torque], step, steps)
    turn = INERTIA / (level - torque)
    exact = (torque + level) / INERTIA * (step * steps - turn)
    # in the step of the reversal friction may have either sign: 2F/J h of speed at most
    assert abs(speeds[-1, 0, 0] - exact) < 2 * level / INERTIA * step
    assert (np.diff(speeds[:, 0, 0]) < 0).all()


def test_an_arm_with_its_weight_carried_slides_to_a_stop_in_time(arm):
    """Joint 1 of the arm, joint 2 locked: τ = g(q) at each step leaves J q̈ = −F."""
    joint = arm.reduced({"joint_2": 0.0}).with_friction(Coulomb([7.17], [8.049]))
    J, step, q, qd = joint.mass_matrix([0.0])[0, 0], 1e-3, np.array([[0.2]]), np.array([[1.5]])
    plant, time = Plant(joint, step), 0.0
    while qd[0, 0] > 0 and time < 5:
        q, qd = plant.advance(q, qd, joint.gravity(q))
        time += step
    # the torque is held over a step, in which gravity changes by at most g'(q) q̇ h
    unbalanced = joint.gravity([np.pi / 2])[0] * 1.5 * step
    exact = J * 1.5 / 7.17
    assert qd[0, 0] == 0.0
    assert abs(time - exact) < step + exact * unbalanced / 7.17


# --- stiff viscous friction ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "damping"), [("arm", 1e2), ("ur5", 1e4), ("arm", 1e6), ("ur5", 1e9)])
def test_any_viscous_friction_is_stable_at_a_large_step(name, damping, request):
    robot = request.getfixturevalue(name)
    robot = robot.with_friction(Viscous(np.full(robot.n, damping)))
    rng = np.random.default_rng(5)
    q, qd = rng.normal(size=(2, 20, robot.n))
    first, plant = np.linalg.norm(qd, axis=-1), Plant(robot, 0.05)
    start = q
    for _ in range(200):
        q, qd = plant.advance(q, qd, robot.gravity(q))
        # explicit treatment would multiply the speed by h b/M, 5 to 5e10, each step
        assert (np.linalg.norm(qd, axis=-1) <= first * (1 + 1e-9)).all()
    # b Δq is momentum lost, at most twice what was there (speeds may still alternate in sign)
    momentum = np.linalg.norm(robot.mass_matrix(start), 2, axis=(-2, -1)).max() * first.max()
    assert np.abs(q - start).max() < 4 * momentum / damping


@pytest.mark.parametrize("damping", [0.1, 10.0, 1e6])
def test_what_viscous_friction_takes_is_momentum(turntable, damping):
    disc = turntable.with_friction(Viscous([damping]))
    positions, speeds = travel(disc, [0.0], [2.0], [0.0], 0.05, 50)
    # J v + b q is constant along J v̇ = −b v, and the trapezoidal rule keeps it for any step
    kept = INERTIA * speeds[:, 0, 0] + damping * positions[:, 0, 0]
    assert_allclose(kept, 2.0 * INERTIA, rtol=1e-10)


def test_a_very_stiff_arm_sinks_at_the_speed_of_its_weight(arm):
    damping = 1e5
    stiff = arm.with_friction(Viscous([damping, damping]))
    q = np.array([1.0, 0.5])
    positions, _ = travel(stiff, q, [0.0, 0.0], 0.0, 0.05, 200)
    # b q̇ = −g(q): 10 s at 3e-4 rad/s change g by 1 %
    assert_allclose(positions[-1, 0] - q, -10.0 * arm.gravity(q) / damping, rtol=0.01)


# --- set-valued and smoothed friction agree -----------------------------------------------------------------


@pytest.fixture(scope="module")
def first_experiment(arm):
    """The paper's first experiment for 0.3 s, at two periods and their extrapolation to period 0."""
    controller = ExtendedMotionPlan(
        arm, Circle(np.deg2rad(57.3), np.deg2rad(114.59)), K_p=800.0, K_v=[45.0, 100.0], k=20.0
    )

    def positions(loop):
        run = simulate(controller, np.deg2rad([40.0, 70.0]), duration=0.3, loop=loop, progress=False)
        return run.array("q")[0][:: round(1e-2 / (run.time[1] - run.time[0]))]

    coarse, fine = (positions(SampledLoop(period=h, torque_limits=True)) for h in (5e-4, 2.5e-4))
    return positions, coarse, fine, 2 * fine - coarse


def smoothed(width):
    return ContinuousTime(output_period=1e-2, friction_width=width, torque_limits=True)


def test_smoothed_friction_tends_to_the_set_valued_one(first_experiment):
    positions, _, _, extrapolated = first_experiment
    widths = np.array([0.03, 0.01, 0.003])
    gaps = np.array([np.abs(positions(smoothed(w)) - extrapolated).max() for w in widths])
    # first order in the width: each is some three times narrower than the one before
    assert (gaps[:-1] / gaps[1:] > 2).all()
    assert gaps[-1] < 1e-3 * np.deg2rad(57.3)


def test_the_sampled_loop_tends_to_continuous_time_to_first_order(first_experiment):
    positions, coarse, fine, _ = first_experiment
    continuous = positions(smoothed(1e-3))
    gaps = [np.abs(sampled - continuous).max() for sampled in (coarse, fine)]
    # the hold delays the torque by half a period
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.1)
