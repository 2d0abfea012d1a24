"""Pareto fronts: no point of one is dominated, and every other point is dominated by one of it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pathcontrol import InputError, UnknownNameError, non_dominated, pareto_figure, save_figure
from pathcontrol.sweeps.objectives import check_limits, check_objectives, costs, excess, front, within

# few different values, so that there are ties and duplicates; and any numbers at all
VALUES = st.one_of(
    st.integers(0, 4).map(float),
    st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -0.0]),
    st.floats(-1e300, 1e300, allow_subnormal=True),
)
TABLES = st.tuples(st.integers(0, 30), st.integers(1, 4)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=VALUES)
)


def dominates(a, b):
    return (a <= b).all(-1) & (a < b).any(-1)


@given(TABLES)
def test_the_set_is_what_nothing_dominates_and_everything_else_is_dominated_by_it(values):
    best = non_dominated(values)
    known = np.isfinite(values).all(1)
    assert not best[~known].any()
    for row in np.flatnonzero(known):
        assert best[row] == (not dominates(values[known], values[row]).any())
        assert best[row] or dominates(values[best], values[row]).any()


@given(TABLES, st.randoms(use_true_random=False))
def test_it_does_not_depend_on_the_order_of_rows_or_columns(values, random):
    best = non_dominated(values)
    order = random.sample(range(len(values)), len(values))
    columns = random.sample(range(values.shape[1]), values.shape[1])
    np.testing.assert_array_equal(non_dominated(values[order][:, columns]), best[order])
    doubled = np.concatenate([values, values])
    np.testing.assert_array_equal(non_dominated(doubled), np.concatenate([best, best]))


@pytest.mark.parametrize("d", [3, 4])
def test_more_points_than_are_compared_at_once(d):
    rng = np.random.default_rng(d)
    values = rng.random((1600, d))
    values[:800] /= values[:800].sum(1, keepdims=True)  # on a plane, where nothing dominates anything else
    values[800:] += 1 / d  # above it
    best = non_dominated(values)
    assert best[:800].all()
    expected = [not dominates(values, row).any() for row in values]
    np.testing.assert_array_equal(best, expected)


def test_what_is_no_table_is_refused():
    with pytest.raises(InputError, match=r"values has shape \(3,\), expected \(N, d\)"):
        non_dominated([1.0, 2.0, 3.0])


def table(rows=60, seed=0):
    rng = np.random.default_rng(seed)
    status = np.where(rng.random(rows) < 0.1, "diverged", "running")
    numbers = {name: np.where(status == "diverged", np.nan, rng.uniform(0.1, 1.0, rows)) for name in ("e_p_peak", "b")}
    data = {"status": ("sample", status)} | {name: ("sample", v) for name, v in numbers.items()}
    data["e_p_peak"] = ("sample", numbers["e_p_peak"], {"units": "rad"})
    q = rng.normal(size=(rows, 2))
    coords = {"sample": np.arange(rows), "k": ("sample", rng.uniform(1, 9, rows)), "q": (("sample", "q component"), q)}
    return xr.Dataset(data, coords)


def test_a_front_is_in_order_and_keeps_limits():
    data = table()
    best = front(data, {"e_p_peak": "min", "b": "max"})
    assert (np.diff(best["e_p_peak"]) > 0).all()
    assert (np.diff(best["b"]) > 0).all()
    assert "diverged" not in best["status"]
    held = front(data, ["e_p_peak", "b"], {"b": (0.3, 0.5)})
    assert held["b"].min() >= 0.3
    assert held["b"].max() <= 0.5
    alone = front(data, "e_p_peak", {"b": 0.5})
    allowed = data["e_p_peak"].where(data["b"] <= 0.5)
    assert alone["sample"].item() == int(np.nanargmin(allowed.to_numpy()))


def test_limits_are_kept_or_exceeded_by_a_share():
    values = np.array([0.0, 1.0, 2.0, 3.0, np.nan, np.inf])
    np.testing.assert_array_equal(excess(values, (-np.inf, 2.0)), [-1, -0.5, 0, 0.5, np.inf, np.inf])
    np.testing.assert_array_equal(excess(values, (1.0, 2.0)), [1, 0, 0, 0.5, np.inf, np.inf])
    np.testing.assert_array_equal(excess(values[:4], (-np.inf, 0.0)), [0, 1, 2, 3])
    data = xr.Dataset({"b": ("sample", values)}, {"sample": np.arange(6)})
    np.testing.assert_array_equal(within(data, {"b": (1.0, 2.0)}), [0, 1, 1, 0, 0, 0])
    np.testing.assert_array_equal(costs(data, {"b": "max"})[:, 0], [0, -1, -2, -3, np.inf, np.inf])


@pytest.mark.parametrize("wrong", [[], {"b": "least"}, {"b": 3}])
def test_objectives_are_checked(wrong):
    with pytest.raises(InputError, match="expected names of metrics, or"):
        check_objectives(wrong)


@pytest.mark.parametrize(
    "wrong", ["a", "0.5", None, (2, 1), (None, None), (1, 2, 3), np.nan, [np.nan, 1], [1.0, [2.0]], True]
)
def test_limits_are_checked(wrong):
    with pytest.raises(InputError, match=r"limits: b = .*, expected the largest value allowed"):
        check_limits({"b": wrong})
    with pytest.raises(UnknownNameError, match="metric 'c': expected one of e_p_peak, b"):
        front(table(), "c")


# --- the figure --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("goal", ["min", "max"])
def test_the_figure_has_the_front_as_a_staircase_in_degrees(goal, tmp_path):
    data, goals = table(), {"e_p_peak": "min", "b": goal}
    figure = pareto_figure(data, "e_p_peak", "b", goals=goals, limits={"e_p_peak": 0.5}, labelled=2)
    best = front(data, goals)
    [stairs] = [line for line in figure.axes[0].lines if line.get_drawstyle() == "steps-post"]
    np.testing.assert_allclose(stairs.get_xdata(), np.rad2deg(best["e_p_peak"]))
    np.testing.assert_array_equal(stairs.get_ydata(), best["b"])
    assert any(np.allclose(line.get_xdata(), np.rad2deg(0.5)) for line in figure.axes[0].lines)
    assert [text.get_text() for text in figure.axes[0].texts] == ["A", "B"]
    ends = [int(best["sample"][0]), int(best["sample"][-1])]
    assert [f"{letter}  {i}: k = " in figure.get_supxlabel() for letter, i in zip("AB", ends, strict=True)] == [
        True
    ] * 2
    assert figure.axes[0].get_xlabel().endswith("[deg]")
    assert all(file.stat().st_size for file in save_figure(figure, tmp_path / "front"))


def test_samples_beyond_another_limit_are_apart_and_colours_are_a_parameter():
    data = table().assign(c=("sample", np.linspace(0.0, 1.0, 60)))
    figure = pareto_figure(data, "e_p_peak", "b", colour="q[1]", limits={"c": 0.5})
    kept = within(data, {"c": 0.5})
    np.testing.assert_array_equal(figure.axes[0].collections[0].get_array(), data["q"].to_numpy()[kept, 1])
    beyond = figure.axes[0].lines[0]
    np.testing.assert_array_equal(beyond.get_ydata(), data["b"].to_numpy()[~kept])
    [stairs] = [line for line in figure.axes[0].lines if line.get_drawstyle() == "steps-post"]
    np.testing.assert_array_equal(stairs.get_ydata(), front(data, ["e_p_peak", "b"], {"c": 0.5})["b"])


def test_a_front_that_is_not_there_is_told():
    with pytest.raises(InputError, match="no sample has e_p_peak and b and keeps the limits"):
        pareto_figure(table().assign(c=("sample", np.ones(60))), "e_p_peak", "b", limits={"c": 0.5})
    with pytest.raises(InputError, match="y = None, expected the names of two metrics"):
        pareto_figure(table(), "e_p_peak")
    with pytest.raises(UnknownNameError, match=r"parameter 'q': expected one of k, q\[0\], q\[1\]"):
        pareto_figure(table(), "e_p_peak", "b", colour="q")
