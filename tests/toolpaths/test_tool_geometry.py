"""Segments, smooth curves and blended corners: closed forms, dense brute force, and continuity at the knots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import floats

from pathcontrol import Contour, InputError, ToolCurve, UnknownNameError, smooth
from pathcontrol.toolpaths.gcode.strokes import ContourBuilder
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline

U = np.linspace(0.0, 1.0, 41)
SEEDS = st.integers(0, 10**6)


def segment(kind: str, seed: int):
    rng = np.random.default_rng(seed)
    if kind == "polyline":
        return Polyline(np.cumsum(rng.normal(size=(rng.integers(2, 8), 3)), axis=0))
    if kind == "arc":
        x, y = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
        sweep, rise = rng.uniform(0.3, 6), 0.2 * rng.normal(size=3)
        return Arc(rng.normal(size=3), x, rng.uniform(0.5, 2) * y, rng.uniform(-3, 3), sweep, rise)
    weights = rng.uniform(0.5, 2, 4) if kind == "rational" else None
    return Bezier(np.cumsum(rng.uniform(0.2, 1, size=(4, 3)), axis=0), weights)


KINDS = ["polyline", "arc", "bezier", "rational"]


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=15)
@given(seed=SEEDS)
def test_a_segment_is_what_it_says(kind, seed):
    one = segment(kind, seed)
    dense = one.point(np.linspace(0, 1, 20001))
    chords = one.points if kind == "polyline" else dense
    assert one.length == pytest.approx(np.linalg.norm(np.diff(chords, axis=0), axis=-1).sum(), rel=1e-6)
    lower, upper = one.bounds
    slack = 1e-5 * np.linalg.norm(upper - lower)
    assert np.all(dense >= lower - slack)
    assert np.all(dense <= upper + slack)
    if kind != "polyline":
        h = 1e-5
        difference = (one.point(U[1:-1] + h) - one.point(U[1:-1] - h)) / (2 * h)
        assert np.allclose(difference, one.derivative(U[1:-1]), atol=1e-7 * one.length)
        difference = (one.derivative(U[1:-1] + h) - one.derivative(U[1:-1] - h)) / (2 * h)
        assert np.allclose(difference, one.derivative(U[1:-1], 2), atol=1e-5 * one.length)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=4)
@given(seed=SEEDS)
def test_distances_are_those_of_brute_force_and_moves_keep_them(kind, seed):
    one, rng = segment(kind, seed), np.random.default_rng(seed + 1)
    x = one.point(rng.uniform(size=30)) + rng.normal(size=(30, 3))
    dense = one.point(np.linspace(0, 1, 20001))
    brute = np.linalg.norm(x[:, None] - dense, axis=-1).min(1)
    step = np.linalg.norm(np.diff(dense, axis=0), axis=-1).max()
    distance = one.distance(x)
    assert np.all(distance <= brute + 1e-9)
    assert np.all(distance >= brute - step)
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose[:3, :3] *= np.sign(np.linalg.det(pose[:3, :3]))
    pose[:3, 3] = rng.normal(size=3)
    assert np.allclose(one.placed(pose).distance(x @ pose[:3, :3].T + pose[:3, 3]), distance, atol=1e-9)
    back = one.reversed()
    assert np.allclose(back.point(1 - U), one.point(U), atol=1e-12)
    assert np.allclose(back.distance(x), distance, atol=1e-9)


def test_a_rational_bezier_is_a_circle():
    quarter = Bezier([[1, 0, 0], [1, 1, 0], [0, 1, 0]], [1.0, np.sqrt(0.5), 1.0])
    assert np.allclose(np.linalg.norm(quarter.point(U), axis=-1), 1.0, atol=1e-15)
    assert quarter.length == pytest.approx(np.pi / 2, rel=1e-12)


def test_a_long_polyline_is_searched_whole():
    rng = np.random.default_rng(0)
    points = np.cumsum(rng.normal(size=(100_001, 3)), axis=0)
    line, x = Polyline(points), points[rng.integers(0, 100_000, 12)] + 3 * rng.normal(size=(12, 3))
    a, step = points[:-1], np.diff(points, axis=0)
    exact = []
    for one in x:
        t = np.clip(((one - a) * step).sum(-1) / (step**2).sum(-1), 0, 1)
        exact.append(np.linalg.norm(one - a - t[:, None] * step, axis=-1).min())
    assert np.allclose(line.distance(x), exact, atol=1e-9)


# --- tool curves --------------------------------------------------------------------------------------------


def assert_smooth(curve: ToolCurve) -> None:
    """p, p' and p'' are continuous at the knots, p' and p'' the derivatives of p, and p never stands still."""
    h = 1e-3 * np.diff(curve.knots).min()
    inner = curve.knots[1:-1] if not curve.closed else curve.knots[:-1]
    before, after = curve.at(inner - 1e-9 * h), curve.at(inner + 1e-9 * h)
    largest = [np.abs(value).max() for value in curve.at(np.append(curve.knots, curve.knots[:-1] + h))]
    for left, right, scale in zip(before, after, largest, strict=True):
        assert np.abs(left - right).max(initial=0.0) <= 1e-5 * scale + 1e-9
    s = curve.s0 + curve.length * np.linspace(0, 1, 2001)[1:-1]
    speed = np.linalg.norm(curve.at(s).dp, axis=-1)
    assert speed.min() > 0.45
    assert speed.max() < 2.1
    assert np.linalg.norm(np.diff(curve.position(s), axis=0), axis=-1).max() <= 2.1 * np.diff(s).max()


@given(floats(0.001, 2.0), SEEDS)
def test_a_circle_is_round_to_a_nanometre(radius, seed):
    rng = np.random.default_rng(seed)
    centre, normal = rng.normal(size=3), rng.normal(size=3)
    curve = ToolCurve.circle(centre, radius, normal, start=rng.normal(size=3))
    x = curve.position(np.linspace(0, curve.s_end, 999)) - centre
    assert np.abs(np.linalg.norm(x, axis=-1) - radius).max() < 1e-9
    assert np.abs(x @ normal).max() < 1e-9 * np.linalg.norm(normal)
    assert curve.length == pytest.approx(2 * np.pi * radius)
    turning = np.cross(x, curve.at(np.linspace(0, curve.s_end, 999)).dp) @ normal
    assert turning.min() > 0  # counterclockwise seen against the normal
    assert_smooth(curve)


@given(SEEDS, st.booleans())
def test_a_spline_passes_its_points(seed, closed):
    points = np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.0, size=(8, 3)), axis=0)
    curve = ToolCurve.spline(points, closed)
    assert np.allclose(curve.position(curve.knots[:8]), points, atol=1e-12)
    assert curve.closed == closed
    assert np.allclose(curve.distance(points), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ToolCurve.line([0, 0, 0], [0, 0, 0]), "the same point"),
        (lambda: ToolCurve.circle([0, 0, 0], -1.0), "radius = -1"),
        (lambda: ToolCurve.circle([0, 0, 0], 1.0, normal=[0, 0, 0]), "a vector with a length"),
        (lambda: ToolCurve.circle([0, 0, 0], 1.0, start=[0, 0, 1]), "points along the normal"),
        (lambda: ToolCurve.spline([[0, 0, 0], [1, 0, 0]]), "at least 4 points"),
        (lambda: Polyline([[0, 0, 0], [0, 0, 0]]), "points 0 and 1 are the same"),
        (lambda: Arc([0, 0, 0], [1, 0, 0], [2, 0, 0], 0.0, 1.0), "has no length"),
        (lambda: Bezier([[0, 0, 0], [0, 0, 0]]), "has no length"),
        (lambda: Contour(()), "at least one segment"),
        (lambda: Contour((Polyline([[0, 0, 0], [1, 0, 0]]),), feed=0.0), "feed = 0.0"),
        (lambda: Contour((Polyline([[0, 0, 0], [1, 0, 0]]), Polyline([[2, 0, 0], [3, 0, 0]]))), "a gap of 1 m"),
    ],
)
def test_bad_geometry_is_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


# --- blended corners ----------------------------------------------------------------------------------------


def contour(seed: int, size: float, closed: bool) -> Contour:
    """Straight edges, arcs and Bézier curves that meet at any angle."""
    rng = np.random.default_rng(seed)
    builder = ContourBuilder(np.zeros(3))
    for _ in range(rng.integers(2, 6)):
        here, kind = builder.position, rng.integers(3)
        if kind == 0:
            for _ in range(rng.integers(1, 5)):
                builder.line_to(builder.position + size * rng.uniform(-1, 1, 3) * rng.choice([0.05, 1.0]))
        elif kind == 1:
            x, y = np.linalg.qr(rng.normal(size=(3, 2)))[0].T * size * rng.uniform(0.1, 1)
            builder.add(Arc(here - x, x, y, 0.0, rng.uniform(0.3, 5.0)))
        else:
            builder.add(Bezier(here + size * np.concatenate([np.zeros((1, 3)), rng.uniform(-1, 1, (3, 3))])))
    if closed:
        builder.close()
    return builder.contour()


@settings(max_examples=5, deadline=None)
@given(SEEDS, st.sampled_from([0.01, 0.2, 5.0]), st.sampled_from([1e-5, 1e-4, 1e-3]), st.booleans(), st.booleans())
def test_smooth_curves_keep_the_tolerance_on_both_sides(seed, size, tolerance, closed, stop):
    given_contour = contour(seed, size, closed)
    result = smooth(given_contour, tolerance, "stop" if stop else "blend")
    for curve in result.curves:
        assert_smooth(curve)
    x = np.concatenate([c.position(c.s0 + c.length * np.linspace(0, 1, 1001)) for c in result.curves])
    there = given_contour.distance(x).max()
    drawing = np.concatenate([s.point(np.linspace(0, 1, 101)) for s in given_contour.segments])
    back = np.min([curve.distance(drawing) for curve in result.curves], axis=0).max()
    assert max(there, back) <= tolerance * (1 + 1e-6) + 2e-9
    assert max(there, back) <= result.deviation * (1 + 1e-2) + 1e-8
    if not given_contour.closed:
        assert np.allclose(x[0], given_contour.start, atol=2e-9)
        assert np.allclose(x[-1], given_contour.end, atol=2e-9)


@given(floats(0.1, 2.6), floats(1e-5, 1e-3))
def test_a_blend_passes_a_corner_at_the_tolerance(turn, tolerance):
    points = [[-1.0, 0, 0], [0, 0, 0], [np.cos(turn), np.sin(turn), 0]]
    result = smooth(Contour((Polyline(points),)), tolerance)
    (curve,) = result.curves
    assert curve.distance(np.zeros(3)) == pytest.approx(tolerance, rel=0.02)
    assert result.deviation == pytest.approx(tolerance, rel=0.02)
    assert len(result.corners) == 1
    assert result.corners[0].turn == pytest.approx(turn)


@given(SEEDS, st.booleans())
def test_a_polyline_becomes_a_curve_within_the_tolerance(seed, closed):
    angle = np.linspace(0, 5.0, 6) + np.random.default_rng(seed).uniform(-0.3, 0.3, 6)
    points = np.stack([np.cos(angle), np.sin(angle), 0.1 * np.sin(3 * angle)], axis=-1)
    curve = ToolCurve.polyline(points, 1e-3, closed)
    assert curve.closed == closed
    assert curve.distance(points).max() <= 1.001e-3
    assert_smooth(curve)


def test_a_polyline_that_turns_back_is_no_curve():
    with pytest.raises(InputError, match=r"turn back by 180° at \[1.0, 0.0, 0.0\]"):
        ToolCurve.polyline([[0, 0, 0], [1, 0, 0], [0.5, 0, 0]])


def test_stops_are_at_the_corners_and_curves_meet_there():
    square = Contour((Polyline([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]]),), closed=True)
    result = smooth(square, 1e-4, "stop")
    assert (len(result.curves), result.stops, result.deviation) == (4, 4, 0.0)
    for curve, after in zip(result.curves, result.curves[1:] + result.curves[:1], strict=True):
        assert np.allclose(curve.position(curve.s_end), after.position(after.s0))


def test_what_turns_back_is_stopped_at():
    there_and_back = Contour((Polyline([[0, 0, 0], [1, 0, 0], [0.2, 0, 0]]),))
    result = smooth(there_and_back, 1e-4)
    assert (len(result.curves), result.stops) == (2, 1)


def test_points_of_a_circle_are_followed_as_a_circle():
    angle = np.linspace(0, 6, 200)
    points = 0.1 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    (curve,) = smooth(Contour((Polyline(points),)), 1e-4).curves
    s = np.linspace(0.05, 0.95, 500) * curve.length
    curvature = np.linalg.norm(curve.at(s).ddp, axis=-1)
    assert curvature.min() > 8.0  # of 10/m, where blends of each corner alone would come to 0 in every edge
    assert curvature.max() < 13.0


def test_normals_stay_with_their_points():
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0.2, 0.1, 0]])
    normals = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 1.0]])
    result = smooth(Contour((Polyline(points),), normals=normals), 1e-4)
    s, given_normals = result.normals[0]
    assert np.array_equal(given_normals, normals)
    assert np.linalg.norm(result.curves[0].position(s) - points, axis=-1).max() <= 2e-4
    assert (s[0], s[-1]) == (result.curves[0].s0, result.curves[0].s_end)


def test_bad_choices_are_named():
    line = Contour((Polyline([[0, 0, 0], [1, 0, 0]]),))
    with pytest.raises(InputError, match="tolerance = 0, expected"):
        smooth(line, 0.0)
    with pytest.raises(UnknownNameError, match="corner = 'cut', expected one of 'blend', 'stop'"):
        smooth(line, 1e-4, "cut")
