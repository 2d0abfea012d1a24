"""Paths one after another: joined where they fit, blended where they do not, C² everywhere."""

from __future__ import annotations

import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import floats, tasks

from pathcontrol import (
    Circle,
    ConstantRate,
    ConstantSpeed,
    Ellipse,
    ExtendedMotionPlan,
    InputError,
    Line,
    WaypointPath,
    check_task,
    simulate,
)
from pathcontrol.tasks.function import FunctionPath
from pathcontrol.tasks.joined.concatenation import concatenated


def one_sided(f, s, h):
    """Value, first and second derivative of f at s, from s, s + h, … only; of fourth and third order in h."""
    nodes = np.arange(6)
    values = f(s + h * nodes)
    powers = np.vander(h * nodes.astype(float), 6, increasing=True)
    value, slope, half = np.linalg.solve(powers, values)[:3]
    return value, slope, 2 * half


def jumps(task, s, h=2e-3):
    """Jumps of q_d, q_d' and q_d'' at s, as differences of q_d from both sides show them."""
    pairs = zip(one_sided(task.q_d, s, h), one_sided(task.q_d, s, -h), strict=True)
    return np.array([np.abs(after - before).max() for after, before in pairs])


@st.composite
def polylines(draw):
    """Lines from corner to corner, each with a speed of its own, that nowhere turn straight back."""
    count, n = draw(st.integers(2, 4)), draw(st.integers(2, 3))
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    legs = rng.uniform(-1, 1, (count, n)) + 1.2 * np.eye(n)[0]
    corners = np.concatenate([np.zeros((1, n)), np.cumsum(legs, axis=0)])
    return [Line(a, b, rng.uniform(0.3, 2)) for a, b in pairwise(corners)]


@given(tasks(), floats(0.5, 2.5), floats(0.5, 2.5), floats(0.5, 1.2))
def test_the_stretches_of_a_path_joined_again_are_that_path(task, first, second, third):
    cuts = np.cumsum([0.1, first, second, third])
    whole = concatenated([task.between(a, b) for a, b in pairwise(cuts)])
    assert whole.one_traverse == pytest.approx((cuts[0], cuts[-1]))
    s = np.linspace(*whole.one_traverse, 101)
    for got, want in zip(whole.at(s), task.at(s), strict=True):
        assert np.allclose(got, want, rtol=1e-6, atol=1e-6)


@given(floats(0.3, 2), floats(0.3, 2), floats(0.2, 5))
def test_parameters_are_scaled_so_that_the_derivatives_are_continuous(first, second, stretch):
    """The same circle in two parametrisations."""
    circle = Circle(1.0, 0.8)
    after = FunctionPath(
        lambda u: circle.q_d(first + stretch * u),
        derivative=lambda u: stretch * circle.dq_d(first + stretch * u),
        second_derivative=lambda u: stretch**2 * circle.ddq_d(first + stretch * u),
        speed=0.8,
        s_end=second / stretch,
    )
    whole = concatenated([circle.between(0.0, first), after])
    assert whole.s_end == pytest.approx(first + second)
    s = np.linspace(0, whole.s_end, 51)
    for got, want in zip(whole.at(s), circle.at(s), strict=True):
        assert np.allclose(got, want, rtol=1e-9, atol=1e-9)


@given(polylines(), floats(0.01, 0.1))
def test_blends_make_corners_twice_continuously_differentiable(lines, blend):
    path = concatenated(lines, blend)
    check_task(path, lines[0].n)
    for s in path.knots[1:-1]:
        # by the exact derivatives, a step of 1e-9 to either side
        before, after = (path.at(np.array(s + side * 1e-9)) for side in (-1, 1))
        for a, b, scale in zip(before, after, (1, 1, 1 / blend, 1 / blend, 1 / blend), strict=True):
            assert np.abs(b - a).max() < 1e-6 * scale * (1 + np.abs(a).max())
        # and by what q_d shows: the third derivative jumps, so that q_d'' is found to first order in h
        h = 1e-3 * blend
        found = jumps(path, s, h)
        assert found[0] < 1e-12
        assert found[1] < 1e-6
        assert found[2] < 1e-3 / blend


@given(polylines(), floats(0.01, 0.1))
def test_a_blend_stays_in_the_corner(lines, blend):
    path = concatenated(lines, blend)
    for i, (before, after) in enumerate(pairwise(lines)):
        corner, u, v = before.end, (before.end - before.start) / before.s_end, (after.end - after.start) / after.s_end
        s = np.linspace(*path.knots[2 * i + 1 : 2 * i + 3], 51)
        q = path.q_d(s)
        assert np.allclose(q[[0, -1]], [corner - blend * u, corner + blend * v], atol=1e-9)
        # in the triangle of the corner and the two points where the blend leaves the lines
        inside = np.linalg.lstsq(np.stack([-u, v], axis=-1), (q - corner).T, rcond=None)[0] / blend
        assert np.allclose(corner + blend * (inside.T @ np.stack([-u, v])), q, atol=1e-9)
        assert inside.min() >= -1e-9
        assert inside.sum(0).max() <= 1 + 1e-9


@given(polylines(), floats(0.01, 0.1))
def test_every_path_keeps_its_speed_and_a_blend_goes_between(lines, blend):
    path = concatenated(lines, blend)
    knots = path.knots
    for i, line in enumerate(lines):
        s = np.linspace(knots[2 * i], knots[2 * i + 1], 9)[1:-1]
        assert np.allclose(np.linalg.norm(path.at(s).velocity, axis=-1), line.speed)
    s = np.linspace(*path.one_traverse, 999)
    rate = path.theta(s)
    # the parameter of lines is stretched alike, so that rates are speeds
    assert rate.min() >= min(line.speed for line in lines) * (1 - 1e-9)
    assert rate.max() <= max(line.speed for line in lines) * (1 + 1e-9)


def test_a_line_flows_into_an_arc_and_out_again():
    arc = Circle(1.0, 0.5).between(-np.pi / 2, np.pi / 2)
    path = concatenated([Line([-2, -1], [0, -1], 0.5), arc, Line([0, 1], [-2, 1], 0.5)], blend=0.2)
    check_task(path, 2)
    assert max(jumps(path, s)[2] for s in path.knots[1:-1]) < 0.1  # without a blend the curvature jumps by 1
    assert path.arc_length() == pytest.approx(4 + np.pi, rel=1e-3)
    assert path.curvature(np.linspace(*path.one_traverse, 400)).max() < 1.3


def test_a_blend_goes_only_where_it_is_needed():
    circle = Circle(1.0, 0.5)
    smooth = [circle.between(0, 1), circle.between(1, 2)]
    assert len(concatenated(smooth, blend=0.1).knots) == 3
    assert len(concatenated([*smooth, Line(circle.q_d(np.array(2.0)), [1.0, 1.5], 0.5)], blend=0.1).knots) == 5


def test_a_gap_is_bridged_by_a_blend_that_is_wider():
    path = concatenated([Line([0, 0], [1, 0], 0.5), Line([1.05, 0.02], [2, 0], 0.5)], blend=0.1)
    check_task(path, 2)
    assert max(jumps(path, s, 1e-4)[1] for s in path.knots[1:-1]) < 1e-5


def test_joining_in_steps_is_joining_at_once():
    circle = Circle(1.0, 0.5)
    a, b, c = circle.between(0, 1), circle.between(1, 2).by_arc_length(), circle.between(2, 3)
    s = np.linspace(0, 3, 61)
    once = concatenated([a, b, c])
    for steps in (concatenated([concatenated([a, b]), c]), concatenated([a, concatenated([b, c])])):
        for got, want in zip(steps.at(s), once.at(s), strict=True):
            assert np.allclose(got, want, atol=1e-9)


@pytest.mark.parametrize("shape", [(), (3,), (2, 4), (0,)])
def test_every_batch_shape(shape):
    path = concatenated([Line([0, 0], [1, 0], 0.5), Line([1, 0], [1, 1], 1.0)], blend=0.1)
    s = np.random.default_rng(0).permutation(np.linspace(0, 2, int(np.prod(shape)))).reshape(shape)
    assert [a.shape for a in path.at(s)] == [(*shape, 2)] * 3 + [shape] * 2
    for got, want in zip(path.at(s), (path.q_d, path.dq_d, path.ddq_d, path.theta, path.dtheta), strict=True):
        assert np.array_equal(got, want(s))
    assert np.allclose(path.q_d(s).reshape(-1, 2), [path.q_d(x) for x in s.ravel()] or np.empty((0, 2)))


@given(polylines(), floats(0.01, 0.1), st.integers(0, 99))
def test_its_projection_is_the_nearest_point(lines, blend, seed):
    path = concatenated(lines, blend)
    rng = np.random.default_rng(seed)
    q = path.q_d(rng.uniform(*path.one_traverse, 20)) + 0.3 * rng.normal(size=(20, path.n))
    distance = np.linalg.norm(path.q_d(path.sigma_bar(q)) - q, axis=-1)
    samples = path.q_d(np.linspace(*path.one_traverse, 4001))
    assert (distance <= np.linalg.norm(samples - q[:, None], axis=-1).min(-1) + 1e-9).all()


def test_its_knots_are_those_of_its_pieces():
    spline = WaypointPath([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]], 1.0)
    path = concatenated([spline, spline.shifted([2.0, 0.0])], blend=0.05)
    u, (_, start, end, _, _) = spline.knots[1], path.knots[[0, 2, 3, 4, 5]]
    assert path.knots[1] == u
    assert np.allclose(path.q_d(path.knots[[1, 4]]), spline.q_d(u) + np.array([[0, 0], [2, 0]]), atol=1e-12)
    assert end - start == pytest.approx(0.1 / np.linalg.norm(path.dq_d(start)))


def test_the_record_and_pickles():
    path = concatenated([Line([0, 0], [1, 0], 0.5), Circle(1.0, 0.5).between(0.0, 1.0)], blend=0.1)
    record = path.describe()
    assert (record["task"], record["blend"]) == ("ConcatenatedPath", 0.1)
    assert [inner["task"] for inner in record["paths"]] == ["Line", "PathSection"]
    s = np.linspace(*path.one_traverse, 9)
    assert np.array_equal(pickle.loads(pickle.dumps(path)).q_d(s), path.q_d(s))


def test_an_arm_follows_it(ideal_arm):
    path = concatenated([Line([0, 0], [0.6, 0], 0.5), Line([0.6, 0], [0.6, 0.5], 0.8)], blend=0.1)
    law = ExtendedMotionPlan(ideal_arm, path, 800.0, [45.0, 100.0], 20.0)
    run = simulate(law, path.q_d(np.array(0.0)), duration=4.0, progress=False)
    assert run.norm("e_p").max() < 0.01
    assert np.allclose(run.array("q")[0, -1], [0.6, 0.5], atol=1e-3)


RIGHT, UP = Line([0, 0], [1, 0], 0.5), Line([1, 0], [1, 1], 0.5)
SHORT, AWAY = Line([1, 0], [1, 0.15], 0.5), Line([1, 0.15], [2, 0], 0.5)
BEND = Circle(1.0, 0.5, center=[1.0, 1.0]).between(-np.pi / 2, 0)
ELLIPSE = Ellipse((1.0, 0.5), 0.5)


@pytest.mark.parametrize(
    ("paths", "blend", "words"),
    [
        ([RIGHT, UP], None, ["paths[0] and paths[1]", "turns by 90°", "blend"]),
        ([RIGHT, UP.reversed()], None, ["joint 1 ends at 0 and begins at 1 rad", "the second is reversed()"]),
        ([RIGHT.reversed(), UP], 0.1, ["joint 0 ends at 0 and begins at 1", "the first is reversed()"]),
        ([RIGHT, UP.shifted([0.2, 0.0])], None, ["joint 0", "0.2 rad apart", "blend=0.2"]),
        ([RIGHT, UP.shifted([0.2, 0.0])], 0.1, ["0.2 rad apart", "blend=0.2"]),
        ([RIGHT, Line([1, 0], [2, 0], 0.6)], None, ["speed jumps from 0.5 to 0.6 rad/s", "with_profile"]),
        ([RIGHT, BEND], None, ["curvature of joint 1", "0 to 1 1/rad"]),
        ([ELLIPSE.between(0.3, 1.0).by_arc_length(), ELLIPSE.between(1.0, 2.0)], None, ["by_arc_length() of both"]),
        ([RIGHT, RIGHT.reversed()], 0.1, ["turns straight back"]),
        ([RIGHT, SHORT, AWAY], 0.1, ["paths[1] has the length 0.15", "0.075"]),
        ([RIGHT, Circle(1.0, 0.5)], None, ["paths[1], a Circle, is closed", "between"]),
        ([RIGHT], None, ["1 paths", "two or more"]),
        ([RIGHT, "up"], None, ["paths[1] = 'up'", "PathTask"]),
        ([RIGHT, Line([1, 0, 0], [1, 1, 0], 0.5)], None, ["paths[1] has 3 joints and paths[0] has 2"]),
        ([RIGHT, UP], 0.0, ["blend = 0", "greater than 0"]),
    ],
)  # fmt: skip
def test_paths_that_do_not_join(paths, blend, words):
    with pytest.raises(InputError) as error:
        concatenated(paths, blend)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_what_the_messages_propose_helps():
    check_task(concatenated([RIGHT, UP.reversed().reversed()], blend=0.1), 2)
    check_task(concatenated([ELLIPSE.between(0.3, 1.0).by_arc_length(), ELLIPSE.between(1.0, 2.0).by_arc_length()]), 2)
    check_task(concatenated([p.with_profile(ConstantSpeed(0.4)) for p in (RIGHT, Line([1, 0], [2, 0], 0.6))]), 2)
    check_task(concatenated([p.with_profile(ConstantRate(0.4)) for p in (RIGHT, UP)], blend=0.1), 2)
