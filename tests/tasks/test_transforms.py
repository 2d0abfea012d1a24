"""Paths reversed, shifted, scaled and cut: the same figure elsewhere, with exact derivatives and projections."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import Wobble, floats, tasks, vectors

from pathcontrol import (
    Circle,
    ConstantRate,
    Ellipse,
    ExtendedMotionPlan,
    InputError,
    Line,
    PathTask,
    TaskError,
    WaypointPath,
    check_task,
    simulate,
)

TRANSFORMS = {
    "reversed": lambda task: task.reversed(),
    "shifted": lambda task: task.shifted([0.3, -0.2]),
    "scaled": lambda task: task.scaled(1.7),
    "mirrored": lambda task: task.scaled([-0.8, 0.8], about=[1.0, 0.0]),
    "stretched": lambda task: task.scaled([2.0, 0.5]),
    "between": lambda task: task.between(*np.interp([0.2, 0.7], [0, 1], task.one_traverse)),
    "by_arc_length": lambda task: task.by_arc_length(),
}


class Spiral(PathTask):
    """A path that goes on for ever and never repeats."""

    def q_d(self, s):
        return np.stack([s * np.cos(s), s * np.sin(s)], axis=-1)

    def theta(self, s):
        return np.full_like(s, 1.0)


@st.composite
def open_tasks(draw):
    """A regular open path for two joints."""
    kind = draw(st.sampled_from(["line", "spline", "stretch", "rate"]))
    speed, start = draw(floats(0.2, 2.0)), draw(vectors(2, 1.0))
    if kind == "line":
        return Line(start, start + np.array([1.0, draw(floats(-1, 1))]), speed)
    if kind == "rate":
        return Line(start, start + np.array([1.0, 0.5]), speed).with_profile(ConstantRate(speed))
    if kind == "spline":
        rng = np.random.default_rng(draw(st.integers(0, 99)))
        return WaypointPath(start + np.stack([np.arange(5.0), rng.uniform(-0.5, 0.5, 5)], axis=-1), speed)
    return draw(tasks()).between(0.3, 2.0)


EVERY = st.one_of(tasks(), open_tasks())
HOW = st.sampled_from(sorted(TRANSFORMS))


def inside(task, count=31):
    return np.linspace(*task.one_traverse, count)


@given(EVERY, HOW, HOW)
@settings(max_examples=15)
def test_derivatives_are_those_of_the_transformed_path(task, first, second):
    task = TRANSFORMS[second](TRANSFORMS[first](task))
    check_task(task, 2)
    lower, upper = task.one_traverse
    h = 1e-5 * (upper - lower)
    s = np.linspace(lower, upper, 31)[1:-1]
    for f, df in ((task.q_d, task.dq_d), (task.dq_d, task.ddq_d), (task.theta, task.dtheta)):
        difference = (f(s + h) - f(s - h)) / (2 * h)
        scale = np.abs(f(s)).max() / h
        # between the knots of a spline; h²/6 of a third derivative, and rounding
        assert np.median(np.abs(df(s) - difference)) <= 1e-6 * (1 + np.abs(difference).max()) + 1e-13 * scale
    for got, want in zip(task.at(s), (task.q_d, task.dq_d, task.ddq_d, task.theta, task.dtheta), strict=True):
        assert np.allclose(got, want(s), rtol=1e-11, atol=1e-11)


@given(EVERY, HOW, st.sampled_from([(), (3,), (2, 4), (0,)]))
def test_every_batch_shape(task, how, shape):
    task = TRANSFORMS[how](task)
    s = np.linspace(*task.one_traverse, int(np.prod(shape))).reshape(shape)
    point = task.at(s)
    assert [np.shape(a) for a in point] == [(*shape, 2)] * 3 + [shape] * 2
    assert task.q_d(s).shape == (*shape, 2)
    assert task.sigma_bar(task.q_d(s)).shape == shape
    assert np.allclose(task.q_d(s).reshape(-1, 2), [task.q_d(x) for x in s.ravel()] or np.empty((0, 2)), atol=1e-13)


# --- reversed -----------------------------------------------------------------------------------------------------


@given(EVERY)
def test_reversing_twice_changes_nothing(task):
    again, s = task.reversed().reversed(), inside(task)
    assert (again.s0, again.s_end, again.period) == (task.s0, task.s_end, task.period)
    for got, want in zip(again.at(s), task.at(s), strict=True):
        assert np.allclose(got, want, rtol=1e-12, atol=1e-9)


@given(EVERY)
def test_reversed_it_is_taken_backwards_as_fast(task):
    back, s = task.reversed(), inside(task)
    mirror = 2 * task.s0 if task.closed else task.s0 + task.s_end
    assert np.allclose(back.at(s).velocity, -task.at(mirror - s).velocity)
    assert np.allclose(back.q_d(task.s0), task.q_d(task.s0 if task.closed else task.s_end))
    # the desired acceleration r'ϑ does not know the direction
    forth, slope = task.at(mirror - s), back.at(s).velocity_slope
    assert np.allclose(slope * back.theta(s)[:, None], forth.velocity_slope * forth.theta[:, None], atol=1e-9)


@given(floats(0.3, 2), floats(0.2, 2), st.booleans())
def test_a_circle_reversed_is_the_circle_the_other_way_round(radius, speed, clockwise):
    s = np.linspace(-9, 9, 41)
    back, other = Circle(radius, speed, clockwise=clockwise).reversed(), Circle(radius, speed, clockwise=not clockwise)
    for got, want in zip(back.at(s), other.at(s), strict=True):
        assert np.allclose(got, want, atol=1e-13)
    q = np.random.default_rng(0).normal(size=(41, 2))
    assert np.allclose(back.sigma_bar(q), other.sigma_bar(q), atol=1e-12)
    assert np.allclose(back.sigma_bar(q, near=s), other.sigma_bar(q, near=s), atol=1e-12)


# --- projections --------------------------------------------------------------------------------------------------


def beside(task, seed):
    """Postures near the path, and where it passes them."""
    rng = np.random.default_rng(seed)
    lower, upper = task.one_traverse
    s = rng.uniform(lower, upper, 20)
    return task.q_d(s) + 0.05 * rng.normal(size=(20, 2)), s


@settings(max_examples=10)
@given(EVERY, st.integers(0, 99), vectors(2, 2.0), floats(0.2, 3), st.booleans())
def test_shifts_scales_and_reversals_commute_with_the_projection(task, seed, offset, factor, mirrored):
    q, near = beside(task, seed)
    about, factors = task.q_d(np.array(task.s0)), factor * np.array([1.0, -1.0 if mirrored else 1.0])
    mirror = 2 * task.s0 if task.closed else task.s0 + task.s_end
    for hint in (None, near):
        sigma = task.sigma_bar(q, hint)
        assert np.allclose(task.shifted(offset).sigma_bar(q + offset, hint), sigma, atol=1e-9)
        assert np.allclose(task.scaled(factors).sigma_bar(about + factors * (q - about), hint), sigma, atol=1e-9)
        back = task.reversed().sigma_bar(q, None if hint is None else mirror - hint)
        assert np.allclose(task.q_d(mirror - back), task.q_d(sigma), atol=1e-8)


@given(EVERY, HOW, st.integers(0, 99))
@settings(max_examples=12)
def test_projections_are_nearest_points(task, how, seed):
    task = TRANSFORMS[how](task)
    q, near = beside(task, seed)
    lower, upper = task.one_traverse
    s = task.sigma_bar(q)
    assert (s >= lower).all()
    assert (s <= upper).all()
    distance = np.linalg.norm(task.q_d(s) - q, axis=-1)
    samples = task.q_d(np.linspace(lower, upper, 2001))
    brute = np.linalg.norm(samples - q[:, None], axis=-1).min(-1)
    assert (distance <= brute + 1e-9).all()
    # and so are those followed from where the path passes, or nearer by
    followed = np.linalg.norm(task.q_d(task.sigma_bar(q, near)) - q, axis=-1)
    assert (followed <= np.linalg.norm(task.q_d(near) - q, axis=-1) + 1e-9).all()


@given(tasks(), st.integers(-5, 5), st.sampled_from(["reversed", "shifted", "scaled", "stretched", "by_arc_length"]))
def test_laps_are_counted(task, laps, how):
    task = TRANSFORMS[how](task)
    s = inside(task)[1:-1] + laps * task.period
    assert np.allclose(task.sigma_bar(task.q_d(s), near=s + 1e-3 * task.period), s, atol=1e-8 * (1 + np.abs(s)))


# --- shifted, scaled, between -------------------------------------------------------------------------------------


@given(EVERY, vectors(2, 2.0), st.one_of(floats(0.2, 3), floats(-3, -0.2), st.just([2.0, -0.5])), vectors(2, 1.0))
def test_where_shifted_and_scaled_paths_are(task, offset, factor, about):
    s = inside(task)
    assert np.array_equal(task.shifted(offset).q_d(s), task.q_d(s) + offset)
    scaled = about + np.asarray(factor) * (task.q_d(s) - about)
    assert np.allclose(task.scaled(factor, about).q_d(s), scaled, atol=1e-12)
    assert np.allclose(task.scaled(factor).q_d(task.s0), task.q_d(task.s0))
    assert np.array_equal(task.scaled(factor).theta(s), task.theta(s))
    again = task.shifted(offset).shifted(-np.asarray(offset)).scaled(4.0, about).scaled(0.25, about)
    assert np.allclose(again.q_d(s), task.q_d(s), atol=1e-12)


@given(tasks(), floats(-9, 9), floats(0.1, 20))
def test_a_stretch_of_a_closed_path_is_open_and_may_be_several_laps(task, start, length):
    part = task.between(start, start + length)
    assert not part.closed
    assert part.one_traverse == (start, start + length)
    s = inside(part)
    for got, want in zip(part.at(s), task.at(s), strict=True):
        assert np.array_equal(got, want)


@given(st.integers(0, 99), floats(-2, 2), floats(0.1, 3))
def test_the_knots_of_a_stretch_are_those_inside_it(seed, start, length):
    rng, laps = np.random.default_rng(seed), np.arange(-4, 8)
    corners = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    ring = WaypointPath(corners + rng.uniform(-0.2, 0.2, (4, 2)), 1.0, closed=True)
    start, end = ring.period * start, ring.period * (start + length)
    everywhere = np.unique((ring.knots[:-1] + laps[:, None] * ring.period).ravel())
    within = everywhere[(everywhere > start) & (everywhere < end)]
    assert np.allclose(ring.between(start, end).knots, [start, *within, end], atol=1e-12)
    assert np.allclose(ring.reversed().knots, ring.period - ring.knots[::-1], atol=1e-12)
    assert np.array_equal(ring.scaled(2.0).knots, ring.knots)
    assert Circle(1.0, 1.0).reversed().between(0, 9).knots is None


def test_an_endless_path_gets_an_end():
    part = Spiral().between(1.0, 12.0)
    check_task(part, 2)
    s = inside(part)
    assert np.allclose(part.sigma_bar(part.q_d(s)), s, atol=1e-8)
    check_task(part.reversed(), 2)
    with pytest.raises(TaskError, match="neither ends nor repeats"):
        Spiral().sigma_bar([1.0, 1.0])


# --- records, arms, mistakes --------------------------------------------------------------------------------------


def test_a_record_says_what_it_was_made_from():
    task = Ellipse((1.0, 0.5), 2.0).scaled(2.0, about=[0.0, 0.0]).reversed().between(1.0, 3.0).shifted([0.1, 0.2])
    record = task.describe()
    names = []
    while record:
        names.append(record["task"])
        inner = record.get("path")
        record = inner
    assert names == ["ShiftedPath", "PathSection", "ReversedPath", "ScaledPath", "Ellipse"]
    assert task.describe()["offset"] == [0.1, 0.2]
    assert (task.describe()["path"]["s0"], task.describe()["path"]["s_end"]) == (1.0, 3.0)
    assert task.describe()["path"]["path"]["path"]["factor"] == 2.0
    assert repr(task).startswith("ShiftedPath(PathSection(ReversedPath(ScaledPath(Ellipse(")


@given(EVERY, HOW)
def test_they_are_pickled(task, how):
    task = TRANSFORMS[how](task)
    again, s = pickle.loads(pickle.dumps(task)), inside(task)
    assert np.array_equal(again.q_d(s), task.q_d(s))


@pytest.mark.parametrize("how", sorted(TRANSFORMS))
def test_an_arm_follows_it(ideal_arm, how):
    task = TRANSFORMS[how](Ellipse((0.5, 0.3), 0.8))
    law = ExtendedMotionPlan(ideal_arm, task, 800.0, [45.0, 100.0], 20.0)
    run = simulate(law, task.q_d(np.array(task.s0)), duration=1.2, progress=False)
    assert run.norm("e_p")[0, -1] < 1e-3
    assert run.array("s")[0, -1] > task.s0 + 0.05


WIGGLE = Wobble(np.eye(2), np.eye(2)[::-1])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Spiral().reversed(), ["Spiral has no end", "between"]),
        (lambda: WIGGLE.shifted(0.1), ["offset has shape ()", "(2,)"]),
        (lambda: WIGGLE.shifted([0.1, np.inf]), ["offset[1] is inf"]),
        (lambda: WIGGLE.shifted(["a", "b"]), ["offset = ['a', 'b']", "numbers"]),
        (lambda: WIGGLE.scaled(0.0), ["factor = 0.0", "other than 0"]),
        (lambda: WIGGLE.scaled([1.0, 0.0]), ["factor = [1.0, 0.0]"]),
        (lambda: WIGGLE.scaled([1.0, 1.0, 1.0]), ["factor = [1.0, 1.0, 1.0]", "or 2 of them"]),
        (lambda: WIGGLE.scaled(2.0, about=[1.0]), ["about has shape (1,)", "(2,)"]),
        (lambda: WIGGLE.between(1.0, 1.0), ["s0 = 1 and s_end = 1", "s0 < s_end"]),
        (lambda: WIGGLE.between(0.0, np.inf), ["s_end = inf", "finite"]),
        (lambda: Line([0, 0], [1, 0], 1.0).between(-0.5, 0.5), ["s0 = -0.5", "from 0 to 1"]),
        (lambda: Line([0, 0], [1, 0], 1.0).between(0.5, 1.5), ["s_end = 1.5", "from 0 to 1"]),
    ],
)
def test_bad_transforms(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)
