"""Numbers that are rounding are shown as 0 in reports, on terminals and in films, and win nothing."""

from __future__ import annotations

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.analysis.readable import readable_number
from pathcontrol.view.report.run_summary import measure, rows

ARM = pc.load_robot("cicese_2dof")


@pytest.fixture(scope="module")
def runs():
    circle = pc.Circle(1.0, 2.0)
    laws = {
        "plan": pc.ExtendedMotionPlan(ARM, circle, 800.0, [45.0, 100.0], 20.0),
        "projection": pc.Projection(ARM, circle, 800.0, [45.0, 100.0]),
    }
    start = circle.q_d(np.array(0.0))
    return {name: pc.simulate(law, start, duration=0.5, progress=False) for name, law in laws.items()}


def row_of(runs, numbers, key):
    row, _ = rows(runs, {name: {"progress": [1.0], key: numbers[name]} for name in runs})  # progress comes last
    return {name: (cell.text, cell.best) for name, cell in zip(runs, row.cells, strict=True)}


def test_the_lag_of_the_projection_law_is_none(runs):
    values = {name: measure(run)["lag_error_peak"] for name, run in runs.items()}
    assert 0 < values["projection"][0] < 1e-12
    assert values["plan"][0] > 1e-6
    found = {row.label: row for row in rows(runs, {name: measure(run) for name, run in runs.items()})}
    cells = [row.cells for label, row in found.items() if "lag" in label]
    assert cells
    for plan, projection in cells:
        assert projection.text == "0"
        assert plan.text != "0"
        assert [plan.best, projection.best] == [False, False]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1e-3, 9.4e-14], [False, False]),
        ([1e-3, 2e-9], [False, True]),
        ([1e-3, 0.0], [False, True]),  # exactly: as of what settles at once
        ([3e-14, 9.4e-14], [False, False]),
    ],
)
def test_rounding_wins_no_star(runs, values, expected):
    numbers = {name: [value] for name, value in zip(runs, values, strict=True)}
    found = row_of(runs, numbers, "e_p_peak")
    assert [best for _, best in found.values()] == expected
    assert [text == "0" for text, _ in found.values()] == [abs(value) < 1e-9 for value in values]


def test_one_of_many_rollouts_that_is_no_rounding_is_shown(runs):
    found = row_of(runs, {name: [1e-14, 1e-3] for name in runs}, "e_p_peak")
    assert all(text.startswith("0.02865 (0 … ") for text, _ in found.values())


@pytest.mark.parametrize(
    ("value", "unit", "words"), [(9.4e-14, "rad", "0 deg"), (-1e-12, "N m", "0 N m"), (2e-9, "m", "0.002 µm")]
)
def test_a_number_that_is_rounding_reads_as_0(value, unit, words):
    assert readable_number(value, unit) == words
