"""Paths, profiles, derivatives that a subclass leaves out, and the check of a task."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import Wobble, floats, tasks, vectors, wobbles

from pathcontrol import (
    Circle,
    ConstantRate,
    ConstantSpeed,
    Ellipse,
    InputError,
    Line,
    Lissajous,
    PathTask,
    TaskError,
    check_task,
)

S = np.linspace(-4.0, 15.0, 301)


@given(wobbles())
def test_default_derivatives_are_accurate_to_1e8_relative(task):
    for got, exact in (
        (task.dq_d(S), task.exact_dq_d(S)),
        (task.ddq_d(S), task.exact_ddq_d(S)),
        (task.dtheta(S), task.exact_dtheta(S)),
    ):
        assert np.abs(got - exact).max() <= 1e-8 * np.abs(exact).max()


class Bent(PathTask):
    """An open path of three joints; derivatives are left to the library."""

    s_end = 2.0

    def q_d(self, s):
        return np.stack([np.sin(s), np.exp(-s), s * s], axis=-1)

    def theta(self, s):
        return 1 + s


@given(st.lists(floats(0.0, 2.0), min_size=2, max_size=20).map(np.array))
def test_no_row_of_a_batch_depends_on_the_others(s):
    bent, line = Bent(), Line([0.1, 0.2, -0.3], [1.0, -0.5, 0.7], 1.0)
    q = bent.q_d(s) / 3
    for i in range(len(s)):
        for method in ("dq_d", "ddq_d", "dtheta"):
            assert np.array_equal(getattr(bent, method)(s)[[i]], getattr(bent, method)(s[[i]])), method
        assert line.sigma_bar(q)[i] == line.sigma_bar(q[[i]])[0]


@pytest.mark.parametrize("frequency", [0.3, 1.0, 12.0])
def test_default_derivatives_near_the_ends_look_only_inside_the_domain(frequency):
    seen = []

    class Open(PathTask):
        s0, s_end = 1.0, 3.0

        def q_d(self, s):
            seen.append((np.min(s), np.max(s)))
            return np.stack([np.sin(frequency * s), np.sqrt(s - 0.5)], axis=-1)

        def theta(self, s):
            return 1 + s

    task, s = Open(), np.linspace(1.0, 3.0, 101)
    first = np.stack([frequency * np.cos(frequency * s), 0.5 / np.sqrt(s - 0.5)], -1)
    second = np.stack([-(frequency**2) * np.sin(frequency * s), -0.25 * (s - 0.5) ** -1.5], -1)
    assert np.abs(task.dq_d(s) - first).max() <= 1e-8 * np.abs(first).max()
    assert np.abs(task.ddq_d(s) - second).max() <= 1e-8 * np.abs(second).max()
    assert min(low for low, _ in seen) >= 1.0
    assert max(high for _, high in seen) <= 3.0


@given(tasks())
def test_derivatives_agree_with_differences(task):
    s, h = np.linspace(0, 6, 41), 1e-5
    for f, df in ((task.q_d, task.dq_d), (task.dq_d, task.ddq_d), (task.theta, task.dtheta)):
        difference = (f(s + h) - f(s - h)) / (2 * h)
        # second-order differences: the error is h²/6 of a third derivative plus rounding of about 1e-11
        assert np.allclose(df(s), difference, rtol=1e-6, atol=1e-6 * (1 + np.abs(difference).max()))


@given(tasks())
def test_at_is_what_the_methods_say(task):
    point = task.at(S)
    for got, want in zip(point, (task.q_d, task.dq_d, task.ddq_d, task.theta, task.dtheta), strict=True):
        assert np.allclose(got, want(S), rtol=1e-12, atol=1e-12)
    assert np.allclose(point.velocity, point.dq_d * point.theta[:, None])
    assert np.allclose(
        point.velocity_slope, task.ddq_d(S) * task.theta(S)[:, None] + task.dq_d(S) * task.dtheta(S)[:, None]
    )


@given(tasks(), st.sampled_from([(), (3,), (2, 4), (0,)]))
def test_every_batch_shape(task, shape):
    check_batch(task, shape)


@pytest.mark.parametrize("shape", [(), (3,), (2, 4), (0,)])
def test_every_batch_shape_of_default_derivatives(shape):
    check_batch(Wobble(np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])), shape)


def check_batch(task, shape):
    s = np.linspace(0, 5, int(np.prod(shape))).reshape(shape)
    assert task.q_d(s).shape == (*shape, 2)
    assert all(a.shape == (*shape, 2) for a in task.at(s)[:3])
    assert all(np.shape(a) == shape for a in task.at(s)[3:])
    assert task.sigma_bar(task.q_d(s)).shape == shape
    assert np.allclose(task.q_d(s).reshape(-1, 2), [task.q_d(x) for x in s.ravel()] or np.empty((0, 2)))


@given(tasks())
def test_closed_paths_close(task):
    s = np.linspace(0, task.period, 17)
    assert np.allclose(task.q_d(s), task.q_d(s + task.period), atol=1e-12)
    assert np.allclose(task.theta(s), task.theta(s + task.period), rtol=1e-10)


@pytest.mark.parametrize("task", [Circle(0.5, 1.0), Ellipse((0.5, 0.3), 1.0), Lissajous([0.5, 0.8], [1, 2], 1.2)])
def test_a_curve_takes_numbers_and_lists_too(task):
    s = [0.3, 2.0]
    for method in ("q_d", "dq_d", "ddq_d", "theta", "dtheta"):
        function = getattr(task, method)
        assert np.array_equal(function(s), function(np.array(s)))
        assert np.array_equal(function(s[0]), function(np.array(s[0])))
    for plain, array in zip(task.at(s), task.at(np.array(s)), strict=True):
        assert np.array_equal(plain, array)


@given(floats(0.2, 2), floats(0.1, 3), st.booleans(), vectors(5, 1.0))
def test_circle_is_the_papers_and_fits_any_two_joints(radius, speed, clockwise, center):
    task = Circle(radius, speed, center=center, joints=(3, 1), clockwise=clockwise)
    sign = -1 if clockwise else 1
    expected = np.tile(center, (len(S), 1))
    expected[:, 3] += radius * np.cos(S)
    expected[:, 1] += sign * radius * np.sin(S)
    assert np.allclose(task.q_d(S), expected, atol=1e-14)
    assert np.allclose(task.theta(S), speed / radius)
    assert np.allclose(np.linalg.norm(task.at(S).velocity, axis=-1), speed)


@given(tasks(), floats(0.1, 5.0))
def test_profiles(task, speed):
    steady = task.with_profile(ConstantSpeed(speed))
    assert np.allclose(np.linalg.norm(steady.at(S).velocity, axis=-1), speed, rtol=1e-9)
    rate = task.with_profile(ConstantRate(speed))
    assert np.allclose(rate.theta(S), speed)
    assert not rate.dtheta(S).any()
    assert np.array_equal(rate.q_d(S), task.q_d(S))
    assert rate.describe()["profile"] == "ConstantRate"


def test_line():
    task = Line([0.0, 1.0, 2.0], [1.0, 1.0, 0.0], 0.5)
    s = np.linspace(0, task.s_end, 7)
    assert np.allclose(task.q_d(task.s_end), [1, 1, 0])
    assert np.allclose(np.linalg.norm(task.dq_d(s), axis=-1), 1)
    assert np.allclose(task.theta(s), 0.5)
    assert task.sigma_bar([-9.0, 0, 9.0]) == 0
    assert task.sigma_bar([9.0, 0, -9.0]) == task.s_end


class Still(PathTask):
    """A path that stays where it is."""

    period = 1.0

    def q_d(self, s):
        return np.zeros((*np.shape(s), 2))

    def theta(self, s):
        return 1.0


# --- the check of a task ------------------------------------------------------------------------------------------


def broken(**methods):
    """A circle of which some methods are replaced."""
    return type("Broken", (Circle,), {"at": PathTask.at} | methods)(1.0, 1.0)


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (broken(q_d=lambda self, s: np.array([np.cos(s), np.sin(s)])), ["Broken.q_d", "(2, 129)", "axis=-1"]),
        (broken(q_d=lambda self, s: np.stack([s, s, s], -1)), ["3 joints", "has 2"]),
        (broken(q_d=lambda self, s: np.stack([s, s * np.nan], -1)), ["q_d", "nan", "finite"]),
        (broken(theta=lambda self, s: np.cos(s)), ["theta", "ϑ > 0"]),
        (broken(theta=lambda self, s: 0.0 * s), ["theta(s=0) = 0", "ϑ > 0"]),
        (broken(dq_d=lambda self, s: s), ["Broken.dq_d", "shape"]),
        (broken(period=-1.0), ["period = -1"]),
        (broken(period=3.0), ["Broken.q_d is not the same", "correct the period"]),
        (broken(s0=np.nan), ["s0 = nan"]),
        (broken(dq_d=lambda self, s: np.stack([np.sin(s), np.cos(s)], -1)), ["Broken.dq_d", "leave dq_d out"]),
        (broken(dq_d=lambda self, s: 2 * Circle.dq_d(self, s)), ["Broken.dq_d", "q_d changes at"]),
        (broken(dtheta=lambda self, s: 1.0 + s), ["Broken.dtheta", "theta changes at"]),
        (broken(q_d=lambda self, s: np.stack([math.cos(s), math.sin(s)], -1)), ["Broken.q_d fails", "np.cos"]),
        (broken(theta=lambda self, s: 1.0 + 0.0 * s[..., :1].sum() + 0.0 * s), ["Broken.theta fails", "shape ()"]),
        (Still(), ["Still.dq_d", "standstill"]),
        (Circle, ["PathTask"]),
    ],
)
def test_a_bad_task_is_found_before_the_run(task, words):
    with pytest.raises(TaskError) as error:
        check_task(task, 2)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_a_constant_profile_may_be_a_number():
    task = broken(theta=lambda self, s: 2.0)
    check_task(task, 2)
    assert np.array_equal(task.at(S).velocity, 2.0 * task.dq_d(S))


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Circle(-1.0, 1.0), "radius = -1"),
        (lambda: Circle(1.0, 0.0), "speed = 0"),
        (lambda: Circle("wide", 1.0), "radius"),
        (lambda: Circle(1.0, 1.0, joints=(0, 0)), "two different"),
        (lambda: Circle(1.0, 1.0, joints=(0, 2)), "from 0 to 1"),
        (lambda: Circle(1.0, 1.0, center=[0.0, np.nan]), "center[1] is nan"),
        (lambda: Ellipse((1.0, 0.0), 1.0), "semi_axes"),
        (lambda: Lissajous([1, 1], [1, 1.5], 1.0), "whole numbers"),
        (lambda: Lissajous([1, 1], [1, 1], 1.0), "turns back"),
        (lambda: Lissajous([1, 1], [1, 2, 3], 1.0), "one value per joint"),
        (lambda: Line([0, 0], [0, 0], 1.0), "needs a length"),
        (lambda: Line([0, 0], [0, 0, 1], 1.0), "same (n,)"),
        (lambda: ConstantRate(-2.0), "rate = -2"),
    ],
)
def test_bad_arguments(make, word):
    with pytest.raises(InputError, match=r"expected|need|turns") as error:
        make()
    assert word in str(error.value)
    assert "\n" not in str(error.value)
