"""Noise of the sensors: as much as was said, and the same however a batch is cut."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from pathcontrol import Circle, ExtendedMotionPlan, InputError, Run, SampledLoop, SensorNoise, load_robot, simulate
from pathcontrol.simulation.arm.noise import NoiseSource

START = np.deg2rad([40.0, 70.0])
ARM = load_robot("cicese_2dof")
N = 12


def run(loop: SampledLoop, rows: slice = slice(0, N), first: int | None = None, duration: float = 0.2) -> Run:
    law = ExtendedMotionPlan(ARM, Circle(1.0, 2.0), 800.0, [45.0, 100.0], 20.0)
    q = START + 0.1 * np.random.default_rng(1).normal(size=(N, 2))
    first = rows.start if first is None else first
    return simulate(law, q[rows], duration=duration, loop=loop, first_rollout=first, progress=False)


@settings(max_examples=8)
@given(st.sets(st.integers(1, N - 1), max_size=4), st.booleans(), st.integers(0, 5))
def test_any_cut_of_a_batch_gives_the_whole(cuts, difference, seed):
    noise = SensorNoise(1e-4, 0.0 if difference else [1e-3, 2e-3], seed)
    loop = SampledLoop(noise=noise, velocity="difference" if difference else "exact", encoders=True, filter_hz=100.0)
    whole = run(loop)
    parts = [run(loop, slice(a, b)) for a, b in pairwise([0, *sorted(cuts), N])]
    for name in [*whole.data.data_vars, "rollout"]:
        assert_array_equal(np.concatenate([part.array(name) for part in parts]), whole.array(name), err_msg=name)


@settings(max_examples=5)
@given(st.integers(1, 40), st.integers(0, 3))
def test_how_many_numbers_are_drawn_in_advance_does_not_matter(rollouts, first):
    """A few of many rollouts see what all of them see, over more samples than are drawn at once."""
    noise, zero = SensorNoise(1.0, 1.0, 3), np.zeros((rollouts + first, 2))
    many = NoiseSource(noise, zero.shape, 0)
    some = NoiseSource(noise, (1, 2), first)
    for _ in range(600):
        for whole, part in zip(many.add_noise(zero, zero), some.add_noise(zero[:1], zero[:1]), strict=True):
            assert_array_equal(whole[first], part[0])


def test_it_has_the_deviation_that_was_said_and_no_correlation():
    noise = SensorNoise([[1.0, 2.0], [3.0, 4.0]], 0.5, 7)
    source, zero = NoiseSource(noise, (2, 2), 0), np.zeros((2, 2))
    samples = np.array([np.stack(source.add_noise(zero, zero)) for _ in range(20_000)]).reshape(20_000, 8)
    # 20 000 samples know a deviation to 0.5 %, a mean and a correlation to 0.7 %: five of these at most
    assert np.allclose(samples.std(0), [1, 2, 3, 4, 0.5, 0.5, 0.5, 0.5], rtol=0.025)
    assert (np.abs(samples.mean(0)) < 0.035 * samples.std(0)).all()
    assert np.abs(np.corrcoef(samples.T) - np.eye(8)).max() < 0.035
    assert np.abs(np.corrcoef(samples[1:, 0], samples[:-1, 0])[0, 1]) < 0.035


def test_a_difference_of_positions_has_their_noise():
    loop = SampledLoop(noise=SensorNoise(position=1e-5), velocity="difference")
    noisy = run(loop, duration=1.0)
    error = noisy.array("qd_measured")[:, 2:] - np.diff(noisy.array("q"), axis=1)[:, 1:] / loop.period
    # √2σ/T, over 400 samples of 12 rollouts of 2 joints, which know it to 1 %
    assert error.std() == pytest.approx(np.sqrt(2) * 1e-5 / loop.period, rel=0.05)


def test_the_true_state_is_recorded_beside_the_measured_one():
    noisy = run(SampledLoop(noise=SensorNoise(1e-3, 1e-2)))
    assert (noisy.array("q_measured") - noisy.array("q")).std() == pytest.approx(1e-3, rel=0.1)
    assert (noisy.array("qd_measured") - noisy.array("qd")).std() == pytest.approx(1e-2, rel=0.1)


def test_seeds_and_numbers_make_the_difference():
    measured = [
        run(SampledLoop(noise=SensorNoise(1e-3, seed=seed)), slice(0, 1), first, 0.0025).array("q_measured")
        for seed in (0, 1)
        for first in (0, 5)
    ]
    assert len({m.tobytes() for m in measured}) == 4
    assert_array_equal(
        run(SampledLoop(noise=SensorNoise()), slice(0, 1)).array("q"), run(SampledLoop(), slice(0, 1)).array("q")
    )


def test_rollouts_are_numbered_from_the_first():
    part = run(SampledLoop(), slice(3, 6), duration=0.01)
    assert list(part["rollout"].to_numpy()) == [3, 4, 5]
    assert list(part.rollout(1)["rollout"].to_numpy()) == [4]


def test_the_record_says_what_noise_there_was():
    noise = SensorNoise([1e-4, 2e-4], 1e-3, 9)
    described = run(SampledLoop(noise=noise), duration=0.01).config["loop"]["noise"]
    assert described == {"position": [1e-4, 2e-4], "velocity": 1e-3, "seed": 9}
    assert "noise" not in SampledLoop().describe()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SensorNoise(-1.0), "noise of the position = -1.0, expected standard deviations ≥ 0"),
        (lambda: SensorNoise(0.0, np.nan), "noise of the velocity"),
        (lambda: SensorNoise(seed=-1), "seed = -1, expected a whole number from 0"),
        (lambda: SampledLoop(noise=0.1), r"noise = 0\.1, expected a SensorNoise"),
        (lambda: SampledLoop(noise=SensorNoise(0, 0.1), velocity="difference"), "is not measured"),
        (lambda: run(SampledLoop(noise=SensorNoise(np.ones((5, 2))))), r"has shape \(5, 2\), expected one that fits"),
        (lambda: run(SampledLoop(), first=-1), "first_rollout = -1, expected a whole number from 0"),
    ],
)
def test_noise_that_cannot_be(make, words):
    with pytest.raises(InputError, match=words):
        make()
