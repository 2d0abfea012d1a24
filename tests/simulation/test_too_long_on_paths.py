"""Warnings of steps on several paths: one of each kind, of the worst path, with the number of paths."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.errors import SimulationError
from pathcontrol.simulation.checks.too_fast import TooFast, gather_paths
from pathcontrol.simulation.checks.too_long import StepWarning

ARM = pc.load_robot("cicese_2dof")


def laws_on(speeds, k=1e5):
    """One lap of a circle for each of the speeds."""
    return [pc.ExtendedMotionPlan(ARM, pc.Circle(0.3, v, center=[0.2, 0.6]), 800.0, 45.0, k=k) for v in speeds]


def said(laws, q=(0.5, 0.6), **options):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            pc.simulate_sequence(laws, list(q), duration=0.2, laps=1, progress=False, **options)
        except SimulationError as error:
            return [str(one.message) for one in caught if one.category is StepWarning], str(error)
    return [str(one.message) for one in caught if one.category is StepWarning], ""


def test_one_warning_tells_the_paths_and_the_worst_of_them():
    (told,), _ = said(laws_on([0.1, 6.0, 0.1, 8.0, 7.0]))
    assert told.endswith("so it is on 3 of 5 paths, the worst of which is path 3, counted from 0")
    (alone,), _ = said(laws_on([8.0]))
    assert told.startswith(alone)
    (one,), _ = said(laws_on([0.1, 8.0]))
    assert one == f"{alone}; so it is on path 1 of 2, counted from 0"
    assert said(laws_on([0.1, 0.1])) == ([], "")


def test_a_run_that_diverges_says_the_same_once():
    laws = [pc.ComputedTorque(ARM, pc.Circle(0.3, v, center=[0.2, 0.6]), 1e9, 1e6) for v in (0.5, 0.6, 0.7)]
    told, error = said(laws, q=(0.8, 0.6))
    assert len(told) == 1
    assert told[0] in error
    assert len(re.findall("need a period below", error)) == 1


def test_kinds_stay_apart_and_each_has_its_worst_path():
    rng = np.random.default_rng(0)
    found = [[TooFast(f"kind {k}", rng.random(), f"{k} on {path}") for k in "ab"] for path in range(7)]
    sentences = list(gather_paths(found))
    assert len(sentences) == 2
    for k, sentence in enumerate(sentences):
        worst = int(np.argmax([each[k].excess for each in found]))
        assert sentence.startswith(f"{'ab'[k]} on {worst}; so it is on 7 of 7 paths")
        assert f"path {worst}," in sentence
    assert list(gather_paths([[], []])) == []


@pytest.mark.parametrize("paths", [1, 2])
def test_what_is_on_no_path_but_one_names_it(paths):
    found = [[TooFast("a", 2.0, "too fast")], *[[]] * (paths - 1)]
    assert list(gather_paths(found)) == [
        "too fast" if paths == 1 else "too fast; so it is on path 0 of 2, counted from 0"
    ]
