"""Passive velocity field control: arm and flywheel have the energy that was pushed into them, and move as the field."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from strategies import floats, tasks, vectors

import pathcontrol as pc
from pathcontrol.errors import InputError
from pathcontrol.simulation.continuous import ClosedLoop

GAINS = {"Lambda": 10.0, "K_v": 30.0}


def regular(task, q, least=0.05):
    s = task.sigma_bar(q)
    d = task.dq_d(s)
    return d @ d + (task.q_d(s) - q) @ task.ddq_d(s) > least * d @ d


def law_near(robot, task, short, **options):
    """A law with the least energy that its path allows, times a factor."""
    law = pc.PassiveVelocityField(robot, task, **GAINS, **options)
    return pc.PassiveVelocityField(robot, task, **GAINS, energy=short * law.energy, **options)


# --- passivity ----------------------------------------------------------------------------------------------------


def energy_rate(law, q, qd, z, push):
    """dk̄/dt of an arm without friction that is pushed, from its acceleration and the law's df/dt; the scale of it."""
    out = law.law(0.0, q, qd, z)
    qdd, h = law.robot.forward_dynamics(q, qd, out.tau + push), 1e-6
    M_rate = (law.robot.mass_matrix(q + h * qd) - law.robot.mass_matrix(q - h * qd)) / (2 * h)
    rate = qd @ law.robot.mass_matrix(q) @ qdd + 0.5 * qd @ M_rate @ qd + z[1] * out.zdot[1]
    return rate, 1 + np.abs(qd @ push) + np.abs(qd @ out.tau) + np.abs(z[1] * out.zdot[1])


@settings(max_examples=12)
@given(tasks(), vectors(2, 2), vectors(2, 4), floats(-9, 9), vectors(2, 20), floats(0.3, 3))
def test_the_energy_changes_by_what_pushes_the_arm_alone(arm, task, q, qd, f, push, short):
    assume(regular(task, q))
    law = law_near(arm.with_friction(None), task, short)
    z = law.start(q, qd)
    z[1] = f
    rate, scale = energy_rate(law, q, qd, z, push)
    assert abs(rate - qd @ push) < 1e-7 * scale  # of the difference of M


def test_the_recharge_has_the_power_that_it_says(arm, circle):
    law = pc.PassiveVelocityField(arm.with_friction(None), circle, **GAINS, recharge=7.0)
    q, qd = np.array([0.5, 0.9]), np.array([-1.0, 0.3])
    z = law.start(q, qd)
    z[1] *= 0.7
    lacking = law.energy - law.augmented_energy(q, qd, z)
    power = 7.0 * lacking * inner_product(law, q[None], qd[None], z[None])[0] / (2 * law.energy)
    assert energy_rate(law, q, qd, z, np.zeros(2))[0] == pytest.approx(power, rel=1e-6)


@pytest.mark.parametrize("beta", [-3.0, -1.5, -0.5, 0.0, 3**-0.5, 0.9, 1.2, 3.0])
def test_the_recharge_takes_what_is_too_much_and_gives_no_more_than_it_says(arm, circle, beta):
    law = pc.PassiveVelocityField(arm.with_friction(None), circle, **GAINS, recharge=7.0)
    s = np.array(0.4)
    q, field = circle.q_d(s), circle.dq_d(s) * circle.theta(s)
    z = np.array([s, beta * law.start(q, field)[1]])  # a multiple of the field, also against it
    power = 7.0 * law.energy * (1 - beta**2) * (abs(beta) if abs(beta) > 1 else beta)
    assert energy_rate(law, q, beta * field, z, np.zeros(2))[0] == pytest.approx(power, rel=1e-6, abs=1e-6)
    assert power <= 7.0 * law.energy * 2 / np.sqrt(27) + 1e-9


def test_energy_is_constant_and_the_motion_comes_to_the_field_by_its_closed_form(ideal_arm):
    law = pc.PassiveVelocityField(ideal_arm, pc.Ellipse((1.0, 0.6), 1.5), **GAINS)
    q, qd = np.array([0.7, 0.9]), np.array([-1.0, 0.5])
    loop, start = ClosedLoop(law, ideal_arm, pc.ContinuousTime()), law.start(q, qd)
    start[1] *= 0.8  # less energy than the field has, so that β is another than 1
    found = solve_ivp(
        lambda t, y: loop.rate(t, y[None])[0],
        (0, 0.4),
        np.concatenate([q, qd, start]),
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
    )
    q, qd, z = loop.split(found.y.T)
    k = law.augmented_energy(q, qd, z)
    assert_allclose(k, k[0], rtol=1e-9)
    x, E = inner_product(law, q, qd, z), law.energy
    rate = law.K_v / (2 * E) * 2 * np.sqrt(E * k[0])
    bound = 2 * np.sqrt(E * k[0])
    assert_allclose(x, bound * np.tanh(rate * found.t + np.arctanh(x[0] / bound)), rtol=1e-8)


def inner_product(law, q, qd, z):
    """V̄ᵀM̄q̄̇, written down from the definition of the field, at states near the path."""
    s = law.task.sigma_bar(q, near=z[:, 0])
    e_p = law.task.q_d(s) - q
    V = law.task.dq_d(s) * law.task.theta(s)[:, None]
    V = V + law.Lambda * e_p / np.sqrt(1 + (law.Lambda / law.approach) ** 2 * (e_p**2).sum(-1, keepdims=True))
    MV = np.einsum("kij,kj->ki", law.robot.mass_matrix(q), V)
    V_f = np.sqrt(2 * law.energy - (V * MV).sum(-1))
    return (MV * qd).sum(-1) + V_f * z[:, 1]


def test_in_a_sampled_loop_the_energy_drifts_by_the_order_of_the_period(ideal_arm, circle):
    law, drifts = pc.PassiveVelocityField(ideal_arm, circle, **GAINS), []
    for period in (4e-3, 2e-3):
        run = pc.simulate(law, [0.9, 0.2], duration=0.2, loop=pc.SampledLoop(period), progress=False)
        k = law.augmented_energy(run.array("q")[0], run.array("qd")[0], pc.law_states(run, law)[0])
        drifts.append(k[-1] - k[0])
    assert abs(drifts[0]) < 0.02 * law.energy
    assert drifts[0] / drifts[1] == pytest.approx(2.0, rel=0.1)


# --- the field ----------------------------------------------------------------------------------------------------


@settings(max_examples=12)
@given(tasks(), vectors(2, 2), vectors(2, 4))
def test_the_rate_of_the_field_is_its_derivative_along_the_motion(ideal_arm, task, q, qd):
    assume(regular(task, q, 0.3))
    law, h = pc.PassiveVelocityField(ideal_arm, task, **GAINS), 1e-6
    s = law.start(q, qd)[..., :1]

    def field(q):
        here = law.locate(q, qd, s[..., 0])
        return law.velocity(here, qd, here.found.rate(qd, qd))

    difference = (field(q + h * qd)[0] - field(q - h * qd)[0]) / (2 * h)
    assert_allclose(field(q)[1], difference, rtol=1e-4, atol=1e-4 * (1 + np.abs(difference).max()))


def test_an_arm_that_starts_on_the_path_stays_on_it_at_the_speed_of_the_profile(ideal_arm):
    task = pc.Lissajous([0.8, 0.5], [1, 2], 1.2, phases=[0.3, 0.1])
    law, point = pc.PassiveVelocityField(ideal_arm, task, **GAINS), task.at(np.array([0.4]))
    loop = pc.ContinuousTime(rtol=1e-11, atol=1e-11)
    run = pc.simulate(law, point.q_d, point.velocity, duration=0.25, loop=loop, progress=False)
    assert np.abs(run.array("e_p")).max() < 1e-8
    assert np.abs(run.array("e_v")).max() < 1e-7


def test_far_away_the_field_is_made_shorter_and_goes_on_without_a_jump(ideal_arm, circle):
    law = law_near(ideal_arm, circle, 0.5)
    away = np.linspace(1.0, 3.0, 400)[:, None] * np.array([np.cos(0.5), np.sin(0.5)])
    qd, z = np.zeros_like(away), law.start(away, np.zeros_like(away))
    tau = law.law(0.0, away, qd, z).tau - ideal_arm.gravity(away)
    assert np.isfinite(tau).all()
    assert np.abs(np.diff(tau, axis=0)).max() < 0.03 * np.abs(tau).max()


# --- what is refused ----------------------------------------------------------------------------------------------


def test_too_little_energy_and_gains_that_are_none_are_refused(ideal_arm, circle):
    with pytest.raises(InputError, match=r"energy = 1.0 J, but the arm may need .* J at the speed of the task"):
        pc.PassiveVelocityField(ideal_arm, circle, **GAINS, energy=1.0)
    with pytest.raises(InputError, match=r"K_v = 0.0, expected gains greater than 0"):
        pc.PassiveVelocityField(ideal_arm, circle, Lambda=1.0, K_v=0.0)
    with pytest.raises(InputError, match=r"recharge = -1.0, expected 0 or more"):
        pc.PassiveVelocityField(ideal_arm, circle, **GAINS, recharge=-1.0)


def test_one_start_serves_rollouts_of_several_energies(arm, circle):
    law = pc.PassiveVelocityField(arm, circle, **GAINS, energy=[[20.0], [40.0]], recharge=5.0)
    both = pc.simulate(law, [0.9, 0.1], duration=0.05, progress=False).array("q")
    for energy, row in zip((20.0, 40.0), both, strict=True):
        alone = pc.PassiveVelocityField(arm, circle, **GAINS, energy=energy, recharge=5.0)
        run = pc.simulate(alone, [0.9, 0.1], duration=0.05, progress=False)
        np.testing.assert_array_equal(run.array("q")[0], row)
