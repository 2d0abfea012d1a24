"""An override that makes two rollouts of one start is questioned; one of as many starts, or a step, is not."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(0.3, 0.5, center=[0.2, 0.6])
START = [0.5, 0.6]


def law(k_p=400.0, override=1.0):
    return pc.SpeedOverride(pc.Projection(ARM, CIRCLE, k_p, 40.0), override)


def said(controller, q=START, **options):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = pc.simulate(controller, q, duration=0.05, progress=False, **options)
    return run, [str(one.message) for one in caught if "rollouts of one start" in str(one.message)]


@pytest.mark.parametrize("wrap", [lambda law: law, pc.Paced])
def test_one_step_without_its_brackets_is_questioned(wrap):
    run, (told,) = said(wrap(law(override=[2.0, 0.0])))
    assert run.rollouts == 2
    assert "a step to 0 at 2 s? Then give [[2, 0]]" in told


def test_steps_and_factors_of_as_many_rollouts_are_not():
    push = pc.Push(np.array([[1.0, 0.0], [0.0, 1.0]]), 0.01, 0.02)
    for controller, options in (
        (law(override=[[2.0, 0.0]]), {}),
        (law(override=0.5), {}),
        (law(override=lambda t: np.array([1.0, 0.5])), {}),
        (law(override=[0.5, 1.0, 1.5]), {}),
        (law(override=[2.0, 0.0]), {"q": np.tile(START, (2, 1))}),
        (law(override=[2.0, 0.0]), {"disturbance": push}),
    ):
        assert said(controller, **options)[1] == []


def test_a_file_is_questioned_too(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'duration = 0.05\nrobot.source = "cicese_2dof"\n'
        'task = { type = "circle", radius = 0.3, speed = 0.5, center = [0.2, 0.6] }\n'
        'controller = { type = "speed_override", override = [2.0, 0.0], law = { type = "projection", k_p = 400.0, '
        "K_v = 40.0 } }\n"
    )
    with pytest.warns(pc.PathControlWarning, match="rollouts of one start"):
        pc.run_experiment(path, tmp_path)
