"""Paths as a file keeps them: the same to the last bit where they are the library's own, else within 1e-10."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline
from strategies import floats, tasks, vectors, wobbles

from pathcontrol import (
    Circle,
    ConstantRate,
    ConstantSpeed,
    Ellipse,
    FunctionPath,
    InputError,
    JointMotion,
    Line,
    Lissajous,
    MotionLimit,
    PathSequence,
    PathTask,
    SmoothStartStop,
    SplinePath,
    SymbolicPath,
    TaskError,
    VelocityProfile,
    WaypointPath,
    check_task,
    concatenated,
    distance_to_gamma,
    limited,
    time_optimal,
)
from pathcontrol.geometry.hermite import hermite_polynomials, sample_adaptively
from pathcontrol.simulation.storage.array_store import ArrayStore
from pathcontrol.simulation.storage.task_recipes import task_of, task_recipe
from pathcontrol.tasks.laps import Laps
from pathcontrol.tasks.recorded import RecordedPath, RecordedProfile

#: of the largest value of each: what RecordedPath documents for q_d and q_d', and what follows for the others
CURVE = {"q_d": 1e-11, "dq_d": 2e-9, "ddq_d": 1e-6}
RATE = {"theta": 4e-9, "dtheta": 2e-5}


def again(task, upto=None):
    """The task of its recipe, through the text of a file."""
    store = ArrayStore()
    text = json.dumps(task_recipe(task, store, upto))
    return task_of(json.loads(text), ArrayStore(store.numbers))


def places(task, count=2001):
    lower, upper = task.sampled_interval
    return lower + (upper - lower) * np.modf(0.618034 * np.arange(count))[0]


def assert_same_domain(task, other):
    assert (other.s0, other.s_end, other.period, other.n) == (task.s0, task.s_end, task.period, task.n)


def assert_identical(task, other):
    assert_same_domain(task, other)
    for value, expected in zip(other.at(places(task)), task.at(places(task)), strict=True):
        assert np.array_equal(value, expected)


def assert_close(task, other, s=None, within=CURVE | RATE):
    assert_same_domain(task, other)
    s = places(task) if s is None else s
    point, recorded = task.at(s), other.at(s)
    for name, tolerance in within.items():
        value, expected = getattr(recorded, name), getattr(point, name)
        rounding = 1e-9 if name == "ddq_d" else 1e-12  # of differences over cells of 1/256, once and twice
        assert np.abs(value - expected).max() <= tolerance * np.abs(expected).max() + rounding, name
        assert np.array_equal(np.shape(getattr(other, name)(s[0])), np.shape(expected)[1:])


class Slow(VelocityProfile):
    """A profile of the user."""

    def theta(self, path, s):
        return 1.2 + np.sin(s)

    def dtheta(self, path, s):
        return np.cos(s)


# --- the library's own --------------------------------------------------------------------------------------

HOME = np.array([0.1, -0.2, 0.3])
RING = Circle(0.7, 1.1, center=HOME, joints=(2, 0), clockwise=True)
WAY = WaypointPath([[0, 0, 0], [1, 0.5, 0.2], [1.2, -0.4, 0.1], [0.3, 0.3, -1]], 0.8)
EXACT = {
    "circle": RING,
    "ellipse": Ellipse((0.3, 0.9), 1.3, center=HOME, joints=(1, 2)),
    "figure of eight": Lissajous([0.5, 0.4, 0.1], [1, 2, 3], 0.6, phases=[0, 0.3, 0.1], center=HOME),
    "line": Line(HOME, [1.0, 2.0, 3.0], 0.7),
    "backwards": RING.reversed(),
    "moved": Line(HOME, 2 * HOME, 0.1).shifted([0.1, 0.2, 0.3]).scaled([1.0, 2.0, 3.0]).reversed(),
    "a stretch": RING.between(1.0, 15.0),
    "laps": Laps(RING, 3),
    "a rate": RING.with_profile(ConstantRate(0.3)),
    "another profile": RING.with_profile(ConstantSpeed(0.2)).with_profile(ConstantRate(0.1)).shifted(HOME),
    "a table": Line(HOME, 2 * HOME, 0.1).with_profile(
        limited(Line(HOME, 2 * HOME, 0.1), MotionLimit(JointMotion(), 0.1, tangential=1.0))
    ),
    "several": PathSequence([Line(HOME, 2 * HOME, 0.1), Line(2 * HOME, HOME, 0.2)]),
    "several with gaps": PathSequence([Line(HOME, 2 * HOME, 0.1), Laps(RING, 2)], gaps=True),
}


@pytest.mark.parametrize("name", EXACT)
def test_curves_of_the_library_are_the_same_to_the_last_bit(name):
    task = EXACT[name]
    other = again(task)
    assert type(other) is type(task)
    assert_identical(task, other)
    check_task(other, 3)
    q = task.q_d(places(task, 50)) + 0.05
    assert np.array_equal(other.sigma_bar(q), task.sigma_bar(q))


def test_a_library_curve_whose_domain_was_changed_is_kept_as_it_is():
    task = Line([0.0, 0.0], [1.0, 1.0], 0.5)
    task.s_end = 0.5
    other = again(task)
    assert isinstance(other, RecordedPath)
    assert_close(task, other)


@given(tasks())
@settings(max_examples=10)
def test_random_tasks_are_kept_with_their_projection(task):
    other = again(task)
    check_task(other, 2)
    assert_close(task, other)
    s = places(task, 60)
    # beside the path, nearer than its centre of curvature, so that one point of it is the nearest
    q = task.q_d(s) + 0.03 * np.array([np.cos(9 * s), np.sin(9 * s)]).T
    difference = (other.sigma_bar(q) - task.sigma_bar(q)) / task.period
    assert np.abs(difference - np.round(difference)).max() < 1e-9
    assert np.allclose(
        other.sigma_bar(q, near=s + 2 * task.period), task.sigma_bar(q, near=s + 2 * task.period), atol=1e-8
    )
    qd = task.at(s).velocity
    assert np.abs(distance_to_gamma(task, q, qd) - distance_to_gamma(other, q, qd)).max() < 1e-8


# --- splines ------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.sampled_from([3, 5]), st.booleans(), st.integers(8, 40))
@settings(max_examples=25)
def test_splines_are_the_same_up_to_rounding_with_their_knots(seed, degree, closed, count):
    rng = np.random.default_rng(seed)
    s, q = np.cumsum(rng.uniform(0.2, 1.0, count)), np.cumsum(rng.normal(size=(count, 3)), axis=0)
    q[-1] = q[0] if closed else q[-1]
    spline = make_interp_spline(s, q, k=degree, bc_type="periodic" if closed else None)
    task = SplinePath(spline, 0.7, closed)
    assert np.allclose(task.q_d(places(task)), spline(places(task)), rtol=0, atol=1e-11 * np.abs(q).max())
    other = again(task)
    assert np.array_equal(other.knots, task.knots)
    assert other.samples.shape == task.knots.shape  # no more samples than knots
    assert_close(task, other, within={"q_d": 1e-13, "dq_d": 1e-12, "ddq_d": 1e-11})


@pytest.mark.parametrize(
    "task",
    [
        WAY,
        WAY.by_arc_length(),
        WAY.with_profile(SmoothStartStop(WAY, ConstantSpeed(0.5), 2.0, 20.0)),
        WAY.with_profile(Slow()),
        RING.with_profile(Slow()).between(0.3, 2.0),
        concatenated([WAY, Line([0.3, 0.3, -1], [1, 0, 0], 0.5)], blend=0.1),
        FunctionPath(lambda s: [np.cos(s), np.sin(2 * s)], 0.5, period=2 * np.pi),
        FunctionPath(lambda s: [np.cos(s), s], theta=lambda s: 2 + np.cos(s), s0=-1.0, s_end=4.0),
        SymbolicPath(["cos(s)", "sin(s)*exp(-s/9)"], 1.0, s_end=12.0),
    ],
    ids=lambda task: type(task).__name__,
)
def test_what_else_the_library_makes_is_kept(task):
    other = again(task)
    assert_close(task, other)
    check_task(other, task.n)
    assert_identical(other, again(other))  # kept again, nothing is lost any more


def test_the_fastest_profile_is_kept_to_the_last_bit(arm):
    path = WaypointPath([[0, 0], [1, 0.5], [1.2, -0.4], [0.3, 0.3]], 0.8)
    task = path.with_profile(time_optimal(arm, path))
    s = places(task)
    assert np.array_equal(again(task).theta(s), task.theta(s))
    assert np.array_equal(again(task).dtheta(s), task.dtheta(s))


# --- endless ones, and odd ones -----------------------------------------------------------------------------


class Endless(PathTask):
    def q_d(self, s):
        return np.stack([np.sin(s), 0.3 * np.asarray(s)], axis=-1)

    def theta(self, s):
        return 1 + 0.3 * np.sin(3 * s)


class Projected(Endless):
    def sigma_bar(self, q, near=None):
        return np.maximum(np.asarray(q)[..., 1] / 0.3, 0.0)  # not the nearest point, but one near by


@pytest.mark.parametrize("upto", [0.0, 5.0, 40.0])
def test_of_an_endless_path_the_part_that_was_used_is_kept(upto):
    task = Endless()
    other = again(task, upto)
    assert_close(task, other, np.linspace(0, max(upto, 2 * np.pi), 999))
    check_task(other, 2)
    with pytest.raises(TaskError, match="the endless Endless is known up to s = "):
        other.q_d(np.array([0.0, 2 * upto + 10.0]))
    with pytest.raises(TaskError, match="neither ends nor repeats"):
        other.sigma_bar(np.zeros(2))


def test_an_endless_path_with_a_projection_has_one_again():
    other = again(Projected(), 9.0)
    s = np.linspace(0.5, 8.0, 40)
    assert np.allclose(other.sigma_bar(other.q_d(s)), s, atol=1e-8)


class Kinked(PathTask):
    """q_d' is continuous, q_d'' and ϑ' are not: less than a path should be, at places it does not tell."""

    s_end = 4.0
    at_s = np.array([0.7, 1.9, 3.3])

    def beyond(self, s, power):
        return (np.maximum(np.asarray(s)[..., None] - self.at_s, 0.0) ** power).sum(-1)

    def q_d(self, s):
        return np.stack([np.asarray(s) * 1.0, self.beyond(s, 2)], axis=-1)

    def theta(self, s):
        return 1.0 + self.beyond(s, 1)


class ToldKinks(Kinked):
    """The same with its derivatives in closed form: computed ones are blurred by the kinks."""

    def dq_d(self, s):
        return np.stack([1.0 + 0 * np.asarray(s), 2 * self.beyond(s, 1)], axis=-1)

    def ddq_d(self, s):
        return np.stack([0.0 * np.asarray(s), 2.0 * (np.asarray(s)[..., None] > self.at_s).sum(-1)], axis=-1)

    def dtheta(self, s):
        return 1.0 * (np.asarray(s)[..., None] > self.at_s).sum(-1)


@pytest.mark.parametrize(
    ("task", "near", "samples"),
    [(ToldKinks(), {"q_d": 1e-12, "theta": 1e-12}, 500), (Kinked(), {"q_d": 1e-9, "theta": 1e-5}, 2**12 + 257)],
)
def test_kinks_that_a_path_does_not_tell_are_followed(task, near, samples):
    other = again(task)
    s = np.sort(np.concatenate([places(task), task.at_s + 1e-6, task.at_s - 1e-6]))
    for name, tolerance in near.items():
        assert np.abs(getattr(other, name)(s) - getattr(task, name)(s)).max() < tolerance
    assert len(other.samples) <= samples


class Noisy(Endless):
    """As of single precision, and derivatives that do not fit."""

    s_end = 6.0

    def q_d(self, s):
        return super().q_d(np.asarray(s)).astype(np.float32).astype(float)

    def dq_d(self, s):
        return np.stack([np.cos(s), 0.3 + 1e-3 * np.cos(77 * np.asarray(s))], axis=-1)

    def ddq_d(self, s):
        return np.stack([-np.sin(s), 0.0 * np.asarray(s)], axis=-1)


def test_a_path_of_low_precision_is_kept_in_bounded_room():
    other = again(Noisy())
    s = places(other)
    assert np.abs(other.q_d(s) - Noisy().q_d(s)).max() < 1e-6  # of a float32
    assert len(other.samples) <= 2**12 + 257


# --- the polynomials ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("derivatives", "order"), [(1, 4), (2, 6)])
def test_the_error_falls_with_the_order(derivatives, order):
    functions = [np.sin, np.cos, lambda s: -np.sin(s)][: derivatives + 1]

    def error(cells):
        s = np.linspace(0.0, 2.0, cells + 1)
        x = np.linspace(0.0, 2.0, 997)
        return np.abs(hermite_polynomials(s, np.stack([f(s) for f in functions])[..., None])(x)[:, 0] - np.sin(x)).max()

    assert np.log2(error(4) / error(8)) == pytest.approx(order, abs=0.4)


@given(vectors(6, 2.0), st.sampled_from([1, 2]), floats(0.01, 3.0))
def test_polynomials_of_the_degree_are_reproduced(coefficients, derivatives, width):
    polynomial = np.polynomial.Polynomial(coefficients[: 2 * derivatives + 2])
    s = np.array([0.3, 0.3 + width, 0.3 + 2.5 * width])
    jets = np.stack([polynomial.deriv(k)(s) if k else polynomial(s) for k in range(derivatives + 1)])[..., None]
    x = np.linspace(s[0], s[-1], 101)
    scale = 1 + np.abs(polynomial(x)).max()
    assert np.abs(hermite_polynomials(s, jets)(x)[:, 0] - polynomial(x)).max() <= 1e-11 * scale


@given(wobbles())
@settings(max_examples=10)
def test_the_samples_are_values_of_the_function(task):
    def jet(s):
        return np.stack([task.q_d(s), task.exact_dq_d(s), task.exact_ddq_d(s)])

    s, jets = sample_adaptively(jet, np.linspace(0, 2 * np.pi, 5))
    assert np.array_equal(jets, jet(s))
    assert (np.diff(s) > 0).all()
    x = places(task)
    assert (
        np.abs(hermite_polynomials(s, jets)(x) - task.q_d(x)).max() <= 1e-11 * np.ptp(task.q_d(x), axis=0).max() + 1e-14
    )


# --- what is no task ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("recipe", "message"),
    [
        ({"class": "os.system"}, "class 'os.system' of a task, expected one of Circle, Ellipse"),
        ({"class": "Circle", "radius": -1, "speed": 1}, "radius = -1, expected a number greater than 0"),
        ({"class": "Circle", "size": 1}, "no recipe of a task"),
        ({"class": "ConstantRate", "rate": 1.0}, "expected one of a task"),
        ({"class": "Line", "start": {"shape": [9], "at": 0}, "end": 0, "speed": 1}, r"shape \[9\] is said to be at 0"),
        ({"class": "Line", "start": {"shape": [-1], "at": 0}, "end": 0, "speed": 1}, r"shape \[-1\]"),
        ({"class": "Line", "start": {"shape": [2], "at": -1}, "end": 0, "speed": 1}, "to be at -1"),
        ([], "expected one of a task"),
        ("Circle", "expected one of a task"),
    ],
)
def test_what_is_no_recipe_says_so(recipe, message):
    with pytest.raises(InputError, match=message):
        task_of(recipe, ArrayStore(np.zeros(3)))


def test_a_recipe_without_end_is_refused():
    recipe = {"class": "Circle", "radius": 1.0, "speed": 1.0}
    for _ in range(100_000):
        recipe = {"class": "ReversedPath", "path": recipe}
    with pytest.raises(InputError, match="no recipe of a task"):
        task_of(recipe, ArrayStore(np.zeros(0)))


@pytest.mark.parametrize(
    ("s", "jets", "message"),
    [
        ([0.0], np.zeros((3, 1, 2)), "expected two or more increasing parameters"),
        ([0.0, 0.0], np.zeros((3, 2, 2)), "expected two or more increasing parameters"),
        ([0.0, 1.0], np.zeros((2, 2, 2)), r"jets have shape \(2, 2, 2\), expected \(3, 2, n\)"),
        ([0.0, 1.0], np.full((3, 2, 2), np.nan), "expected finite numbers"),
    ],
)
def test_samples_that_make_no_path_are_refused(s, jets, message):
    with pytest.raises(InputError, match=message):
        RecordedPath(s, jets, ConstantRate(1.0))
    with pytest.raises(InputError, match=r"expected \(2, 2\)"):
        RecordedProfile([0.0, 1.0], np.zeros((3, 2)))
