"""Samples of a space: what each method promises, and that they depend on the seed alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pathcontrol import InputError, Space

PARAMETERS = {"a": stats.uniform(1.0, 4.0), "b": stats.norm([0.0, 5.0], [1.0, 2.0]), "c": ["x", "y", "z"]}
METHODS = {"random": Space.random, "lhs": Space.latin_hypercube, "sobol": Space.sobol}

sizes = st.integers(1, 200)


@pytest.mark.parametrize("method", METHODS)
@given(samples=sizes, seed=st.integers(0, 2**40))
def test_a_design_depends_on_its_seed_alone(method, samples, seed):
    space = METHODS[method](PARAMETERS, samples)
    one, two = space.design(seed), METHODS[method](PARAMETERS, samples).design(seed)
    for name in PARAMETERS:
        np.testing.assert_array_equal(one[name], two[name])
        assert len(one[name]) == samples
    assert one["b"].shape == (samples, 2)
    assert not np.array_equal(one["a"], space.design(seed + 1)["a"])
    assert ((one["a"] >= 1) & (one["a"] <= 5)).all()
    assert np.isfinite(one["b"]).all()
    assert set(one["c"]) <= {"x", "y", "z"}


@pytest.mark.parametrize("method", ["random", "sobol"])
@given(samples=sizes, more=sizes)
def test_fewer_samples_are_the_first_of_more(method, samples, more):
    few, many = (METHODS[method](PARAMETERS, n).design(3) for n in (samples, samples + more))
    for name in PARAMETERS:
        np.testing.assert_array_equal(many[name][:samples], few[name])


@given(samples=sizes, seed=st.integers(0, 1000))
def test_a_latin_hypercube_has_one_sample_in_each_interval(samples, seed):
    design = Space.latin_hypercube(PARAMETERS, samples).design(seed)
    for u in (stats.uniform(1.0, 4.0).cdf(design["a"]), *stats.norm([0.0, 5.0], [1.0, 2.0]).cdf(design["b"]).T):
        # 1e-9: from a quantile and back there is a rounding error
        assert (np.abs(np.sort(u) - (np.arange(samples) + 0.5) / samples) <= 0.5 / samples + 1e-9).all()


@given(power=st.integers(0, 9), seed=st.integers(0, 1000))
def test_a_sobol_sequence_of_a_power_of_two_is_balanced(power, seed):
    design = Space.sobol({"a": stats.uniform(), "b": stats.uniform()}, 2**power).design(seed)
    for u in design.values():
        np.testing.assert_array_equal(np.sort(np.floor(u * 2**power)), np.arange(2**power))


def test_random_samples_have_their_distribution():
    design = Space.random(PARAMETERS, 4000).design(1)
    assert stats.kstest(design["a"], stats.uniform(1, 4).cdf).pvalue > 1e-3
    assert stats.kstest(design["b"][:, 1], stats.norm(5, 2).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(design["a"], design["b"][:, 0])[0, 1]) < 0.06  # 4 standard deviations of independence
    counts = np.unique(design["c"], return_counts=True)[1]
    assert stats.chisquare(counts).pvalue > 1e-3


def test_a_grid_has_every_combination_once():
    space = Space.grid({"a": [1, 2, 3], "q": [[0.0, 1.0], [2.0, 3.0]], "c": ["x", "y"]})
    design = space.design()
    assert space.samples == 12
    assert len({(a, *q, c) for a, q, c in zip(design["a"], design["q"].tolist(), design["c"], strict=True)}) == 12
    assert design["c"].tolist() == ["x", "y"] * 6  # the last one changes first
    assert design["a"].dtype.kind == "i"


def test_samples_given_are_those():
    q = np.arange(6.0).reshape(3, 2)
    design = Space.given({"k": [3, 1, 2], "q": q}).design(seed=5)
    np.testing.assert_array_equal(design["q"], q)
    assert design["k"].tolist() == [3, 1, 2]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Space.grid({}), "expected a dict with a parameter at least"),
        (lambda: Space.grid({"a": stats.norm()}), "a is a norm distribution, of which a grid cannot have every value"),
        (lambda: Space.given({"a": [1, 2], "b": [1]}), r"different numbers of samples \(a: 2, b: 1\)"),
        (lambda: Space.grid({"a": []}), r"a = \[\], expected a list of numbers"),
        (lambda: Space.grid({"a": 3}), "a = 3, expected a list of numbers, texts or vectors, or a frozen"),
        (lambda: Space.grid({"a": [[1], [1, 2]]}), "expected values of one kind and length"),
        (lambda: Space.grid({"a": [1.0, np.nan]}), "a holds nan, expected finite numbers"),
        (lambda: Space.random({"a": [1]}, 0), "samples = 0, expected a whole number from 1"),
        (lambda: Space.random({"a": stats.norm(0, -1)}, 3), "a: the distribution has the median nan"),
        (lambda: Space.random({"a": [1]}, 3).design(-1), "seed = -1, expected a whole number from 0"),
    ],
)
def test_what_is_no_space_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
