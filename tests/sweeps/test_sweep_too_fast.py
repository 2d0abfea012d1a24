"""What is too fast for the period is told of a whole sweep, wherever it is among the samples, and once."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.simulation.checks.too_long import StepWarning

pytest.importorskip("pyarrow")

ROBOT = pc.load_robot("cicese_2dof")


def circle(p, samples):
    law = pc.ComputedTorque(ROBOT, pc.Circle(1.0, 2.0), p["K_p"][:, None], p["K_v"][:, None])
    return {"controller": law, "q": [[0.7, 1.2]] * len(samples), "duration": 0.01}


def told(folder, K_v, chunk, build=circle, **options):
    space = pc.Space.given({"K_p": np.full(len(K_v), 800.0), "K_v": np.array(K_v)})
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        pc.sweep(build, space, folder, metrics=["e_p_peak"], chunk=chunk, progress=False, **options)
    return [str(one.message) for one in found if issubclass(one.category, StepWarning)]


@pytest.mark.parametrize("chunk", [1, 3, 10])
@pytest.mark.parametrize("where", [0, 4, 9])
def test_gains_too_high_are_told_once_wherever_they_are(where, chunk, tmp_path):
    K_v = [100.0] * 10
    K_v[where] = 5000.0
    (sentence,) = told(tmp_path / "sweep", K_v, chunk)
    assert sentence.startswith(f"sample {where}: gains")
    assert "need a period below" in sentence


def test_gains_that_the_period_bears_are_not_told(tmp_path):
    assert told(tmp_path / "sweep", [50.0, 100.0, 200.0], 1) == []


def test_a_sweep_in_parts_numbers_its_samples_and_a_finished_one_says_nothing(tmp_path):
    def parts(p, samples):
        for rows in (np.arange(len(samples))[::2], np.arange(len(samples))[1::2]):
            if len(rows):
                yield rows, circle({name: values[rows] for name, values in p.items()}, samples[rows])

    def build(p, samples):
        return list(parts(p, samples))

    K_v = [100.0, 100.0, 60.0, 5000.0, 100.0]
    (sentence,) = told(tmp_path / "sweep", K_v, 2, build)
    assert sentence.startswith("sample 3: ")
    assert told(tmp_path / "sweep", K_v, 2, build, resume=True) == []


def test_a_kind_is_told_once_though_many_samples_have_it(tmp_path):
    (sentence,) = told(tmp_path / "sweep", [100.0, 3000.0, 4000.0, 5000.0, 6000.0], 1)
    assert sentence.startswith("sample 1: ")
