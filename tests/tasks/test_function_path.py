"""Paths from any function: of arrays, of rows or of numbers, with the derivatives that are given."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats

from pathcontrol import Circle, InputError, Projection, TaskError, check_task, simulate
from pathcontrol.tasks.function import FunctionPath
from pathcontrol.tasks.regularity import check_jumps

S = np.linspace(0.0, 2 * np.pi, 37)
A, B = 1.2, 0.7


def exact(s):
    """q_d, q_d' and q_d'' of the path that all functions here describe."""
    s = np.asarray(s)
    values = (A * np.cos(s), B * np.sin(s), 0.1 * np.sin(2 * s))
    first = (-A * np.sin(s), B * np.cos(s), 0.2 * np.cos(2 * s))
    second = (-A * np.cos(s), -B * np.sin(s), -0.4 * np.sin(2 * s))
    return [np.stack(rows, axis=-1) for rows in (values, first, second)]


def of_arrays(s):
    return exact(s)[0]


def of_rows(s):
    """Takes s (N,) and nothing else."""
    return np.concatenate([A * np.cos(s)[:, None], B * np.sin(s)[:, None], 0.1 * np.sin(2 * s)[:, None]], axis=1)


def of_numbers(s):
    return [A * math.cos(s), B * math.sin(s), 0.1 * math.sin(2 * s)]


def joints_first(s):
    return np.array([A * np.cos(s), B * np.sin(s), 0.1 * np.sin(2 * s)])


def list_of_arrays(s):
    return list(joints_first(s))


def of_zero_dimensional(s):
    if np.ndim(s):
        raise TypeError("one s at a time")
    return joints_first(s)


STYLES = [of_arrays, of_rows, of_numbers, joints_first, list_of_arrays, of_zero_dimensional]


def slope(s):
    return exact(s)[1]


def bend(s):
    return exact(s)[2]


def rate(s):
    return 2 + math.sin(s)


@pytest.mark.parametrize("function", STYLES, ids=lambda f: f.__name__)
@pytest.mark.parametrize("shape", [(), (1,), (5,), (3, 3), (2, 4), (0,)])
def test_every_style_of_function_is_the_same_path(function, shape):
    path = FunctionPath(function, 0.5, period=2 * np.pi)
    s = np.linspace(0, 5, int(np.prod(shape))).reshape(shape)
    for got, want, digits in zip(path.at(s)[:3], exact(s), (1e-14, 1e-10, 1e-8), strict=True):
        assert got.shape == (*shape, 3)
        assert np.allclose(got, want, rtol=0, atol=digits)
    assert [np.shape(a) for a in path.at(s)[3:]] == [shape, shape]


@pytest.mark.parametrize("function", STYLES, ids=lambda f: f.__name__)
def test_it_is_a_valid_task_at_a_constant_speed(function):
    path = FunctionPath(function, 0.5, period=2 * np.pi)
    check_task(path, 3)
    assert np.allclose(np.linalg.norm(path.at(S).velocity, axis=-1), 0.5)


@given(st.booleans(), st.booleans())
def test_derivatives_that_are_given_are_used_and_the_others_computed(first, second):
    given_ = {"derivative": slope} if first else {}
    given_ |= {"second_derivative": bend} if second else {}
    path = FunctionPath(of_arrays, 1.0, period=2 * np.pi, **given_)
    _, dq_d, ddq_d = exact(S)
    assert np.abs(path.dq_d(S) - dq_d).max() <= (0 if first else 1e-11)
    assert np.abs(path.ddq_d(S) - ddq_d).max() <= (0 if second else 1e-11 if first else 1e-9)
    check_task(path, 3)


@pytest.mark.parametrize(
    ("profile", "theta", "dtheta"),
    [
        ({"theta": rate}, 2 + np.sin(S), np.cos(S)),
        ({"theta": lambda s: 2 + np.sin(s)}, 2 + np.sin(S), np.cos(S)),
        ({"theta": rate, "theta_derivative": math.cos}, 2 + np.sin(S), np.cos(S)),
        ({"theta": 1.5}, 1.5 + 0 * S, 0 * S),
        ({"theta": lambda s: 1.5}, 1.5 + 0 * S, 0 * S),
    ],
)
def test_profiles(profile, theta, dtheta):
    path = FunctionPath(of_arrays, period=2 * np.pi, **profile)
    for point in (path.at(S), path.at(S.reshape(1, -1))):
        assert np.allclose(point.theta.ravel(), theta, rtol=1e-14)
        assert np.allclose(point.dtheta.ravel(), dtheta, atol=1e-10)
    check_task(path, 3)


def test_functions_of_arrays_are_called_once_a_batch_and_functions_of_numbers_once_a_number():
    calls = []

    def counted(function):
        return lambda s: calls.append(np.shape(s)) or function(s)

    for function, expected in ((of_arrays, [(50,)]), (of_numbers, [()] * 50)):
        path = FunctionPath(counted(function), 1.0, s_end=1)
        calls.clear()
        path.q_d(np.linspace(0, 1, 50).reshape(5, 10))
        assert calls == expected


def test_an_open_path_is_never_left():
    seen = []

    def watched(s):
        seen.extend(np.ravel(s))
        return np.stack([np.sqrt(s - 1), s], axis=-1)

    path = FunctionPath(watched, theta=lambda s: watched(s)[..., 1], s0=1.5, s_end=3)
    check_task(path, 2)
    assert min(seen) >= 1.5
    assert max(seen) <= 3


@given(floats(0.2, 2), floats(0.1, 2))
def test_it_projects_as_the_library_does(radius, speed):
    circle = Circle(radius, speed)
    path = FunctionPath(circle.q_d, speed, period=2 * np.pi)
    q = 1.3 * circle.q_d(S[:-1])
    assert np.allclose(path.sigma_bar(q), S[:-1], atol=1e-8)


def test_it_is_pickled():
    path = FunctionPath(of_numbers, theta=rate, derivative=slope, period=2 * np.pi)
    path.at(S)
    again = pickle.loads(pickle.dumps(path))
    assert all(np.array_equal(a, b) for a, b in zip(path.at(S), again.at(S), strict=True))


def test_the_record_says_which_function():
    described = FunctionPath(of_arrays, 0.5, s_end=2.0).describe()
    domain = {"s0": 0.0, "s_end": 2.0}
    profile = {"profile": "ConstantSpeed", "speed": 0.5}
    assert described == {"task": "FunctionPath", "function": "of_arrays"} | domain | profile


def test_an_arm_follows_it(ideal_arm):
    path = FunctionPath(lambda s: [0.6 * math.cos(s), 0.4 * math.sin(s)], 0.8, period=2 * np.pi)
    law = Projection(ideal_arm, path, 800.0, [45.0, 100.0])
    run = simulate(law, path.q_d(np.array(0.0)), duration=1.0, progress=False)
    assert run.norm("e_p")[0, run.time > 0.7].max() < 1e-3


def fails(s):
    raise RuntimeError("no such posture")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: FunctionPath(fails, 1.0), ["function(s=", "no such posture", "numbers or of arrays"]),
        (lambda: FunctionPath(lambda s: s, 1.0), ["function(s=", "shape ()", "(n,)"]),
        (lambda: FunctionPath(lambda s: [[s, s]], 1.0), ["shape (1, 2)", "(n,)"]),
        (lambda: FunctionPath(lambda s: [], 1.0), ["shape (0,)"]),
        (lambda: FunctionPath(lambda s: ["left", "right"], 1.0), ["function(s=", "'left'"]),
        (lambda: FunctionPath("cos(s)", 1.0), ["function = 'cos(s)'", "a function of s"]),
        (lambda: FunctionPath(of_arrays, 1.0, derivative=lambda s: [s, s]), ["derivative(s=", "(2,)", "(3,)"]),
        (lambda: FunctionPath(of_arrays, 1.0, second_derivative=3), ["second_derivative = 3", "function"]),
        (lambda: FunctionPath(of_arrays, theta=lambda s: [s, s]), ["theta(s=", "(2,)", "a number"]),
        (lambda: FunctionPath(of_arrays, theta=-1), ["theta = -1", "greater than 0"]),
        (lambda: FunctionPath(of_arrays, 1.0, theta_derivative=rate), ["theta_derivative", "without"]),
        (lambda: FunctionPath(of_arrays), ["neither speed nor theta"]),
        (lambda: FunctionPath(of_arrays, 0.0), ["speed = 0"]),
        (lambda: FunctionPath(of_arrays, 1.0, s0=2, s_end=1), ["s0 = 2", "s_end = 1"]),
        (lambda: FunctionPath(of_arrays, 1.0, s_end=np.nan), ["s_end = nan"]),
    ],
)
def test_bad_functions(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


@pytest.mark.parametrize(
    ("path", "word"),
    [
        (FunctionPath(lambda s: [s, np.nan], 1.0, s_end=1), "finite"),
        (FunctionPath(lambda s: [s, s], theta=lambda s: s - 0.5, s_end=1), "ϑ > 0"),
        (FunctionPath(of_arrays, 1.0, derivative=bend, period=2 * np.pi), "leave dq_d out"),
    ],
)
def test_wrong_values_are_found_by_the_check(path, word):
    with pytest.raises(TaskError, match=word):
        check_task(path, path.n)


@pytest.mark.parametrize("jump", [2 * np.pi, 0.1, 2e-3])
@given(st.floats(0.05, 1.95))
@settings(max_examples=5)
def test_a_path_of_ones_own_that_jumps_is_refused_where_it_does(jump, where):
    def wrapped(s):
        return np.stack([s, 0.3 * np.sin(s) + jump * (np.asarray(s) > where)], -1)

    with pytest.raises(TaskError, match=r"FunctionPath\.q_d jumps by .* at s = ") as error:
        check_task(FunctionPath(wrapped, speed=1.0, s_end=2.0))
    assert error.value.s == pytest.approx(where, abs=1e-4)
    check_task(FunctionPath(lambda s: wrapped(s) * [1.0, 0.0] + np.stack([0 * s, np.tanh(30 * s)], -1), 1.0, s_end=2.0))


@pytest.mark.parametrize("loops", [128, 255])
def test_a_path_that_comes_back_between_two_samples_does_not_jump(loops):
    """Circles whose centre moves slowly: each ends near to where it begins, at samples or between two."""

    def weave(s):
        return np.stack([np.cos(s) / 10 + np.cos(loops * s), np.sin(s) / 10 + np.sin(loops * s)], -1) / 10

    check_task(FunctionPath(weave, speed=1.0, period=2 * np.pi))


@given(st.floats(0.0, 2 * np.pi), st.floats(1e-4, 0.3))
def test_a_stretch_without_numbers_is_no_jump(centre, width):
    """The checks of values, or the run, say what it is."""

    def hole(s):
        return np.where(np.abs(s - centre)[..., None] < width / 2, np.nan, np.stack([np.cos(s), np.sin(s)], -1))

    check_jumps(FunctionPath(hole, speed=1.0, period=2 * np.pi))
