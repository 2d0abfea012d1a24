"""Transverse feedback linearisation: linear equations beside and along the path, apart from each other."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from random_arms import random_arm
from scipy.integrate import solve_ivp

import pathcontrol as pc
from pathcontrol.control.reference_law import differentiate_along
from pathcontrol.errors import InputError
from pathcontrol.simulation.continuous import ClosedLoop

K_P, K_V, K_S = 100.0, 8.0, 5.0  # underdamped, so that ξ changes its sign
TIME = 0.3


def law_on(robot, task):
    return pc.TransverseLinearization(robot, task, K_P, K_V, K_S)


def integrate(law, q, qd):
    """Return time, q, q̇ and σ̄ of the closed loop in continuous time."""
    loop = ClosedLoop(law, law.robot, pc.ContinuousTime())
    start = np.concatenate([q, qd, law.start(q, qd)])
    options = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-10}
    found = solve_ivp(lambda t, y: loop.rate(t, y[None])[0], (0, TIME), start, **options)
    q, qd, z = loop.split(found.y.T)
    return found.t, q, qd, law.task.sigma_bar(q, near=z[:, 0])


def beside(law, s, size, rate, across):
    """A state beside the path at s, which moves along it by the ``rate`` σ̄̇: q − q_d = size·m, q̇ = …t + across·m."""
    point = law.task.at(np.array([s]))
    slope, m = point.dq_d[0], np.arange(1.0, law.robot.n + 1) - 1.3
    m -= slope * (slope @ m) / (slope @ slope)
    m /= np.linalg.norm(m)
    D = slope @ slope - size * m @ point.ddq_d[0]
    return point.q_d[0] + size * m, rate * D / (slope @ slope) * slope + across * m


def free_motion(t, x, v):
    """The solution of ẍ + k_v ẋ + k_p x = 0."""
    decay, omega = K_V / 2, np.sqrt(K_P - K_V**2 / 4)
    return np.exp(-decay * t) * (x * np.cos(omega * t) + (v + decay * x) / omega * np.sin(omega * t))


def arm_of(n):
    return random_arm(3, n, branched=False, kinds=("revolute",))


def path_of(n):
    return pc.Lissajous(np.full(n, 0.8), [1, 2, 1, 3, 2][:n], 1.0, phases=np.linspace(0.1, 2.0, n))


# --- the theorem --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2, 5])
def test_the_distance_to_the_path_is_that_of_a_linear_oscillator(n):
    law = law_on(arm_of(n), path_of(n))
    size, across = 0.04, -0.3
    t, q, _, s = integrate(law, *beside(law, 0.7, size, 0.4, across))
    distance = np.linalg.norm(q - law.task.q_d(s), axis=-1)
    assert_allclose(distance, np.abs(free_motion(t, size, across)), atol=1e-8)
    assert distance.min() < 0.2 * size < 0.5 * distance.max()


def test_the_speed_comes_to_the_profile_as_it_says_whatever_is_beside_the_path(ideal_arm):
    law, rates = law_on(ideal_arm, pc.Ellipse((1.0, 0.6), 1.5)), []
    for size, across in ((0.0, 0.0), (0.1, -0.5)):
        t, q, qd, s = integrate(law, *beside(law, 0.4, size, 0.3, across))
        point = law.task.at(s)
        D = (point.dq_d**2).sum(-1) + ((point.q_d - q) * point.ddq_d).sum(-1)
        lead = (point.dq_d * qd).sum(-1) / D - point.theta
        assert_allclose(lead, lead[0] * np.exp(-K_S * t), atol=1e-7)
        rates.append(lead[0])
    assert rates[0] == pytest.approx(rates[1])  # they began alike
    assert rates[0] < -0.5


@pytest.mark.parametrize("speed", [0.0, -1.5, 4.0])
def test_the_path_is_invariant_at_any_speed(ideal_arm, speed):
    law = law_on(ideal_arm, pc.Lissajous([0.8, 0.5], [1, 2], 1.2, phases=[0.3, 0.1]))
    _, q, _, s = integrate(law, *beside(law, 0.4, 0.0, speed, 0.0))
    assert_allclose(q, law.task.q_d(s), atol=1e-9)


def test_its_multipliers_on_the_circle_are_those_of_the_two_equations(ideal_arm):
    found = pc.floquet(law_on(ideal_arm, pc.Circle(1.0, 2.0)))
    pair = np.roots([1.0, K_V, K_P])
    for exponent in (*pair.real, -K_S):
        assert np.abs(found.exponents.real - exponent).min() < 1e-5


# --- at the ends, and what is refused -----------------------------------------------------------------------------


def test_the_third_derivative_is_taken_inside_an_open_path(ideal_arm):
    path = pc.WaypointPath([[0.0, 0.0], [0.5, 0.2], [0.8, 0.9], [0.4, 1.2]], 1.0)
    law = law_on(ideal_arm, path)
    s = np.array([path.s0, path.s_end])
    for n, third in enumerate(differentiate_along(path.ddq_d, path, s).T):
        inside = np.polyfit(t := np.linspace(0, 1e-3, 9), path.ddq_d(t)[:, n], 2)[1]
        assert third[0] == pytest.approx(inside, rel=1e-2, abs=1e-2)
    run = pc.simulate(law, path.q_d(s[0]), duration=0.1, progress=False)
    assert run.norm("e_p").max() < 1e-3


def test_gains_that_are_none_are_refused(ideal_arm, circle):
    with pytest.raises(InputError, match=r"k_s = 0.0, expected gains greater than 0"):
        pc.TransverseLinearization(ideal_arm, circle, K_P, K_V, 0.0)
    with pytest.raises(InputError, match=r"k_p = \[800.0, 600.0\], expected one number for all joints"):
        pc.TransverseLinearization(ideal_arm, circle, [800.0, 600.0], K_V, K_S)
