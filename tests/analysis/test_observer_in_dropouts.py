"""The momentum observer through dropouts: measurements that did not come are no motion."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof").with_friction(None)
LAW = pc.ExtendedMotionPlan(ARM, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0], k=20.0)
LOST = ["ticks", "measurements"]
RATE = 2 * np.pi * 20.0


def moved(disturbance, duration=1.0, *, q=(1.0, 0.0), law=LAW, **loop):
    loop = pc.SampledLoop(**loop)
    return pc.simulate(law, q, duration=duration, until="duration", loop=loop, disturbance=disturbance, progress=False)


@pytest.mark.parametrize("what", LOST)
@pytest.mark.parametrize("probability", [1.0, 0.5])
@pytest.mark.parametrize("loop", [{}, {"velocity": "difference"}, {"delay": 1.3e-3}, {"filter_hz": 30.0}])
def test_nothing_is_seen_through_a_dropout_where_nothing_pushes(what, probability, loop):
    """What is left is the error of the cubic, of the fourth order in the gap: a hundredth of the frozen samples'."""
    r = pc.momentum_observer(moved(pc.Dropout(0.6, 0.1, what, probability=probability), **loop))
    assert np.abs(r).max() < (0.5 if "filter_hz" in loop else 0.1)


@pytest.mark.parametrize("what", LOST)
def test_a_push_beside_a_dropout_is_its_low_passed_value(what):
    A = np.array([3.0, 1.0])
    run = moved(pc.Dropout(0.6, 0.05, what) + pc.Push(A, 0.2, 0.2))
    rise, fall = (-np.expm1(-RATE * np.maximum(run.time - t, 0.0))[:, None] for t in (0.2, 0.4))
    # 0.01: of second order in the period, as without a dropout; 0.1: of the cubic over the gap
    error = np.abs(pc.momentum_observer(run)[0] - A * (rise - fall))
    assert error[run.time < 0.6].max() < 0.01
    assert error.max() < 0.1


def test_each_rollout_has_its_own_gaps():
    run = moved(pc.Dropout([0.2, 0.3], 0.05, "measurements") + pc.Push([2.0, 0.5]), 0.5, q=[[1.0, 0.0], [0.9, 0.1]])
    both = pc.momentum_observer(run)
    assert_allclose(both[:, -1], [[2.0, 0.5]] * 2, rtol=0, atol=0.05)
    assert_array_equal(pc.momentum_observer(run.rollout(1) if hasattr(run, "rollout") else run)[-1], both[1])


@pytest.mark.parametrize("what", LOST)
def test_a_push_through_a_gap_is_seen_as_its_mean_and_stays_to_an_end_that_never_comes(what):
    A = np.array([3.0, 1.0])
    through = pc.momentum_observer(moved(pc.Dropout(0.3, 0.05, what) + pc.Push(A), 0.5))[0]
    assert_allclose(through[100:], np.broadcast_to(A, through[100:].shape), rtol=0, atol=0.1)
    held = pc.momentum_observer(moved(pc.Dropout(0.3, np.inf, what) + pc.Push(A), 0.4))[0]
    assert_allclose(held[100:], np.broadcast_to(A, held[100:].shape), rtol=0, atol=0.01)


def test_an_arm_that_rests_outside_a_dropout_is_seen():
    """The same measurement twice is a measurement where nothing is lost: a push that begins then is not held away."""
    rest = pc.load_robot("cicese_2dof").with_friction(pc.Coulomb([50.0, 50.0]))
    law = pc.ExtendedMotionPlan(rest, pc.Line([1.0, 0.0], [1.1, 0.0], 1e-6), 1.0, 1.0, 1.0)
    run = moved(pc.Dropout(0.1, 0.05) + pc.Push([4.0, 0.0], 0.2), 0.6, law=law, encoders=True)
    seen = pc.momentum_observer(run)[0]
    assert_allclose(seen[-1], -run.array("tau")[0, -2] + rest.gravity(run.array("q")[0, -1]), rtol=0, atol=0.05)
