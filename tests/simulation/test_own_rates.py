"""Rates that laws set along their path and for their energy: the period that bears them, where simulations lose it."""

import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.simulation.checks.too_long import StepWarning

PERIOD, CIRCLE = 2.5e-3, pc.Circle(1.0, 2.0)
BOUND = 2 / PERIOD  # an error times 1 − λh in each period


def transverse(arm, rate):
    return pc.TransverseLinearization(arm, CIRCLE, 100.0, 20.0, k_s=rate)


def passive(arm, rate):
    return pc.PassiveVelocityField(arm, CIRCLE, 10.0, 30.0, recharge=rate)


def last_error(law, slower=0.999):
    """The error of what decays at the rate, in the last of 100 periods, as a share of that at first."""
    begin = CIRCLE.at(np.zeros(1))
    run = pc.simulate(law, begin.q_d[0], slower * begin.velocity[0], duration=100 * PERIOD, progress=False)
    if isinstance(law, pc.TransverseLinearization):
        return abs(run.array("sdot")[0, -1] - 2.0) / (2.0 * (1 - slower))
    energy = law.augmented_energy(run.array("q"), run.array("qd"), pc.law_states(run, law))[0]
    return abs(energy[-1] / law.energy - 1)


@pytest.mark.parametrize("make", [transverse, passive])
def test_the_bound_that_is_told_is_where_errors_begin_to_grow(ideal_arm, make):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        below = last_error(make(ideal_arm, 0.97 * BOUND))
    with pytest.warns(StepWarning, match=f"too fast for a period of {PERIOD:g} s"):
        above = last_error(make(ideal_arm, 1.03 * BOUND))
    assert below < 0.1
    assert above > 100 * below


def test_intervals_shorter_than_the_period_are_told(ideal_arm):
    pytest.importorskip("casadi")
    law = pc.PathMPC(ideal_arm, CIRCLE, horizon=0.2, intervals=4)
    start = {"duration": 0.05, "progress": False}
    with pytest.warns(StepWarning, match="longer than an interval of PathMPC, 0.05 s"):
        pc.simulate(law, [0.99, 0.0], loop=pc.SampledLoop(0.06, substeps=20), **start | {"duration": 0.06})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pc.simulate(law, [0.99, 0.0], loop=pc.SampledLoop(0.05, substeps=20), **start)


def fastest_of_a_pace(arm, period):
    """The largest factor of the speed of a paced law from rest, and its last difference to 1."""
    law = pc.Paced(pc.Projection(arm, pc.Circle(0.5, 1.0), k_p=20.0, K_v=8.0))
    loop, start = pc.SampledLoop(period, substeps=20), law.task.q_d(np.zeros(()))
    w = pc.simulate(law, start, duration=40 * period, loop=loop, progress=False).array("sdot")[0] / 2.0
    return w.max(), abs(w[-1] - 1)


def test_a_pace_goes_beyond_what_is_asked_for_only_with_a_word(ideal_arm):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fastest, late = fastest_of_a_pace(ideal_arm, 0.02)
    assert fastest < 1.001
    assert late < 0.02
    with pytest.warns(StepWarning, match="goes beyond the speed that is asked for; shorten the period"):
        fastest, late = fastest_of_a_pace(ideal_arm, 0.03)
    assert fastest > 1.4
    assert late < 0.05
    with pytest.warns(StepWarning, match="pace of Paced .* is likely to be unstable"):
        fastest, late = fastest_of_a_pace(ideal_arm, 0.045)
    assert late > 0.5
