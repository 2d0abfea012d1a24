"""Splines through many samples: within the tolerance, with few knots, and never worse than interpolation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from strategies import floats

from pathcontrol import InputError, Projection, SplinePath, WaypointPath, check_task, simulate


def wave(s, closed: bool, order: int, seed: int = 0, n: int = 3):
    """The derivative of ``order`` 0 or 4 of a smooth path."""
    rng = np.random.default_rng(seed)
    k = np.arange(1, 4) if closed else np.arange(1, 4) / 2
    cosines, sines = rng.normal(size=(2, 3, n)) / np.arange(1, 4)[:, None] ** 2
    cosines[0, 0] += 4
    sines[0, 1] += 4
    return (k**order * np.cos(s[:, None] * k)) @ cosines + (k**order * np.sin(s[:, None] * k)) @ sines


def smooth(count: int, closed: bool, seed: int = 0, n: int = 3):
    """Samples (count, n) of a smooth path with their parameters, one more for a closed path."""
    s = np.linspace(0, 2 * np.pi, count + closed)
    return wave(s[:count], closed, 0, seed, n), s


def distances(path, q, s):
    return np.linalg.norm(path.q_d(s[: len(q)]) - q, axis=-1)


@given(
    st.integers(0, 999), st.booleans(), st.sampled_from([4, 5, 6, 7, 9, 30, 300]), st.integers(-9, -1), floats(0, 1e-2)
)
def test_every_sample_is_within_the_tolerance_and_the_deviation_is_true(seed, closed, count, exponent, noise):
    q, s = smooth(count, closed, seed)
    q = q + noise * np.random.default_rng(seed).normal(size=q.shape)
    path = SplinePath.from_samples(q, 0.5, 10.0**exponent, s=s, closed=closed)
    assert path.deviation <= 10.0**exponent
    assert path.deviation == pytest.approx(distances(path, q, s).max(), rel=1e-12, abs=1e-14)
    assert path.one_traverse == (s[0], s[-1])
    assert len(path.knots) <= count + closed
    assert path.closed == closed


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_the_knots_are_few_and_no_more_for_more_samples(closed, tolerance):
    knots = []
    for count in (1000, 30_000):
        q, s = smooth(count, closed)
        path = SplinePath.from_samples(q, 0.5, tolerance, s=s, closed=closed)
        assert path.deviation <= tolerance
        knots.append(len(path.knots))
    # a uniform spline with the error bound 5/384 h⁴ max‖q⁗‖ at the tolerance
    bend = np.linalg.norm(wave(s, closed, 4), axis=-1).max()
    uniform = (s[-1] - s[0]) * (5 / 384 * bend / tolerance) ** 0.25
    assert max(knots) <= 1.5 * uniform + 2
    assert max(knots) <= 1.2 * min(knots)


def test_a_cubic_has_no_knots_but_its_ends():
    s = np.sort(np.random.default_rng(1).uniform(-1, 2, 400))
    cubic = np.stack([1 + s - s**3 / 4, s**2, 2 * s], axis=-1)
    path = SplinePath.from_samples(cubic, 1.0, 1e-9, s=s)
    assert np.array_equal(path.knots, s[[0, -1]])
    between = np.linspace(s[0], s[-1], 77)
    assert np.allclose(path.q_d(between), np.stack([1 + between - between**3 / 4, between**2, 2 * between], -1))
    assert np.allclose(path.ddq_d(between), np.stack([-1.5 * between, 2 + 0 * between, 0 * between], -1), atol=1e-9)


@pytest.mark.parametrize("closed", [False, True])
def test_noise_is_smoothed_by_a_tolerance_above_it(closed):
    clean, s = smooth(2000, closed)
    noisy = clean + 1e-3 * np.random.default_rng(0).uniform(-1, 1, clean.shape)
    path = SplinePath.from_samples(noisy, 0.5, 4e-3, s=s, closed=closed)
    assert len(path.knots) < 40
    # nearer to the truth than the samples are, and as smooth
    assert distances(path, clean, s).max() < np.linalg.norm(noisy - clean, axis=-1).max()
    assert np.abs(path.ddq_d(s)).max() < 2 * np.abs(SplinePath.from_samples(clean, 0.5, 1e-6, s, closed).ddq_d(s)).max()


@given(st.integers(0, 99), st.booleans(), st.sampled_from(["normal", "cauchy", "outlier", "step"]))
@settings(max_examples=12)
def test_no_noise_makes_it_explode(seed, closed, kind):
    clean, s = smooth(500, closed, seed)
    rng = np.random.default_rng(seed)
    noise = {
        "normal": 0.1 * rng.normal(size=clean.shape),
        "cauchy": 0.01 * rng.standard_cauchy(clean.shape),
        "outlier": 5.0 * (np.arange(500) == 123)[:, None],
        "step": 1.0 * (np.arange(500) > 250)[:, None],
    }[kind]
    path = SplinePath.from_samples(clean + noise, 0.5, 1e-4, s=s, closed=closed)
    assert path.deviation <= 1e-4
    assert len(path.knots) <= 500 + closed
    between = np.linalg.norm(path.q_d(np.linspace(*path.one_traverse, 5001)), axis=-1)
    assert between.max() < 1.5 * np.linalg.norm(clean + noise, axis=-1).max()


@pytest.mark.parametrize("closed", [False, True])
def test_no_tolerance_is_interpolation(closed):
    q, s = smooth(20, closed)
    path = SplinePath.from_samples(q, 0.5, 0.0, s=s, closed=closed)
    assert path.deviation < 1e-14
    ring = np.concatenate([q, q[:1]]) if closed else q
    reference = CubicSpline(s, ring, bc_type="periodic" if closed else "natural")
    between = np.linspace(*path.one_traverse, 101)
    assert np.allclose(path.q_d(between), reference(between), atol=1e-12)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("count", [3, 4, 5])
def test_a_handful_of_samples(closed, count):
    q = WaypointPath([[0, 0], [1, 0.2], [1.4, 1], [0.6, 1.4], [-0.3, 0.8]], 1.0).points[:count]
    path = SplinePath.from_samples(q, 0.5, 1e-3, closed=closed)
    assert path.deviation <= 1e-3
    check_task(path, 2)


@given(st.integers(0, 99), st.booleans())
def test_it_is_a_valid_task_and_twice_continuously_differentiable(seed, closed):
    q, s = smooth(400, closed, seed)
    path = SplinePath.from_samples(q, 0.7, 1e-4, s=s, closed=closed)
    check_task(path, 3)
    assert np.allclose(np.linalg.norm(path.at(s).velocity, axis=-1), 0.7)
    h = 1e-9
    inner = path.knots[:-1] if closed else path.knots[1:-1]
    for f in (path.q_d, path.dq_d, path.ddq_d):
        assert np.abs(f(inner + h) - f(inner - h)).max() < 1e-6 * np.abs(f(s)).max()


@pytest.mark.parametrize("closed", [False, True])
def test_the_parameter_is_the_length_of_the_polygon_and_repetitions_are_left_out(closed):
    q, _ = smooth(200, closed)
    repeated = np.repeat(q, np.random.default_rng(0).integers(1, 4, len(q)), axis=0)
    if closed:
        repeated = np.concatenate([repeated, q[:1]])
    path = SplinePath.from_samples(repeated, 0.5, 1e-4, closed=closed)
    plain = SplinePath.from_samples(q, 0.5, 1e-4, closed=closed)
    ring = np.concatenate([q, q[:1]]) if closed else q
    length = np.linalg.norm(np.diff(ring, axis=0), axis=-1).sum()
    assert path.one_traverse == pytest.approx((0.0, length))
    s = np.linspace(0, length, 99)
    assert np.array_equal(path.q_d(s), plain.q_d(s))
    assert np.abs(np.linalg.norm(path.dq_d(s), axis=-1) - 1).max() < 0.01


def test_the_record_has_the_deviation():
    q, s = smooth(100, False)
    path = SplinePath.from_samples(q, 0.5, 1e-3, s=s)
    assert path.describe()["deviation"] == path.deviation
    assert "deviation" not in WaypointPath(q[::10], 0.5).describe()


def test_an_arm_follows_it(ideal_arm):
    q, _ = smooth(1000, True, n=2)
    path = SplinePath.from_samples(0.2 * q, 1.0, 1e-5, closed=True)
    law = Projection(ideal_arm, path, 800.0, [45.0, 100.0])
    run = simulate(law, path.q_d(np.array(0.0)), duration=1.0, progress=False)
    assert run.norm("e_p")[0, run.time > 0.7].max() < 1e-3


Q = np.stack([np.arange(6.0), np.arange(6.0) ** 2], axis=-1)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SplinePath.from_samples(Q, 1.0, -1e-3), ["tolerance = -0.001"]),
        (lambda: SplinePath.from_samples(Q, 0.0, 1e-3), ["speed = 0"]),
        (lambda: SplinePath.from_samples(Q[:1], 1.0, 1e-3), ["1 different postures", "at least 2"]),
        (lambda: SplinePath.from_samples(Q[:2], 1.0, 1e-3, closed=True), ["2 different postures", "at least 3"]),
        (lambda: SplinePath.from_samples(np.ones((9, 2)), 1.0, 1e-3), ["1 different postures"]),
        (lambda: SplinePath.from_samples(Q[:, 0], 1.0, 1e-3), ["(6,)", "(m, n)"]),
        (lambda: SplinePath.from_samples(Q * [1, np.nan], 1.0, 1e-3), ["q[0, 1] is nan"]),
        (lambda: SplinePath.from_samples(Q, 1.0, 1e-3, s=np.arange(5)), ["(5,)", "(6,) for 6 samples"]),
        (lambda: SplinePath.from_samples(Q, 1.0, 1e-3, s=np.arange(6), closed=True), ["(7,)", "return to the first"]),
        (lambda: SplinePath.from_samples(Q, 1.0, 1e-3, s=[0, 1, 2, 2, 3, 4]), ["s[2] = 2 and s[3] = 2", "increase"]),
        (lambda: SplinePath.from_samples([["a", "b"]], 1.0, 1e-3), ["q = ", "numbers"]),
    ],
)
def test_bad_samples(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)
