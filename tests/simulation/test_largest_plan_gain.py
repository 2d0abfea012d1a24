"""The largest usable gain of the plan in closed form, against simulations and Floquet multipliers."""

import re
import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.simulation.checks.plan_gain import largest_plan_gain, velocity_lag

H = 0.02
ARM = pc.load_robot("cicese_2dof").with_friction(None)
LOOPS = {
    "exact": {},
    "difference": {"velocity": "difference"},
    "filter": {"filter_hz": 10.0},
    "delay": {"delay": H},
    "all": {"velocity": "difference", "filter_hz": 10.0, "delay": H / 2},
}


def told(law, loop):
    q = law.task.q_d(np.array(law.task.s0))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pc.simulate(law, q, law.task.at(np.array(law.task.s0)).velocity, duration=2 * H, loop=loop, progress=False)
    return [str(one.message) for one in caught if "largest usable k" in str(one.message)]


def test_the_lag_of_a_measured_velocity():
    """Of v = at the difference, the filter and both are late by this time once the filter has settled."""
    for settings in LOOPS.values():
        loop = pc.SampledLoop(period=H, **settings)
        sensors = loop.sensors(ARM)
        reading = sensors.start(np.zeros((1, 2)), np.zeros((1, 2)))
        for t in H * np.arange(1, 200):
            reading = sensors.read(np.full((1, 2), t**2 / 2), np.full((1, 2), t), reading)
        assert t - reading.qd[0, 0] == pytest.approx(velocity_lag(loop), abs=1e-12)


@pytest.mark.parametrize("kind", LOOPS)
def test_the_gain_that_a_straight_path_with_growing_speed_bears(kind):
    """On q_d = us with ϑ = λs the kick is along the path, ‖q_d'‖‖r'‖ = λ: below twice the usable k the plan settles."""
    rate, along, loop = 0.8, np.array([0.8, 0.6]), pc.SampledLoop(period=H, **LOOPS[kind])
    task = pc.FunctionPath(
        lambda s: np.asarray(s)[..., None] * along,
        theta=lambda s: rate * np.asarray(s),
        derivative=lambda s: np.broadcast_to(along, (*np.shape(s), 2)),
        second_derivative=lambda s: np.zeros((*np.shape(s), 2)),
        theta_derivative=lambda s: np.full(np.shape(s), rate),
        s0=1.0,
    )
    usable = float(largest_plan_gain(task, loop, np.array([1.0, 2.0])))
    assert usable == pytest.approx(0.5 / (H * (H / 2 + velocity_lag(loop)) * rate))
    worst = []
    for share in (1.0, 1.8, 3.0):
        law = pc.ExtendedMotionPlan(ARM, task, 100.0, 15.0, share * usable)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pc.PathControlWarning)
            try:
                run = pc.simulate(law, along + 1e-3, rate * along, duration=3.0, loop=loop, progress=False)
                worst.append(np.abs(run.array("sdot")[0, -40:] / run.array("s")[0, -40:] / rate - 1).max())
            except pc.SimulationError:
                worst.append(np.inf)
    assert worst[0] < 0.7
    assert worst[1] < 1.5
    assert worst[2] > 50


@pytest.mark.parametrize("task", [pc.Circle(1.0, 2.0), pc.Ellipse([1.0, 0.6], speed=1.5)], ids=["circle", "ellipse"])
@pytest.mark.parametrize("kind", ["exact", "all"])
def test_with_the_largest_usable_gain_a_closed_path_is_stable(task, kind):
    loop = pc.SampledLoop(period=2 * H, **(LOOPS[kind] | ({"filter_hz": 5.0} if kind == "all" else {})))
    s = np.linspace(*task.sampled_interval, 65)
    law = pc.ExtendedMotionPlan(ARM, task, 40.0, 12.0, float(largest_plan_gain(task, loop, s)))
    assert pc.floquet(law, loop, settle=1).stable


@pytest.mark.parametrize("kind", LOOPS)
def test_simulate_says_the_largest_usable_gain(kind):
    loop, task = pc.SampledLoop(period=H, **LOOPS[kind]), pc.Circle(1.0, 2.0)
    usable = 0.5 / (H * (H / 2 + velocity_lag(loop)) * 2.0)
    assert told(pc.ExtendedMotionPlan(ARM, task, 100.0, 15.0, 0.999 * usable), loop) == []
    for law in (
        pc.ExtendedMotionPlan(ARM, task, 100.0, 15.0, 1.001 * usable),
        pc.SpeedOverride(pc.ExtendedMotionPlan(ARM, task, 100.0, 15.0, 1.001 * usable)),
    ):
        [said] = told(law, loop)
        assert float(re.search(r"largest usable k = (\S+) ", said).group(1)) == pytest.approx(usable, rel=5e-3)
        assert f"period is {H:g} s" in said
    several = pc.ExtendedMotionPlan(ARM, task, 100.0, 15.0, [1.0, 2 * usable, 1.5 * usable])
    assert "(rollout 1)" in told(several, loop)[0]
    assert told(pc.Projection(ARM, task, 100.0, 15.0), loop) == []
