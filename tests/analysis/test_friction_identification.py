"""Friction that is identified from a run is the friction of the simulated arm."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pathcontrol as pc
from pathcontrol.errors import InputError, UnknownNameError


def exciting_run(robot, amplitudes, center, friction, duration=20.0, encoders=True, period=2e-3):
    """A run in which all joints go to and fro at several speeds, measured by encoders of 20 bits or exactly."""
    n = robot.n
    task = pc.Lissajous(amplitudes, list(range(3, n + 3)), 0.9 * n**0.5, phases=np.linspace(0.2, 2.0, n), center=center)
    arm = robot.with_friction(friction)
    law = pc.ComputedTorque(arm, task, K_p=400.0, K_v=40.0, friction="full")
    sensors = {"encoders": np.full(n, 2.0**20), "velocity": "difference", "filter_hz": 30.0} if encoders else {}
    loop = pc.SampledLoop(period=period, **sensors)
    return pc.simulate(law, task.q_d(np.array(0.0)), duration=duration, loop=loop, progress=False)


def arm_of(n):
    if n == 2:
        return pc.load_robot("cicese_2dof"), [0.8, 0.8], [0.2, 0.4]
    if n == 6:
        return pc.load_robot("ur5"), np.full(6, 0.6), [0.0, -1.2, 1.4, -0.2, 1.5, 0.0]
    fingers = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return pc.load_robot("panda", lock=fingers), np.full(7, 0.4), [0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.8]


@pytest.mark.parametrize("n", [2, 6, 7])
def test_viscous_and_coulomb_friction_of_20_s_with_encoders_is_known_within_2_percent(n):
    robot, amplitudes, center = arm_of(n)
    rng = np.random.default_rng(n)
    viscous, plus, minus = rng.uniform(0.02, 0.06, (3, n)) * robot.limits.effort
    run = exciting_run(robot, amplitudes, center, pc.Viscous(viscous) + pc.Coulomb(plus, minus))
    found = pc.identify_friction(run)
    assert not found.remarks
    for name, true in (("viscous", viscous), ("coulomb_forward", plus), ("coulomb_backward", minus)):
        assert found.coefficients[name] == pytest.approx(true, rel=0.02), name
        assert (np.abs(found.coefficients[name] - true) < 6 * found.errors[name] + 1e-3 * true).all(), name
    speeds = np.linspace(-1, 1, 5)[:, None] * np.ones(n)
    assert found.law.torque(speeds) == pytest.approx(
        (pc.Viscous(viscous) + pc.Coulomb(plus, minus)).torque(speeds), rel=0.02
    )


def test_the_friction_of_the_paper_s_arm_is_found_by_direction():
    robot, amplitudes, center = arm_of(2)
    found = pc.identify_friction(exciting_run(robot, amplitudes, center, robot.friction))
    viscous, coulomb = robot.friction.terms
    assert found.coefficients["viscous"] == pytest.approx(viscous.coefficients, rel=0.02)
    assert found.coefficients["coulomb_forward"] == pytest.approx(coulomb.plus, rel=0.02)
    assert found.coefficients["coulomb_backward"] == pytest.approx(coulomb.minus, rel=0.02)


def test_a_stribeck_curve_is_found():
    robot, amplitudes, center = arm_of(2)
    law = pc.Viscous([2.0, 0.3]) + pc.Stribeck([4.0, 0.8], [6.0, 1.3], [0.2, 0.3])
    found = pc.identify_friction(exciting_run(robot, amplitudes, center, law), form="stribeck")
    assert found.coefficients["viscous"] == pytest.approx([2.0, 0.3], rel=0.02)
    assert found.coefficients["coulomb"] == pytest.approx([4.0, 0.8], rel=0.02)
    assert found.coefficients["fall"] == pytest.approx([2.0, 0.5], rel=0.05)
    assert found.coefficients["velocity"] == pytest.approx([0.2, 0.3], rel=0.05)
    assert found.law.terms[1].static == pytest.approx([6.0, 1.3], rel=0.02)


def test_without_noise_the_fit_converges_with_the_square_of_the_period():
    robot, amplitudes, center = arm_of(2)

    def error(period):
        run = exciting_run(robot, amplitudes, center, pc.Viscous([1.0, 0.5]), 4.0, encoders=False, period=period)
        found = pc.identify_friction(run, form="viscous", measured=False, window=0.048)
        return np.abs(found.coefficients["viscous"] - [1.0, 0.5]).max()

    coarse, fine = error(4e-3), error(2e-3)
    assert fine < 1e-3
    assert 3.0 < coarse / fine < 5.0


@given(st.lists(st.floats(0.0, 3.0), min_size=6, max_size=6))
@settings(max_examples=5, deadline=None)
def test_no_coefficient_is_negative_and_absent_friction_is_none(values):
    robot, amplitudes, center = arm_of(2)
    law = pc.Viscous(values[:2]) + pc.Coulomb(values[2:4], values[4:])
    found = pc.identify_friction(exciting_run(robot, amplitudes, center, law, 10.0))
    for name, true in zip(found.coefficients, (values[:2], values[2:4], values[4:]), strict=True):
        assert (found.coefficients[name] >= 0).all()
        assert found.coefficients[name] == pytest.approx(true, rel=0.02, abs=0.05)


def test_rollouts_count_together():
    robot, amplitudes, center = arm_of(2)
    task = pc.Lissajous(amplitudes, [1, 2], 1.2, phases=[0.2, 2.0], center=center)
    law = pc.ComputedTorque(robot, task, K_p=400.0, K_v=40.0)
    start = task.q_d(np.array(0.0))
    run = pc.simulate(law, start + np.array([[0.0, 0.0], [0.1, 0.1], [-0.2, 0.1]]), duration=5.0, progress=False)
    each = [len(pc.identify_friction(run.rollout(i)).windows[0].torque) for i in range(3)]
    together = pc.identify_friction(run)
    assert len(together.windows[0].torque) == sum(each)
    assert (together.errors["viscous"] < pc.identify_friction(run.rollout(0)).errors["viscous"]).all()


def test_joints_that_were_not_excited_are_told():
    robot = pc.load_robot("cicese_2dof")
    law = pc.ComputedTorque(robot, pc.Line([0.0, 0.5], [2.0, 0.5], speed=1.0), K_p=800.0, K_v=60.0)
    run = pc.simulate(law, [0.0, 0.5], duration=2.5, progress=False)
    found = pc.identify_friction(run)
    assert set(found.remarks) == set(robot.joint_names)
    first, second = (found.remarks[name] for name in robot.joint_names)
    assert "moved backward in 0 windows" in first
    assert "windows" in second
    assert np.isnan(found.coefficients["viscous"]).all()
    with pytest.raises(InputError, match="moved backward") as told:
        _ = found.law
    assert told.value.joint == robot.joint_names[0]
    joints = found.to_dict()["joints"]
    assert joints[robot.joint_names[0]]["viscous"] is None
    assert joints[robot.joint_names[0]]["excited"] is False


def test_one_speed_does_not_tell_level_from_slope():
    robot = pc.load_robot("cicese_2dof").with_friction(pc.Viscous([1.0, 1.0]) + pc.Coulomb([1.0, 1.0]))
    there = pc.Line([0.0, 0.5], [2.0, 1.5], speed=1.0)
    back = pc.Line([2.0, 1.5], [0.0, 0.5], speed=1.0)
    tasks = pc.TaskBatch([there, back])
    law = pc.ComputedTorque(robot, tasks, K_p=800.0, K_v=60.0)
    rates = [task.dq_d(np.array(0.0)) for task in (there, back)]
    run = pc.simulate(law, [[0.0, 0.5], [2.0, 1.5]], rates, duration=2.0, progress=False)
    found = pc.identify_friction(run)
    assert all("level and slope look alike" in remark for remark in found.remarks.values())
    assert len(found.remarks) == 2


def test_bad_settings_are_told():
    robot, amplitudes, center = arm_of(2)
    run = exciting_run(robot, amplitudes, center, robot.friction, 0.5)
    for options in (
        {"window": 0.0},
        {"window": -1.0},
        {"window": 9.0},
        {"window": 1e-3},
        {"min_speed": 0.0},
        {"window": np.nan},
    ):
        with pytest.raises(InputError, match=next(iter(options))):
            pc.identify_friction(run, **options)
    with pytest.raises(UnknownNameError, match="dahl"):
        pc.identify_friction(run, form="dahl")
    with pytest.raises(InputError, match="joints"):
        pc.identify_friction(run, pc.load_robot("ur5"))
