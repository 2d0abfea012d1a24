"""Laps of closed paths: how they are counted, and what ends a run by them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats, tasks

from pathcontrol import Circle, ComputedTorque, ConstantRate, InputError, PathTask, Projection, simulate
from pathcontrol.simulation.finish import count_laps


@given(tasks(), st.integers(1, 3), floats(0, 6))
@settings(max_examples=8)
def test_laps_are_counted_from_the_start_of_the_plan(ideal_arm, task, laps, s):
    task = task.with_profile(ConstantRate(2 * task.period))  # a lap in half a second
    start = task.at(np.array(s))
    for law in (ComputedTorque(ideal_arm, task, 400.0, 40.0), Projection(ideal_arm, task, 400.0, 40.0)):
        run = simulate(law, start.q_d, start.velocity, duration=9.0, laps=laps, progress=False)
        gone = (run.array("s")[0] - run.array("s")[0, 0]) / task.period
        assert run.laps[0] == laps == round(gone[-1])
        assert run.status[0] == "finished"
        assert run.finish_time[0] == run.time[-1]
        assert gone[-2] < laps <= gone[-1]


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("laps", [None, 3])
def test_laps_of_a_plan_that_runs_away_are_counted_in_silence(ideal_arm, laps):
    class Racing(ComputedTorque):
        def law(self, t, q, qd, z):
            out = super().law(t, q, qd, z)
            return out._replace(sdot=1e22 + out.sdot, zdot=1e22 + out.zdot, slope=0.0 * out.slope)

    law = Racing(ideal_arm, Circle(0.5, 1.0), 100.0, 20.0)
    run = simulate(law, [0.5, 0.0], duration=0.01, laps=laps, engine="pinocchio", progress=False)
    assert run.laps[0] > 1e18
    s = np.array([1e300, -1e300, np.inf, np.nan, 7.0])
    assert count_laps(law.task, np.zeros(5), s).tolist() == [2**62, -(2**62), 0, 0, 1]


@pytest.mark.parametrize("clockwise", [False, True])
def test_laps_backwards_are_negative(ideal_arm, clockwise):
    class Backwards(ComputedTorque):
        def law(self, t, q, qd, z):
            out = super().law(t, q, qd, z)
            return out._replace(sdot=-out.sdot, zdot=-out.zdot, slope=-out.slope)

    task = Circle(0.5, 2.0, clockwise=clockwise)  # a lap in π/2 seconds
    for kind, laps in ((Backwards, -2), (ComputedTorque, 2)):
        run = simulate(kind(ideal_arm, task, 100.0, 20.0), [0.5, 0.0], duration=4.0, progress=False)
        assert run.laps[0] == laps
        assert run.status[0] == "running"
        assert np.isnan(run.finish_time[0])
        assert run.time[-1] == pytest.approx(4.0)


def test_a_path_without_end_runs_for_its_duration(ideal_arm):
    class Spiral(PathTask):
        def q_d(self, s):
            s = np.asarray(s)[..., None]
            return np.concatenate([np.cos(s), np.sin(s)], -1) * (0.5 + 0.02 * s)

        def theta(self, s):
            return 1.0

    run = simulate(ComputedTorque(ideal_arm, Spiral(), 100.0, 20.0), [0.5, 0.0], duration=0.5, progress=False)
    assert run.status[0] == "running"
    assert len(run.time) == 201
    with pytest.raises(InputError, match="not closed"):
        _ = run.laps
