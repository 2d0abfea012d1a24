"""Segments of contours: closed forms, brute force, and what moving and reversing them must not change."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from contours import KINDS, SEEDS, brute, contour, polygon, pose, segment, unit
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipe, ellipeinc
from strategies import floats

from pathcontrol import InputError
from pathcontrol.geometry.arc_length import ArcLength
from pathcontrol.geometry.box_hierarchy import BoxHierarchy
from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline, Segment

U = np.linspace(0.0, 1.0, 33)
CURVED = tuple(kind for kind in KINDS if kind != "lines")
X, Y, Z = np.eye(3)


def any_segment(kind: str, seed: int, size: float = 1.0) -> Segment:
    rng = np.random.default_rng(seed)
    return segment(kind, rng, size, rng.normal(size=3), unit(rng.normal(size=3)), planar=False)


# --- derivatives and arc length -----------------------------------------------------------------------------


@given(st.sampled_from(CURVED), SEEDS)
def test_derivatives_are_those_of_an_interpolating_polynomial(kind, seed):
    """Through Chebyshev points of a short stretch, on which the segments are analytic."""
    one, h = any_segment(kind, seed), 1e-2
    middle = np.random.default_rng(seed).uniform(h, 1 - h)
    x = np.cos(np.pi * (np.arange(8) + 0.5) / 8)
    fit = np.polynomial.polynomial.polyfit(x, one.point(middle + h * x), 7)
    largest = np.abs(one.derivative(np.linspace(0, 1, 101), 2)).max() + one.length
    assert np.allclose(fit[1] / h, one.derivative(np.array(middle)), rtol=0, atol=1e-9 * largest + 1e-12)
    assert np.allclose(2 * fit[2] / h**2, one.derivative(np.array(middle), 2), rtol=0, atol=1e-6 * largest + 1e-9)


@given(SEEDS, st.integers(1, 12))
def test_a_bezier_curve_of_any_degree_is_its_bernstein_sum(seed, degree):
    rng = np.random.default_rng(seed)
    points, weights = rng.normal(size=(degree + 1, 3)), 10 ** rng.uniform(-1, 1, degree + 1)
    rows = [np.column_stack([points * weights[:, None], weights])] * len(U)
    casteljau = np.array(rows)
    while casteljau.shape[1] > 1:
        casteljau = (1 - U)[:, None, None] * casteljau[:, :-1] + U[:, None, None] * casteljau[:, 1:]
    assert np.allclose(Bezier(points, weights).point(U), casteljau[:, 0, :3] / casteljau[:, 0, 3:], atol=1e-12)


@given(floats(1e-3, 10.0), floats(-20.0, 20.0).filter(lambda a: abs(a) > 1e-3), floats(-3.0, 3.0))
def test_a_helix_has_the_length_of_its_closed_form(radius, sweep, rise):
    helix = Arc(Z, radius * X, radius * Y, 0.3, sweep, rise * Z)
    assert helix.length == pytest.approx(np.hypot(radius * sweep, rise), rel=1e-12)


@given(floats(-4.0, 0.0), floats(0.1, 12.0))
def test_an_ellipse_has_the_length_of_the_elliptic_integral(exponent, sweep):
    b = 10**exponent
    one = Arc(Z, b * X, Y, 0.0, sweep)  # speed² = cos² + b² sin² = 1 − (1 − b²) sin²
    assert one.length == pytest.approx(ellipeinc(sweep, 1 - b**2), rel=1e-12)
    assert Arc(Z, Y, b * X, 0.0, 2 * np.pi).length == pytest.approx(4 * ellipe(1 - b**2), rel=1e-12)


def test_the_length_of_a_cusp():
    """y² = x³ from u = −1 to 1: p = (u², u³), which stands still at its middle."""
    points = [[1, -1, 0], [-1 / 3, 1, 0], [-1 / 3, -1, 0], [1, 1, 0]]
    assert np.allclose(Bezier(points).point(U)[:, 1] ** 2, Bezier(points).point(U)[:, 0] ** 3)
    assert Bezier(points).length == pytest.approx(2 * (13**1.5 - 8) / 27, rel=1e-10)


@given(st.sampled_from(KINDS), SEEDS)
def test_the_length_is_that_of_a_dense_polygon(kind, seed):
    one = any_segment(kind, seed)
    points = one.points if isinstance(one, Polyline) else polygon(one.point, np.linspace(0, 1, 257), 1e-6 * one.length)
    inscribed = np.linalg.norm(np.diff(points, axis=0), axis=-1).sum()
    assert inscribed <= one.length * (1 + 1e-12)
    assert inscribed >= one.length * (1 - 1e-3)


@given(st.sampled_from(KINDS), SEEDS)
def test_the_way_back_from_the_arc_length(kind, seed):
    one = any_segment(kind, seed)
    s = one.length * np.linspace(0, 1, 50)
    u = one.arc_length.inverse(s)
    assert np.all(np.diff(u) > 0)
    assert (u[0], u[-1]) == pytest.approx((0, 1), abs=1e-6)  # at an end where it stands still u is not known better
    for i in (10, 25, 49):
        part = ArcLength(lambda v, end=u[i]: end * one.derivative(end * v), 0.0, 1.0, cusps=True)
        assert part.total == pytest.approx(s[i], rel=1e-10)


# --- distances ----------------------------------------------------------------------------------------------


@given(SEEDS, floats(1e-3, 10.0), floats(-12.0, 12.0).filter(lambda a: abs(a) > 1e-2))
def test_the_distance_to_an_arc_is_its_closed_form(seed, radius, sweep):
    """In the arc's own plane polar coordinates; elsewhere Pythagoras. The general search agrees."""
    rng = np.random.default_rng(seed)
    moved = pose(rng)
    one = Arc(np.zeros(3), radius * X, radius * Y, rng.uniform(-9, 9), sweep).placed(moved)
    x = 3 * radius * rng.normal(size=(40, 3))
    on_arc = np.exp(1j * (one.start + sweep * np.linspace(0, 1, 20001))) * radius
    flat = x[:, 0] + 1j * x[:, 1]
    apart = np.abs(flat[:, None] - on_arc).min(1)
    expected = np.hypot(apart, x[:, 2])
    given_points = x @ moved[:3, :3].T + moved[:3, 3]
    assert np.allclose(one.distance(given_points), expected, rtol=0, atol=2e-6 * radius)
    assert np.allclose(one.distance(given_points), Segment.distance(one, given_points), rtol=0, atol=1e-9 * radius)


def test_the_distance_from_the_axis_of_a_circle_and_of_a_helix():
    height = np.linspace(-2, 2, 9)
    circle, helix = Arc(0 * Z, X, Y, 0.4, 2 * np.pi), Arc(-3 * Z, X, Y, 0.0, 20 * np.pi, 6 * Z)
    assert np.allclose(circle.distance(height[:, None] * Z), np.hypot(1, height), atol=1e-12)
    assert np.allclose(helix.distance(height[:, None] * Z), 1.0, atol=1e-9)


@settings(max_examples=12)
@given(st.sampled_from(KINDS), SEEDS, floats(-6.0, 2.0))
def test_distances_are_those_of_a_dense_polygon(kind, seed, exponent):
    one, rng = any_segment(kind, seed), np.random.default_rng(seed)
    x = one.point(rng.uniform(size=20)) + 10**exponent * one.length * rng.normal(size=(20, 3))
    sagitta = 1e-6 * one.length
    points = one.points if isinstance(one, Polyline) else polygon(one.point, np.linspace(0, 1, 129), sagitta)
    distance = one.distance(x)
    assert np.abs(distance - brute(x, points)).max() <= 3 * sagitta + 1e-13 * np.abs(x).max()
    assert np.all(one.distance(one.point(U)) <= 1e-7 * one.length)
    assert one.distance(x.reshape(4, 5, 3)).shape == (4, 5)
    assert np.array_equal(np.isnan(one.distance(np.where(np.arange(20)[:, None] == 3, np.nan, x))), np.arange(20) == 3)


@given(SEEDS, st.integers(1, 300))
def test_a_polyline_with_edges_of_any_length_is_searched_whole(seed, count):
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(count, 3)) * 10 ** rng.uniform(-6, 0, (count, 1))
    line = Polyline(np.cumsum(np.concatenate([rng.normal(size=(1, 3)), steps]), axis=0))
    x = line.point(rng.uniform(size=40)) + rng.normal(size=(40, 3)) * 10 ** rng.uniform(-6, 2, (40, 1))
    assert np.allclose(line.distance(x), brute(x, line.points), rtol=1e-12, atol=1e-14)
    assert line.distance(np.empty((0, 3))).shape == (0,)


ANGLE = np.linspace(0, 2 * np.pi, 100_001)
LONG = {
    "walk": np.cumsum(np.random.default_rng(0).normal(size=(100_001, 3)), axis=0),
    "circle": np.stack([np.cos(ANGLE), np.sin(ANGLE), 0 * ANGLE], axis=-1),
    "hatching": np.stack(
        [np.tile([0.0, 1.0, 1.0, 0.0], 25_000), 1e-5 * np.repeat(np.arange(50_000), 2), np.zeros(100_000)], axis=-1
    ),
    "scribble": np.random.default_rng(0).uniform(size=(3001, 3)),
    "to and fro": np.tile([[0.0, 0, 0], [1, 0, 0]], (5000, 1)),
}


@pytest.mark.parametrize("name", LONG)
def test_long_polylines_take_little_memory_anywhere_around_them(name):
    """Also where all edges are equally near, as to the centre of a circle."""
    rng, line = np.random.default_rng(1), Polyline(LONG[name])
    near = line.point(rng.uniform(size=300)) + 1e-4 * rng.normal(size=(300, 3))
    x = np.concatenate([near, 1e-9 * rng.normal(size=(12, 3)), 1e3 * rng.normal(size=(12, 3))])
    tracemalloc.start()
    distance = line.distance(x)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    few = np.append(np.arange(0, 300, 20), [300, 312])
    assert np.allclose(distance[few], brute(x[few], line.points), rtol=1e-12, atol=1e-12)
    assert peak < 1.5e8


@given(SEEDS, st.integers(1, 600), st.integers(0, 50))
def test_boxes_name_all_that_is_nearer_than_the_bound(seed, count, points):
    rng = np.random.default_rng(seed)
    lower = np.cumsum(rng.normal(size=(count, 3)), axis=0)
    upper = lower + rng.exponential(size=(count, 3))
    x, bound = lower[rng.integers(count, size=points)] + rng.normal(size=(points, 3)), rng.exponential(size=points)
    named = {
        (int(r), int(b))
        for rows, boxes in BoxHierarchy(lower, upper).nearer(x, bound)
        for r, b in zip(rows, boxes, strict=True)
    }
    away = np.linalg.norm(x[:, None] - np.clip(x[:, None], lower, upper), axis=-1)
    assert named == {(int(r), int(b)) for r, b in np.argwhere(away < bound[:, None])}


@settings(max_examples=10)
@given(SEEDS, floats(-4.0, 1.0))
def test_a_contour_is_as_near_as_the_nearest_of_its_segments(seed, exponent):
    rng = np.random.default_rng(seed)
    whole = contour(rng, 1.0, closed=bool(rng.integers(2)))
    x = np.concatenate([s.point(rng.uniform(size=5)) for s in whole.segments])
    x += 10**exponent * rng.normal(size=x.shape)
    assert np.allclose(whole.distance(x), np.min([s.distance(x) for s in whole.segments], axis=0), rtol=0, atol=1e-12)


# --- moves and bounds ---------------------------------------------------------------------------------------


@settings(max_examples=12)
@given(st.sampled_from(KINDS), SEEDS)
def test_placing_is_an_isometry_and_follows_the_group(kind, seed):
    rng, one = np.random.default_rng(seed), any_segment(kind, seed)
    a, b = pose(rng), pose(rng)
    there, x = one.placed(a), one.point(U) + rng.normal(size=(len(U), 3))
    assert np.allclose(there.point(U), one.point(U) @ a[:3, :3].T + a[:3, 3], atol=1e-12)
    assert there.length == pytest.approx(one.length, rel=1e-9)
    assert np.allclose(there.distance(x @ a[:3, :3].T + a[:3, 3]), one.distance(x), atol=1e-9)
    assert np.allclose(there.placed(b).point(U), one.placed(b @ a).point(U), atol=1e-12)
    assert np.allclose(there.placed(np.linalg.inv(a)).point(U), one.point(U), atol=1e-12)
    if kind != "lines":  # at its points a polyline has two derivatives
        assert np.allclose(there.derivative(U, 2), one.derivative(U, 2) @ a[:3, :3].T, atol=1e-9)


@given(st.sampled_from(KINDS), SEEDS)
def test_reversing_twice_changes_nothing(kind, seed):
    one = any_segment(kind, seed)
    back = one.reversed()
    assert np.allclose(back.point(U), one.point(1 - U), rtol=0, atol=1e-12)
    assert np.allclose(back.reversed().point(U), one.point(U), rtol=0, atol=1e-12)
    assert back.length == pytest.approx(one.length, rel=1e-11)
    if kind != "lines":
        assert np.allclose(back.derivative(U), -one.derivative(1 - U), atol=1e-11)
        assert np.allclose(back.derivative(U, 2), one.derivative(1 - U, 2), atol=1e-9)


@given(SEEDS)
def test_a_contour_reversed_and_placed_is_that_of_its_segments(seed):
    rng = np.random.default_rng(seed)
    whole = contour(rng, 1.0, closed=bool(rng.integers(2)))
    back, a = whole.reversed(), pose(rng)
    assert np.allclose([*back.start, *back.end], [*whole.end, *whole.start])
    assert back.length == pytest.approx(whole.length)
    assert back.points == whole.points
    assert np.allclose(whole.placed(a).start, a[:3, :3] @ whole.start + a[:3, 3])


@settings(max_examples=10)
@given(st.sampled_from(KINDS), SEEDS, floats(-1.0, 2.0))
def test_bounds_hold_all_points_and_no_more(kind, seed, exponent):
    one = any_segment(kind, seed)
    if isinstance(one, Arc):  # also of many turns
        one = Arc(one.center, one.x, one.y, one.start, 10**exponent, one.rise)
    points = one.points if isinstance(one, Polyline) else one.point(np.linspace(0, 1, 100_001))
    size = np.ptp(points, axis=0).max()
    lower, upper = one.bounds
    assert np.all(lower <= points.min(0) + 1e-8 * size)
    assert np.all(upper >= points.max(0) - 1e-8 * size)
    assert np.allclose([lower, upper], [points.min(0), points.max(0)], rtol=0, atol=1e-5 * size)


@settings(max_examples=8)
@given(floats(-3.0, 3.0), SEEDS)
def test_rational_quadratics_make_a_whole_circle(exponent, seed):
    """Four quarters with the weight 1/√2, and one arc: the same points, length, distances and bounds."""
    radius, moved, w = 10**exponent, pose(np.random.default_rng(seed)), np.sqrt(0.5)
    corners = radius * np.array([X, X + Y, Y, Y - X, -X, -X - Y, -Y, X - Y, X])
    whole = Contour(tuple(Bezier(corners[i : i + 3], [1.0, w, 1.0]) for i in (0, 2, 4, 6)), closed=True).placed(moved)
    circle = Arc(np.zeros(3), radius * X, radius * Y, 0.0, 2 * np.pi).placed(moved)
    x = radius * np.random.default_rng(seed).normal(size=(20, 3)) + moved[:3, 3]
    assert whole.length == pytest.approx(2 * np.pi * radius, rel=1e-12)
    assert np.allclose(whole.distance(x), circle.distance(x), rtol=0, atol=1e-9 * radius)
    assert np.allclose(whole.bounds, circle.bounds, rtol=0, atol=1e-8 * radius)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Polyline([[0, 0, 0]]), ["(1, 3)", "at least 2"]),
        (lambda: Polyline([[0, 0], [1, 1]]), ["(2, 2)"]),
        (lambda: Polyline([[0, 0, 0], [1, 0, 0], [1, 1e-11, 0]]), ["points 1 and 2", "leave one"]),
        (lambda: Polyline([[0, 0, 0], [1, np.inf, 0]]), ["points[1, 1] is inf"]),
        (lambda: Arc(np.zeros(2), X, Y, 0.0, 1.0), ["center has shape (2,)"]),
        (lambda: Arc(0 * Z, X, 2 * X, 0.0, 1.0), ["no length"]),
        (lambda: Arc(0 * Z, X, Y, 0.0, 0.0), ["sweep = 0"]),
        (lambda: Arc(0 * Z, X, Y, np.nan, 1.0), ["start = nan"]),
        (lambda: Bezier([[0, 0, 0]]), ["(1, 3)", "degree ≥ 1"]),
        (lambda: Bezier([[1, 0, 0], [1, 0, 0]]), ["all control points are the same"]),
        (lambda: Bezier([X, Y], [1.0, 0.0]), ["weights = [1.0, 0.0]", "greater than 0"]),
        (lambda: Contour((Polyline([X, Y]),), closed=True), ["do not meet", "1.41421 m"]),
    ],
)
def test_bad_segments(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)
