"""Velocity profiles from a table: ϑ² linear between knots, exact slopes and times."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from pathcontrol import InputError
from pathcontrol.profiles.tabulated import TabulatedProfile

seeds = st.integers(0, 9999)


def table(seed, closed):
    rng = np.random.default_rng(seed)
    s, squared = np.cumsum(rng.uniform(0.01, 1.0, 9)) - 2, rng.uniform(0.1, 5.0, 9)
    if closed:
        squared[-1] = squared[0]
    return TabulatedProfile(s, squared, s[-1] - s[0] if closed else None)


@given(seeds, st.booleans())
def test_a_table_has_constant_pseudo_acceleration_between_its_knots(seed, closed):
    profile = table(seed, closed)
    share = np.linspace(0, 1, 7)[:-1]
    s = profile.s[:-1, None] + np.diff(profile.s)[:, None] * share
    theta, dtheta = profile.at(None, None, None, s)
    assert np.allclose(theta**2, profile.squared[:-1, None] + np.diff(profile.squared)[:, None] * share, rtol=1e-12)
    assert np.allclose(theta * dtheta, (np.diff(profile.squared) / np.diff(profile.s) / 2)[:, None], rtol=1e-9)


@given(seeds, st.booleans())
def test_the_slope_of_a_table_is_the_one_to_the_right(seed, closed):
    profile, h = table(seed, closed), 1e-7
    s = np.concatenate([profile.s[:-1], np.random.default_rng(seed).uniform(profile.s[0], profile.s[-1] - h, 20)])
    difference = (profile.theta(None, s + h) - profile.theta(None, s)) / h
    theta, dtheta = profile.at(None, None, None, s)
    # ϑ'' = −ϑ'²/ϑ; rounding of s + h and of ϑ, divided by h
    bound = 1.01 * h * dtheta**2 / (2 * theta) + 1e-7 * np.abs(dtheta) + 1e-7
    assert (np.abs(difference - dtheta) <= bound).all()


@given(seeds, st.booleans())
def test_traversal_time_is_the_integral_of_the_slowness(seed, closed):
    profile = table(seed, closed)
    cells = zip(profile.s[:-1], profile.s[1:], strict=True)
    time = sum(quad(lambda s: 1 / profile.theta(None, np.asarray(s)), a, b, epsrel=1e-10)[0] for a, b in cells)
    assert profile.traversal_time == pytest.approx(time, rel=1e-8)


@given(seeds)
def test_a_table_repeats_on_a_closed_path_and_holds_beyond_an_open_one(seed):
    ring, strip = table(seed, True), table(seed, False)
    s = np.linspace(ring.s[0], ring.s[-1], 50)[1:-1]
    for laps in (-2, 1, 7):
        assert np.allclose(ring.at(None, None, None, s + laps * ring.period), ring.at(None, None, None, s), rtol=1e-6)
    assert np.array_equal(strip.theta(None, strip.s[[0, -1]] + [-1, 1]), np.sqrt(strip.squared[[0, -1]]))
    assert not strip.dtheta(None, strip.s[[0, -1]] + [-1, 1]).any()


@pytest.mark.parametrize("shape", [(), (3,), (2, 4), (0,)])
def test_a_table_takes_every_batch_shape_and_cannot_be_written_to(shape):
    profile = table(0, True)
    assert profile.theta(None, np.zeros(shape)).shape == profile.dtheta(None, np.zeros(shape)).shape == shape
    for values in (profile.s, profile.squared):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0.0], [1.0]), ["s has shape (1,)", "two knots"]),
        (([0.0, 2.0, 1.0], [1.0, 1.0, 1.0]), ["s[1] = 2 is followed by 1", "increasing"]),
        (([0.0, 1.0], [1.0, 1.0, 1.0]), ["squared has shape (3,) and s (2,)"]),
        (([0.0, 1.0], [1.0, 0.0]), ["squared[1] = 0 at s = 1", "ϑ² > 0"]),
        (([0.0, np.nan], [1.0, 1.0]), ["s[1] is nan"]),
        (([0.0, 1.0], [1.0, 1.0], 2.0), ["period = 2", "span 1"]),
        (([0.0, 1.0], [1.0, 2.0], 1.0), ["begins with 1 and ends with 2"]),
        (([0.0, 1.0], [1.0, 1.0], -1.0), ["period = -1", "greater than 0"]),
    ],
)
def test_bad_tables(arguments, words):
    with pytest.raises(InputError) as error:
        TabulatedProfile(*arguments)
    assert all(word in str(error.value) for word in words), str(error.value)
