"""Motors with a share of their torque limits: what acts is the demand within what is left, for as long as it lasts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof")
LIMITS = ARM.limits.effort
LAW = pc.ExtendedMotionPlan(ARM, pc.Circle(1.0, 3.0), 800.0, [45.0, 100.0], 20.0)


def simulated(drop, law=LAW, q=(0.7, 1.2), **options):
    loop = options.pop("loop", pc.SampledLoop(torque_limits=True))
    return pc.simulate(law, q, duration=0.5, loop=loop, disturbance=drop, progress=False, **options)


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_what_acts_is_the_demand_within_the_limits_that_are_left(engine):
    factor = np.array([0.1, 0.4])
    run = simulated(pc.TorqueLimitDrop(factor, 0.1, 0.2), engine=engine)
    during = (run.time >= 0.1 - 1e-9) & (run.time < 0.3 - 1e-9)
    left = np.where(during[:, None], factor, 1.0) * LIMITS
    assert_array_equal(run.array("tau")[0], np.clip(run.array("tau_demand")[0], -left, left))
    assert (np.abs(run.array("tau")[0, during]).max(0) == factor * LIMITS).any()


def test_torques_that_are_on_their_way_are_limited_when_they_act():
    loop = pc.SampledLoop(torque_limits=True, delay=0.02)  # eight periods
    run = simulated(pc.TorqueLimitDrop(0.05, 0.1, 0.2), loop=loop)
    during = (run.time >= 0.1 - 1e-9) & (run.time < 0.3 - 1e-9)
    asked = np.clip(run.array("tau_demand")[0], -LIMITS, LIMITS)
    acts = np.concatenate([np.zeros((8, 2)), asked[:-8]])
    left = np.where(during[:, None], 0.05, 1.0) * LIMITS
    assert_array_equal(run.array("tau")[0], np.clip(acts, -left, left))


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_motors_without_torque_let_the_arm_fall_as_one_without_motors(engine):
    falling = simulated(pc.TorqueLimitDrop(0.0), engine=engine)
    q, qd, plant = np.array([[0.7, 1.2]]), np.zeros((1, 2)), pc.Plant(ARM, 2.5e-3)
    for _ in range(200):
        q, qd = plant.advance(q, qd, np.zeros((1, 2)))
    assert_allclose(falling.array("q")[0, -1], q[0], rtol=0, atol=1e-11)


@pytest.mark.parametrize("engine", ["compiled", "pinocchio"])
def test_a_dead_motor_has_no_torque_even_without_a_limit(engine):
    loop = pc.SampledLoop(torque_limits=[np.inf, LIMITS[1]])
    run = simulated(pc.TorqueLimitDrop([0.0, 1.0], 0.1, 0.1), loop=loop, engine=engine)
    dead = (run.time >= 0.1 - 1e-9) & (run.time < 0.2 - 1e-9)
    assert (run.array("tau")[0, dead, 0] == 0).all()
    assert_array_equal(run.array("tau")[0, ~dead, 0], run.array("tau_demand")[0, ~dead, 0])


def test_a_share_of_no_limit_is_told():
    with pytest.warns(pc.PathControlWarning, match="joint_1 has no torque limit"):
        simulated(pc.TorqueLimitDrop(0.5), loop=pc.SampledLoop(torque_limits=[np.inf, 10.0]))


def test_shares_are_of_what_is_left_in_a_run_that_is_weak_from_its_begin_to_its_end():
    weak = simulated(pc.TorqueLimitDrop(0.5))
    short = simulated(None, loop=pc.SampledLoop(torque_limits=0.5 * LIMITS))
    for name in ("tau_demand_ratio", "torque_limit_ratio"):
        assert_array_equal(pc.metrics(weak)[name], pc.metrics(short)[name])
    assert_array_equal(weak.array("tau_limit"), np.broadcast_to(0.5 * LIMITS, weak.array("tau").shape))
    assert "tau_limit" not in short


class Fading(pc.Disturbance):
    """Motors that get weaker and weaker from 0.1 s on."""

    def torque(self, t, q, qd):
        return np.zeros_like(q)

    def torque_factor(self, t):
        return None if 0.0 < t < 0.1 else np.array([[1.0 - t, 1.0], [1.0, 1.0 - 2 * t]])


def test_recorded_limits_are_those_that_act_whoever_lowers_them():
    run = simulated(pc.TorqueLimitDrop(0.2, [0.1, 0.2], 0.1) + Fading())
    left = np.broadcast_to(LIMITS, (2, len(run.time), 2)).copy()
    middle = run.time + 1.25e-3
    left[0, middle > 0.1, 0] *= 1.0 - middle[middle > 0.1]
    left[1, middle > 0.1, 1] *= 1.0 - 2 * middle[middle > 0.1]
    for rollout, start in enumerate([0.1, 0.2]):
        left[rollout, (middle > start) & (middle < start + 0.1)] *= 0.2
    assert_allclose(run.array("tau_limit"), left, rtol=0, atol=1e-12)
    assert_allclose(run.array("tau"), np.clip(run.array("tau_demand"), -left, left), rtol=0, atol=1e-12)


def test_drops_compose_and_each_rollout_has_its_own():
    factor, start = np.array([[0.5, 0.1], [0.2, 1.0]]), np.array([0.0, 0.2])
    drops = pc.TorqueLimitDrop(factor, start, 0.3) + pc.TorqueLimitDrop(0.5, 0.1, 0.3)
    together = simulated(drops)
    for i in range(2):
        alone = simulated(pc.TorqueLimitDrop(factor[i], start[i], 0.3) + pc.TorqueLimitDrop(0.5, 0.1, 0.3))
        assert_array_equal(together.array("q")[i], alone.array("q")[0])
    reference = simulated(drops, engine="pinocchio")
    assert_allclose(reference.array("q"), together.array("q"), rtol=0, atol=1e-11)
    both = (together.time >= 0.2 - 1e-9) & (together.time < 0.3 - 1e-9)
    assert (np.abs(together.array("tau")[:, both]) <= 0.5 * factor[:, None] * LIMITS).all()


def test_nothing_is_taken_from_motors_that_have_all():
    assert_array_equal(simulated(pc.TorqueLimitDrop(1.0)).array("q"), simulated(None).array("q"))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: pc.TorqueLimitDrop(1.5), "factor = 1.5, expected numbers from 0 to 1"),
        (lambda: pc.TorqueLimitDrop([0.5, -0.1]), "expected numbers from 0 to 1"),
        (lambda: simulated(pc.TorqueLimitDrop(0.5), loop=pc.SampledLoop()), "give torque_limits=True"),
        (lambda: simulated(pc.TorqueLimitDrop(0.5), loop=pc.ContinuousTime()), "continuous time cannot"),
        (lambda: simulated(pc.TorqueLimitDrop([0.5, 0.5, 0.5])), "TorqueLimitDrop"),
    ],
)
def test_what_cannot_be(make, said):
    with pytest.raises(pc.InputError, match=said):
        make()
