"""Observers in continuous time: as accurate as the integrator, and at no more than a few times the work."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof").with_friction(None)
TASK = pc.Circle(1.0, 2.0)


def plan(**options):
    return pc.ExtendedMotionPlan(ARM, TASK, 800.0, [45.0, 100.0], 20.0, **options)


def run_counted(law, monkeypatch, q=(1.0, 0.0), **options):
    """A run from a start at rest, and how often the law was asked."""
    asked, ask = [0], type(law).law

    def count(self, *arguments):
        asked[0] += 1
        return ask(self, *arguments)

    monkeypatch.setattr(type(law), "law", count)
    run = pc.simulate(law, q, duration=0.35, loop=pc.ContinuousTime(**options), progress=False)
    monkeypatch.undo()
    return run, asked[0]


@pytest.mark.parametrize(
    "law",
    [plan(friction="observed"), pc.EventPlan(plan()), pc.EventPlan(pc.Projection(ARM, TASK, 800.0, [45.0, 100.0]))],
    ids=["observed", "event plan", "event plan of projection"],
)
def test_an_observer_that_sees_nothing_costs_little_and_changes_nothing(law, monkeypatch):
    """It cost 20 times the work, and nearly all of it went into an estimate of 1e-7 N m."""
    plain = pc.Projection(ARM, TASK, 800.0, [45.0, 100.0]) if "Projection" in repr(law) else plan()
    calm, few = run_counted(plain, monkeypatch)
    seen, many = run_counted(law, monkeypatch)
    assert many < 5 * few
    # an acceleration of K rtol = 2e-6 rad/s² over k_p = 800 1/s², and what the integrator adds up along the path
    np.testing.assert_allclose(seen.array("q"), calm.array("q"), rtol=0, atol=1e-6)


def test_the_tolerances_hold_the_estimate_too(monkeypatch):
    push = pc.Push([3.0, 1.0], 0.15, 0.15)
    options = {"duration": 0.4, "disturbance": push, "progress": False}
    loose, tight = (
        pc.simulate(plan(friction="observed"), [[1.0, 0.0], [0.9, 0.1]], loop=loop, **options)
        for loop in (pc.ContinuousTime(), pc.ContinuousTime(rtol=1e-11, atol=1e-13))
    )
    np.testing.assert_allclose(loose.array("q"), tight.array("q"), rtol=0, atol=1e-6)
    # K diag M rtol is 5e-6 N m, which the estimate has from some steps
    np.testing.assert_allclose(loose.array("tau_demand"), tight.array("tau_demand"), rtol=0, atol=1e-3)
