"""Arc length and curvature against closed forms, and their invariance; paths with their length as parameter."""

from __future__ import annotations

import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import ellipe
from strategies import Wobble, floats, tasks, vectors, wobbles

from pathcontrol import (
    Circle,
    Ellipse,
    InputError,
    Line,
    Lissajous,
    PathTask,
    Projection,
    TaskError,
    WaypointPath,
    check_task,
    simulate,
)
from pathcontrol.tasks.function import FunctionPath
from pathcontrol.tasks.lengths import length_along


class Helix(PathTask):
    """A screw in three joints, which neither ends nor repeats: length √(r² + c²) s, curvature r/(r² + c²)."""

    def __init__(self, radius, pitch):
        self.radius, self.pitch = radius, pitch

    def q_d(self, s):
        return np.stack([self.radius * np.cos(s), self.radius * np.sin(s), self.pitch * s], axis=-1)

    def theta(self, s):
        return np.full_like(s, 1.0)


def reparametrised(task, amount):
    """The path at s = u + amount sin u, by the chain rule."""

    def inner(u):
        return u + amount * np.sin(u)

    def bend(u):
        slope, turn = (1 + amount * np.cos(u))[:, None], (-amount * np.sin(u))[:, None]
        return task.ddq_d(inner(u)) * slope**2 + task.dq_d(inner(u)) * turn

    return FunctionPath(
        lambda u: task.q_d(inner(u)),
        theta=1.0,
        derivative=lambda u: task.dq_d(inner(u)) * (1 + amount * np.cos(u))[:, None],
        second_derivative=bend,
        period=2 * np.pi,
    )


@given(floats(0.1, 3), floats(-9, 9), floats(-9, 9))
def test_the_length_of_a_circle(radius, start, end):
    circle = Circle(radius, 1.0)
    assert circle.arc_length() == pytest.approx(2 * np.pi * radius, rel=1e-14)
    assert circle.arc_length(start, end) == pytest.approx(radius * (end - start), rel=1e-13, abs=1e-13)


@given(floats(-3, 3).filter(lambda x: abs(x) > 0.01), floats(0, 1), floats(0, 1))
def test_the_length_of_a_line(x, start, end):
    line = Line([0.3, -0.2, 0.1], [0.3 + x, 1.0, 0.0], 0.5)
    start, end = start * line.s_end, end * line.s_end
    assert line.arc_length() == pytest.approx(line.s_end, rel=1e-14)
    assert line.arc_length(start, end) == pytest.approx(end - start, rel=1e-13, abs=1e-14)


@pytest.mark.parametrize("ratio", [1.0, 0.5, 0.1, 1e-2, 1e-4])
def test_the_length_of_an_ellipse(ratio):
    ellipse = Ellipse((1.3, 1.3 * ratio), 1.0)
    assert ellipse.arc_length() == pytest.approx(4 * 1.3 * ellipe(1 - ratio**2), rel=1e-13)
    assert ellipse.arc_length(0, np.pi / 2) == pytest.approx(1.3 * ellipe(1 - ratio**2), rel=1e-13)


@given(st.integers(0, 99), st.booleans())
def test_the_length_of_a_spline_is_that_of_its_pieces(seed, closed):
    angle = np.linspace(0, 2 * np.pi, 7)[:6]
    corners = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    path = WaypointPath(corners + 0.3 * np.random.default_rng(seed).normal(size=(6, 3)), 1.0, closed=closed)
    pieces = [
        quad(lambda s: np.linalg.norm(path.dq_d(s)), a, b, epsabs=0, epsrel=1e-12)[0] for a, b in pairwise(path.knots)
    ]
    assert path.arc_length() == pytest.approx(sum(pieces), rel=1e-11)
    assert np.allclose(path.arc_length(path.knots[:-1], path.knots[1:]), pieces, rtol=1e-10)


@settings(max_examples=10)
@given(tasks(), floats(-5, 5), floats(-5, 5), floats(-5, 5))
def test_lengths_add_up_and_count_laps(task, a, b, c):
    whole = task.arc_length()
    assert task.arc_length(a, b) + task.arc_length(b, c) == pytest.approx(task.arc_length(a, c), rel=1e-10, abs=1e-10)
    assert task.arc_length(a, b) == pytest.approx(-task.arc_length(b, a), rel=1e-12, abs=1e-14)
    assert task.arc_length(a, a + 3 * task.period) == pytest.approx(3 * whole, rel=1e-10)


@given(tasks(), floats(-0.8, 0.8))
def test_length_and_curvature_do_not_know_the_parameter(task, amount):
    other, u = reparametrised(task, amount), np.linspace(0, 6, 17)
    s = u + amount * np.sin(u)
    assert np.allclose(other.arc_length(0, u), task.arc_length(0, s), rtol=1e-9, atol=1e-12)
    assert np.allclose(other.curvature(u), task.curvature(s), rtol=1e-6, atol=1e-7)


@settings(max_examples=10)
@given(tasks(), vectors(2, 2.0), st.one_of(floats(0.2, 3), floats(-3, -0.2)))
def test_length_and_curvature_under_transforms(task, offset, factor):
    s, length = np.linspace(0, 6, 9), task.arc_length()
    moved, scaled, back = task.shifted(offset), task.scaled(factor), task.reversed()
    assert moved.arc_length() == pytest.approx(length, rel=1e-9)
    assert back.arc_length() == pytest.approx(length, rel=1e-9)
    assert scaled.arc_length() == pytest.approx(abs(factor) * length, rel=1e-9)
    assert np.allclose(moved.curvature(s), task.curvature(s), rtol=1e-9)
    assert np.allclose(back.curvature(2 * task.s0 - s), task.curvature(s), rtol=1e-9)
    assert np.allclose(scaled.curvature(s), task.curvature(s) / abs(factor), rtol=1e-7, atol=1e-9)


@given(floats(0.2, 2), floats(0.2, 2), vectors(5, 9.0))
def test_curvatures_in_closed_form(a, b, s):
    assert np.allclose(Circle(a, 1.0, center=np.zeros(4), joints=(3, 1)).curvature(s), 1 / a)
    assert not Line([0, 0, 0], [a, b, 1], 1.0).curvature(np.abs(s) / 9).any()
    ellipse = a * b / (a**2 * np.sin(s) ** 2 + b**2 * np.cos(s) ** 2) ** 1.5
    assert np.allclose(Ellipse((a, b), 1.0).curvature(s), ellipse)
    helix, s = Helix(a, b).between(0, 10), np.abs(s)
    assert np.allclose(helix.curvature(s), a / (a**2 + b**2), rtol=1e-8)
    assert np.allclose(helix.arc_length(0, s), np.hypot(a, b) * s, rtol=1e-10)


@given(st.integers(0, 99))
def test_the_curvature_in_three_joints_is_that_of_the_cross_product(seed):
    a, b = np.random.default_rng(seed).normal(size=(2, 6, 3))
    expected = np.linalg.norm(np.cross(a, b), axis=-1) / np.linalg.norm(a, axis=-1) ** 3
    assert np.allclose(Still(a, b).curvature(np.arange(6.0)), expected)


class Still(PathTask):
    """A path of which only the derivatives are of interest."""

    def __init__(self, first, second):
        self.dq_d, self.ddq_d = lambda s: first, lambda s: second

    def q_d(self, s):
        raise NotImplementedError

    def theta(self, s):
        raise NotImplementedError


@pytest.mark.parametrize("shape", [(), (3,), (2, 4), (0,)])
def test_ends_broadcast(shape):
    circle = Circle(0.5, 1.0)
    ends = np.linspace(0, 5, int(np.prod(shape))).reshape(shape)
    assert np.shape(circle.arc_length(0.0, ends)) == shape
    assert np.shape(circle.arc_length(ends)) == shape
    assert np.allclose(circle.arc_length(ends, 2.0), 1.0 - 0.5 * ends)
    assert circle.arc_length(ends, np.ones((5, *shape))).shape == (5, *shape)
    assert Line([0, 0], [1, 0], 1.0).arc_length(0.5, np.full(shape, 0.5)).shape == shape


@settings(max_examples=10)
@given(wobbles())
def test_computed_derivatives_are_good_enough(task):
    """Their noise of 1e-12 must not be mistaken for detail."""
    exact = quad(lambda s: np.linalg.norm(task.exact_dq_d(s)), 0, task.period, epsabs=0, epsrel=1e-12, limit=500)[0]
    assert task.arc_length() == pytest.approx(exact, rel=1e-10)


# --- the length as parameter --------------------------------------------------------------------------------------


@settings(max_examples=10)
@given(st.one_of(tasks(), st.integers(0, 99).map(lambda seed: spline(seed))))
def test_by_arc_length_it_is_the_same_motion_at_unit_slope(task):
    path = task.by_arc_length()
    check_task(path, 2)
    lower, upper = task.one_traverse
    assert path.one_traverse == pytest.approx((0.0, float(task.arc_length())), rel=1e-12)
    u = np.linspace(lower, upper, 41)
    s = task.arc_length(lower, u)
    assert np.allclose(np.linalg.norm(path.dq_d(s), axis=-1), 1.0, rtol=1e-14)
    # the exponent of q_d' near a cusp: an error of 1e-12 in u is one of ‖q_d''‖/‖q_d'‖² in the tangent
    stretch = 1 + np.abs(task.ddq_d(u)).max() / np.linalg.norm(task.dq_d(u), axis=-1).min() ** 2
    for got, want in ((path.q_d(s), task.q_d(u)), (path.at(s).velocity, task.at(u).velocity)):
        assert np.allclose(got, want, rtol=1e-9, atol=1e-10 * stretch)
    assert np.allclose(np.linalg.norm(path.ddq_d(s), axis=-1), task.curvature(u), rtol=1e-6, atol=1e-8 * stretch)
    assert np.abs((path.dq_d(s) * path.ddq_d(s)).sum(-1)).max() < 1e-10 * (1 + task.curvature(u).max())
    # the desired acceleration r'ϑ is that of the same motion
    mine, its = path.at(s), task.at(u)
    its = its.velocity_slope * its.theta[:, None]
    assert np.allclose(mine.velocity_slope * mine.theta[:, None], its, atol=1e-7 * stretch * (1 + np.abs(its).max()))


def spline(seed):
    points = np.stack([np.arange(6.0), np.random.default_rng(seed).uniform(-1, 1, 6)], axis=-1)
    return WaypointPath(points, 0.7)


FLAT, KNOT = Ellipse((1.0, 1e-3), 1.0), Lissajous([1.0, 0.5], [3, 4], 1.0)


@pytest.mark.parametrize("task", [Circle(0.7, 1.0), FLAT, KNOT, spline(0), Helix(1, 0.1).between(0, 9)])
def test_the_length_is_inverted_to_rounding(task):
    length = length_along(task, *task.one_traverse)
    wanted = length.total * np.random.default_rng(0).uniform(0, 1, 999)
    assert np.abs(length(length.inverse(wanted)) - wanted).max() < 1e-14 * length.total
    s = np.interp(np.random.default_rng(1).uniform(0, 1, 999), [0, 1], task.one_traverse)
    # where the path hardly moves with s, s cannot be known better than the length
    slowest = np.linalg.norm(task.dq_d(s), axis=-1)
    assert (np.abs(length.inverse(length(s)) - s) < 1e-14 * (np.abs(s) + length.total / slowest)).all()


@given(tasks(), st.integers(-4, 4))
def test_laps_of_a_closed_path(task, laps):
    path = task.by_arc_length()
    s = np.linspace(0, path.period, 9)[:-1]
    for got, want in zip(path.at(s + laps * path.period), path.at(s), strict=True):
        assert np.allclose(got, want, rtol=1e-6, atol=1e-7 * (1 + np.abs(want).max()))


@given(tasks(), st.integers(0, 99))
def test_the_projection_is_that_of_the_path_underneath(task, seed):
    path, rng = task.by_arc_length(), np.random.default_rng(seed)
    near = rng.uniform(0, task.period, 15)
    q = task.q_d(near) + 0.05 * rng.normal(size=(15, 2))
    for hint, length in ((None, None), (near, task.arc_length(0, near))):
        assert np.allclose(task.q_d(task.sigma_bar(q, hint)), path.q_d(path.sigma_bar(q, length)), atol=1e-9)


@given(st.sampled_from([FLAT, KNOT]), st.integers(1, 30))
def test_no_row_depends_on_the_others(task, count):
    path, s = task.by_arc_length(), np.linspace(-1, 9, count)
    assert np.array_equal(path.q_d(s), np.stack([path.q_d(x[None])[0] for x in s]))


def test_knots_stay_where_they_are_on_the_path():
    path = spline(1)
    straight = path.by_arc_length()
    assert np.allclose(straight.q_d(straight.knots), path.points, atol=1e-12)
    assert Circle(1.0, 1.0).by_arc_length().knots is None


def test_beyond_its_ends_an_open_path_stays_there():
    path = spline(2).by_arc_length()
    assert np.array_equal(path.q_d(np.array([-1.0, path.s_end + 1])), path.q_d(np.array([0.0, path.s_end])))


def test_it_is_recorded_and_pickled():
    path = Ellipse((1.0, 0.5), 2.0).by_arc_length()
    record = path.describe()
    assert (record["task"], record["path"]["task"]) == ("ArcLengthPath", "Ellipse")
    s = np.linspace(0, 3, 7)
    assert np.array_equal(pickle.loads(pickle.dumps(path)).q_d(s), path.q_d(s))


def test_an_arm_follows_it(ideal_arm):
    path = Lissajous([0.6, 0.4], [1, 2], 0.8).by_arc_length()
    law = Projection(ideal_arm, path, 800.0, [45.0, 100.0])
    run = simulate(law, path.q_d(np.array(0.0)), duration=1.0, progress=False)
    assert run.norm("e_p")[0, run.time > 0.7].max() < 1e-3
    assert run.array("s")[0, -1] == pytest.approx(0.8, abs=0.02)  # the path speed for a second


HERE = Wobble(np.zeros((1, 2)), np.zeros((1, 2)))


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda: Helix(1, 1).arc_length(), InputError, ["Helix neither ends nor repeats", "s_end"]),
        (lambda: Helix(1, 1).by_arc_length(), TaskError, ["Helix neither ends nor repeats", "between"]),
        (lambda: Line([0, 0], [1, 0], 1.0).arc_length(0.0, 1.5), InputError, ["s_end = 1.5", "from 0 to 1"]),
        (lambda: Line([0, 0], [1, 0], 1.0).arc_length(-0.1), InputError, ["s0 = -0.1", "from 0 to 1"]),
        (lambda: Circle(1.0, 1.0).arc_length(0.0, np.inf), InputError, ["s_end is inf", "finite"]),
        (lambda: Circle(1.0, 1.0).arc_length([0.0, 1.0], [1, 2, 3]), InputError, ["(2,)", "(3,)", "broadcast"]),
        (lambda: Circle(1.0, 1.0).arc_length("here"), InputError, ["s0 = 'here'", "numbers"]),
        (lambda: HERE.arc_length(), TaskError, ["Wobble has length 0", "standstill"]),
        (lambda: HERE.by_arc_length(), TaskError, ["Wobble has length 0", "standstill"]),
        (
            lambda: FunctionPath(lambda s: [s, np.nan], 1.0, s_end=1).arc_length(),
            TaskError,
            ["FunctionPath.q_d(s=0) = [0.0, nan]", "finite"],
        ),
    ],
)
def test_paths_without_a_length(make, kind, words):
    with pytest.raises(kind) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


def test_the_length_of_an_endless_path_between_two_places():
    assert Helix(3.0, 4.0).arc_length(1.0, 7.0) == pytest.approx(30.0, rel=1e-10)
