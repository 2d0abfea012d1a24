"""Times of loops that are probably in milliseconds are questioned once, and others are not."""

from __future__ import annotations

import warnings

import pytest

import pathcontrol as pc
from pathcontrol.experiments.runner import load_setup

ARM = pc.load_robot("cicese_2dof")


def law(kind="plan"):
    plan = pc.ExtendedMotionPlan(ARM, pc.Lissajous([0.3, 0.3], [1, 2], 0.5, center=[0.2, 0.4]), 400.0, 40.0, k=5.0)
    return plan if kind == "plan" else pc.SpeedOverride(plan)


def told(make):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make()
    return [str(one.message) for one in caught if issubclass(one.category, pc.PathControlWarning)]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: pc.ControlLoop(law(), period=2), "period = 2 s .* 2 ms.* 0.002"),
        (lambda: pc.ControlLoop(law("override"), period=2), "period = 2 s .* 2 ms.* 0.002"),
        (lambda: pc.ControlTick(law(), period=1.0), "period = 1 s .* 1 ms"),
        (lambda: pc.PositionCommand(law(), period=8), "period = 8 s .* 8 ms"),
        (lambda: pc.PositionCommand(law(), period=2e-3, lag=100), "lag = 100 s .* 100 ms.* 0.1"),
        (lambda: pc.PositionCommand(law(), period=2e-3, lag=[0.1, 50.0]), "lag = 50 s"),
        (lambda: pc.SampledLoop(period=2.5), "period = 2.5 s .* 2.5 ms.* 0.0025"),
        (lambda: pc.SampledLoop(delay=5), "delay = 5 s .* 5 ms"),
    ],
)
def test_milliseconds_are_questioned_once(make, said):
    with pytest.warns(pc.PathControlWarning, match=said):
        make()
    assert len(told(make)) == 1


@pytest.mark.parametrize("period", [5e-4, 1e-3, 8e-3, 0.02, 0.1])
def test_periods_of_loops_are_not(period):
    assert told(lambda: pc.ControlLoop(law(), period)) == []
    assert told(lambda: pc.PositionCommand(law(), period, lag=0.3)) == []
    assert told(lambda: pc.SampledLoop(period, delay=period)) == []


def test_a_file_is_questioned_too(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'duration = 5.0\nrobot.source = "cicese_2dof"\nloop.period = 2.5\n'
        'task = { type = "circle", radius = 0.3, speed = 0.5 }\n'
        'controller = { type = "projection", k_p = 4.0, K_v = 4.0 }\n'
    )
    assert any("or '2.5 ms' in a file" in one for one in told(lambda: load_setup(path)))
