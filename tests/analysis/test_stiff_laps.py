"""Floquet multipliers where modes are much faster than a lap: slow paths and large gains, with their closed forms."""

import numpy as np
import pytest

import pathcontrol as pc

ROBOT = pc.load_robot("cicese_2dof")
ROBOT = ROBOT.with_friction(pc.Viscous(ROBOT.friction.viscous))


def test_modes_that_are_much_faster_than_a_lap_have_their_closed_form():
    K_p, K_v = 1000.0, 100.0
    law = pc.ComputedTorque(ROBOT, pc.Circle(0.25, 0.06), K_p, K_v)
    roots = np.repeat(np.sort(np.roots([1.0, K_v, K_p]).real), 2)
    found = pc.floquet(law)
    assert found.stable
    assert np.sort(found.transverse.real) == pytest.approx(roots, rel=1e-3)


def test_the_plan_is_stable_in_continuous_time_with_a_very_large_gain():
    K_p, K_v, r, omega = 800.0, 60.0, 0.25, 8.0
    law = pc.ExtendedMotionPlan(ROBOT, pc.Circle(r, r * omega), K_p, K_v, k=1e6)
    # with k → ∞ s is the angle of the arm; with the radius r + x and the rate ω + y, linear in (x, ẋ, y),
    # ẍ = −K_v ẋ − (K_p − ω²)x + rωy and ẏ = −K_v y − K_v ω x/r − 2ω ẋ/r
    limit = [[0, 1, 0], [omega**2 - K_p, -K_v, r * omega], [-K_v * omega / r, -2 * omega / r, -K_v]]
    expected = -np.linalg.eigvals(np.array(limit)).real.max()
    assert pc.floquet(law).decay_rate == pytest.approx(expected, rel=1e-4)


def test_a_map_of_one_value_is_drawn():
    law = pc.ComputedTorque(ROBOT, pc.Circle(0.25, 2.0), 800.0, 60.0)
    found = pc.stability_map(law, {"K_v": [30.0], "K_p": [200.0, 300.0]}, progress=False)
    low, high = pc.stability_figure(found).axes[0].get_xlim()
    assert 0 < low < 30.0 < high
