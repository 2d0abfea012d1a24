"""Smooth tool curves: C², exact for quintics, periodic when closed, a nanometre from the segments they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from contours import KINDS, SEEDS, brute, pose, segment, traced, unit
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from strategies import floats

from pathcontrol import InputError, ToolCurve
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.segment import Polyline
from pathcontrol.toolpaths.smoothing.hermite_data import ByLength, curved_stretch
from pathcontrol.toolpaths.smoothing.smooth import regularize

X, Y, Z = np.eye(3)
T = np.linspace(0.0, 1.0, 501)


def hermite(seed: int, closed: bool = False, shortest: float = -1.0) -> tuple[ToolCurve, np.ndarray]:
    """A curve with random values (3, k + 1, 3) of p, p' and p'' at its knots, from 10^shortest to 1 apart."""
    rng = np.random.default_rng(seed)
    count = rng.integers(2, 12)
    values = rng.normal(size=(3, count + 1, 3))
    if closed:
        values[:, -1] = values[:, 0]
    return ToolCurve(np.cumsum(10 ** rng.uniform(shortest, 0, count + 1)), *values, closed), values


def samples(curve: ToolCurve) -> np.ndarray:
    return curve.s0 + curve.length * T


# --- the quintics -------------------------------------------------------------------------------------------


@given(SEEDS, st.integers(0, 5))
def test_it_reproduces_polynomials_up_to_the_fifth_degree(seed, degree):
    rng = np.random.default_rng(seed)
    line = [np.polynomial.Polynomial(c) for c in rng.normal(size=(3, degree + 1))]
    s = np.sort(rng.uniform(-1, 1, 6))

    def at(x: np.ndarray, order: int) -> np.ndarray:
        return np.stack([(axis.deriv(order) if order else axis)(x) for axis in line], axis=-1)

    curve = ToolCurve(s, *(at(s, order) for order in range(3)))
    for order, value in enumerate(curve.at(samples(curve))):
        assert np.allclose(value, at(samples(curve), order), rtol=0, atol=1e-11 / np.diff(s).min() ** order)


@given(SEEDS, st.booleans())
def test_it_has_what_it_was_given_at_its_knots_from_both_sides(seed, closed):
    curve, values = hermite(seed, closed, shortest=-3.0)
    h = np.diff(curve.knots).min()  # rounding may put a knot into its neighbour
    for i in range(len(curve.knots) - 1):
        left, right = curve.at(curve.knots[i]), curve.at(np.nextafter(curve.knots[i + 1], curve.s0))
        for order, (a, b) in enumerate(zip(left, right, strict=True)):
            noise = 1e-11 * (1 + 1 / h) / h**order  # also that of s itself, which is known to a part in 10^16
            assert np.allclose(a, values[order][i], rtol=0, atol=noise)
            assert np.allclose(b, values[order][i + 1], rtol=0, atol=noise)
    s = samples(curve)
    assert np.array_equal(curve.position(s), curve.at(s).p)
    assert np.allclose(np.cross(curve.tangent(s), curve.at(s).dp), 0, atol=1e-12 * np.abs(curve.at(s).dp).max())
    assert np.allclose(np.linalg.norm(curve.tangent(s), axis=-1), 1)


@given(SEEDS, st.integers(-3, 3))
def test_a_closed_curve_is_periodic_and_an_open_one_ends(seed, laps):
    closed, open_ended = hermite(seed, closed=True)[0], hermite(seed)[0]
    s = samples(closed)[:-1]
    for order, (value, later) in enumerate(zip(closed.at(s), closed.at(s + laps * closed.length), strict=True)):
        assert np.allclose(value, later, rtol=0, atol=1e-9 * 10**order)
    for beyond, end in ((open_ended.s0 - 1, open_ended.s0), (open_ended.s_end + 1, open_ended.s_end)):
        assert np.array_equal(open_ended.position(beyond), open_ended.position(end))


@settings(max_examples=12)
@given(SEEDS, st.booleans(), floats(-3.0, 1.0))
def test_the_nearest_point_is_that_of_a_dense_polygon(seed, closed, exponent):
    (curve, _), rng = hermite(seed, closed), np.random.default_rng(seed)
    x = curve.position(rng.uniform(curve.s0, curve.s_end, 20)) + 10**exponent * rng.normal(size=(20, 3))
    size = np.ptp(curve.position(samples(curve)), axis=0).max()
    distance = curve.distance(x)
    assert np.abs(distance - brute(x, traced([curve], 1e-5 * size))).max() < 3e-5 * size
    s = curve.nearest(x)
    assert np.allclose(np.linalg.norm(curve.position(s) - x, axis=-1), distance, rtol=0, atol=1e-12)
    assert np.allclose(curve.nearest(x, near=s), s, rtol=0, atol=1e-6 * curve.length)


def test_it_is_found_again_on_a_long_curve():
    """10^5 knots, each point nearest to its own place, also with a guess beside it."""
    rng, angle = np.random.default_rng(0), np.linspace(0, 400 * np.pi, 100_001)
    r, slope = 1 + 1e-3 * angle, 1e-3
    radial = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    across = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)
    p, dp = r[:, None] * radial, slope * radial + r[:, None] * across
    curve = ToolCurve(angle, p, dp, 2 * slope * across - r[:, None] * radial)
    s = rng.uniform(1, 400 * np.pi - 1, 1000)
    x = curve.position(s) + 1e-4 * Z
    assert np.allclose(curve.nearest(x), s, rtol=0, atol=1e-9)
    assert np.allclose(curve.nearest(x, near=s + 0.2), s, rtol=0, atol=1e-9)


# --- in closed form -----------------------------------------------------------------------------------------


@given(floats(-4.0, 1.0), SEEDS)
def test_a_circle_is_one_to_a_nanometre(exponent, seed):
    rng, radius = np.random.default_rng(seed), 10**exponent
    center, normal, start = rng.normal(size=(3, 3))
    curve = ToolCurve.circle(center, radius, normal, start)
    p, dp, ddp = curve.at(samples(curve))
    outward, axis = (p - center) / radius, unit(normal)
    assert np.abs(np.linalg.norm(p - center, axis=-1) - radius).max() < 1e-9
    assert np.abs((p - center) @ axis).max() < 1e-12 * (1 + radius)
    assert np.allclose(np.linalg.norm(dp, axis=-1), 1, rtol=0, atol=1e-4)
    assert np.allclose(np.cross(outward, dp), axis, rtol=0, atol=1e-4)  # counterclockwise
    assert np.allclose(radius * ddp, -outward, rtol=0, atol=1e-2)
    assert outward[0] @ start == pytest.approx(np.linalg.norm(start - (start @ axis) * axis))
    assert curve.length == pytest.approx(2 * np.pi * radius, rel=1e-12)


@given(SEEDS)
def test_a_line_is_straight_with_unit_speed(seed):
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    curve = ToolCurve.line(a, b)
    p, dp, ddp = curve.at(samples(curve))
    assert np.allclose(p, a + T[:, None] * (b - a), rtol=0, atol=1e-12)
    assert np.allclose(dp, (b - a) / curve.length, rtol=0, atol=1e-12)
    assert np.abs(ddp).max() < 1e-11 / curve.length**2


@given(SEEDS, st.booleans())
def test_a_spline_is_that_of_scipy(seed, closed):
    points = np.random.default_rng(seed).normal(size=(8, 3))
    ring = np.concatenate([points, points[:1]]) if closed else points
    curve = ToolCurve.spline(points, closed)
    assert np.allclose(np.diff(curve.knots), np.linalg.norm(np.diff(ring, axis=0), axis=-1))
    exact = CubicSpline(curve.knots, ring, bc_type="periodic" if closed else "natural")
    for order, value in enumerate(curve.at(samples(curve)[:-1])):
        assert np.allclose(value, exact(samples(curve)[:-1], order), rtol=0, atol=1e-8)


# --- in place of segments -----------------------------------------------------------------------------------


@settings(max_examples=12)
@given(st.sampled_from([kind for kind in KINDS if kind != "lines"]), SEEDS, floats(-3.0, 1.0))
def test_curves_for_segments_are_within_a_nanometre_and_of_unit_speed(kind, seed, exponent):
    """Between any two arc lengths; all but segments that bend within a hair's breadth, which are not followed so."""
    rng, size = np.random.default_rng(seed), 10**exponent
    one = segment(kind, rng, size, size * rng.normal(size=3), unit(rng.normal(size=3)), planar=False)
    if regularize(one, 1e-7)[0] is not one:
        return
    start, end = one.length * np.sort(rng.choice([0.0, 1.0, *rng.uniform(size=2)], 2, replace=False))
    stretch = curved_stretch(one, start, end)
    curve = ToolCurve(*stretch.knots)
    s = np.concatenate([samples(curve), (curve.knots[:-1] + np.outer([0.25, 0.5, 0.75], np.diff(curve.knots))).ravel()])
    p, dp, _ = curve.at(s)
    assert one.distance(p).max() <= 1e-9 + 1e-13 * size
    exact = ByLength(one).at(start + s)
    assert np.linalg.norm(p - exact.p, axis=-1).max() <= 1e-9 + 1e-13 * size
    assert np.allclose(np.linalg.norm(exact.dp, axis=-1), 1, rtol=0, atol=1e-9)
    assert np.abs(np.linalg.norm(dp, axis=-1) - 1).max() < 0.05
    assert stretch.knots.s[-1] == pytest.approx(end - start)


@given(SEEDS, floats(1e-3, 1.0), floats(0.1, 40.0), floats(-1.0, 1.0))
def test_by_its_length_a_helix_is_its_closed_form(seed, radius, sweep, rise):
    """p(s) = (r cos φ, r sin φ, c φ), φ = s/√(r² + c²): a constant curvature r/(r² + c²)."""
    moved = pose(np.random.default_rng(seed))
    helix = ByLength(Arc(0 * Z, radius * X, radius * Y, 0.0, sweep, rise * Z).placed(moved))
    c = rise / sweep
    phi = sweep * T
    p, t, k = helix.at(np.hypot(radius, c) * phi)
    local = np.stack([radius * np.cos(phi), radius * np.sin(phi), c * phi], axis=-1)
    inward = -np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
    assert np.allclose(p, local @ moved[:3, :3].T + moved[:3, 3], rtol=0, atol=1e-11)
    assert np.allclose(k, radius / (radius**2 + c**2) * inward @ moved[:3, :3].T, rtol=1e-6, atol=1e-6 / radius)
    assert np.allclose(np.linalg.norm(t, axis=-1), 1)


@settings(max_examples=12)
@given(st.sampled_from(["ellipse", "degenerate", "near cusp", "rational"]), SEEDS, floats(-6.0, -3.0))
def test_what_bends_too_sharply_becomes_a_polyline_as_near_as_said(kind, seed, exponent):
    rng, tolerance = np.random.default_rng(seed), 10**exponent
    one = segment(kind, rng, 0.1, rng.normal(size=3), unit(rng.normal(size=3)), planar=False)
    other, apart = regularize(one, tolerance)
    if other is one:
        assert apart == 0
        return
    assert isinstance(other, Polyline)
    assert np.array_equal(other.points[[0, -1]], one.point(np.array([0.0, 1.0])))
    assert one.distance(other.points).max() < 1e-9
    dense = one.point(np.unique(np.concatenate([np.linspace(0, 1, 2001), 0.5 + np.linspace(-0.01, 0.01, 2001)])))
    assert other.distance(dense).max() <= 1.01 * apart + 1e-9
    assert apart <= 1.2 * tolerance
    assert one.distance(other.point(T)).max() <= 1.01 * apart + 1e-9


def test_a_segment_too_far_away_for_a_nanometre_is_named():
    far = Arc(np.array([1e9, 0, 0]), X, Y, 0.0, 1.0)
    with pytest.raises(InputError, match=r"a Arc of length 1 m at .* cannot be followed to 1 nm.*too far from"):
        curved_stretch(far, 0.0, far.length)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ToolCurve([0.0, 0.0], *np.zeros((3, 2, 3))), ["increasing knots"]),
        (lambda: ToolCurve([0.0], *np.zeros((3, 1, 3))), ["(1,)", "(k + 1, 3)"]),
        (lambda: ToolCurve([0.0, 1.0], *np.zeros((3, 2, 2))), ["(k + 1, 3)"]),
        (lambda: ToolCurve([0.0, np.nan], *np.zeros((3, 2, 3))), ["s[1] is nan"]),
        (lambda: ToolCurve([0.0, 1.0], [X, Y], [X, X], [X, X], closed=True), ["closed", "last knot"]),
        (lambda: ToolCurve.line(X, X), ["start and end", "needs a length"]),
        (lambda: ToolCurve.circle(X, 0.0), ["radius = 0", "greater than 0"]),
        (lambda: ToolCurve.circle(X, 1.0, normal=0 * X), ["normal = [0.0, 0.0, 0.0]"]),
        (lambda: ToolCurve.circle(X, 1.0, start=Z), ["start = [0.0, 0.0, 1.0]", "another direction"]),
        (lambda: ToolCurve.spline([X, Y, Z]), ["(3, 3)", "at least 4"]),
        (lambda: ToolCurve.spline([X, Y, Z, X], closed=True), ["at least 5"]),
        (lambda: ToolCurve.spline([X, Y, Y, Z]), ["points 1 and 2 are the same"]),
    ],
)
def test_bad_curves(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)
