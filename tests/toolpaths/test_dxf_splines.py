"""Splines of DXF drawings are exact: against ezdxf's own evaluation, closed forms and their end conditions."""

from __future__ import annotations

import itertools

import ezdxf
import numpy as np
import pytest
from drawings import TEN, TOGETHER, U, apart, dxf_reader, samples
from ezdxf.math import BSpline
from hypothesis import given

from pathcontrol.toolpaths.segments.bezier import Bezier

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    return dxf_reader(tmp_path_factory.mktemp("dxf"))


def random_spline(seed, degree, rational):
    rng = np.random.default_rng(seed)
    count = degree + int(rng.integers(1, 7))
    inner = np.sort(rng.choice(np.arange(1, 9), count - degree - 1))
    values, times = np.unique(inner, return_counts=True)
    inner = np.repeat(values, np.minimum(times, degree))
    knots = np.concatenate([np.zeros(degree + 1), inner, np.full(degree + 1, 9)]).astype(float)
    control = rng.normal(size=(len(knots) - degree - 1, 3))
    weights = rng.uniform(0.2, 5, len(control)) if rational else None

    def draw(m):
        spline = m.add_spline(degree=degree)
        spline.control_points, spline.knots = control, knots
        if rational:
            spline.weights = weights

    return draw, BSpline(control, degree + 1, knots, None if weights is None else weights.tolist()), knots


@TOGETHER
@given(TEN)
def test_splines_are_exact_bezier_curves(read, seeds):
    kinds = itertools.product([2, 3, 4, 5], [False, True])
    splines = [random_spline(seed, *kind) for seed, kind in zip(seeds, kinds, strict=False)]
    found = read(apart(draw for draw, _, _ in splines))
    for contour, (_, reference, knots) in zip(found, splines, strict=True):
        steps = np.unique(knots)
        t = steps[:-1, None] + U * np.diff(steps)[:, None]
        expected = np.array([[reference.point(x).xyz for x in row] for row in np.minimum(t, 9 - 1e-15)])
        assert len(contour.segments) == len(expected)
        assert np.abs(samples(contour) - expected).max() < 1e-11
        assert all(isinstance(s, Bezier) for s in contour.segments)


@pytest.mark.parametrize("unit", [1.0, 1e200, 1e-200])
def test_a_circle_of_nurbs_is_a_circle(read, unit):
    half = np.sqrt(0.5)
    square = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]

    def draw(m):
        spline = m.add_spline(degree=2)
        spline.control_points, spline.weights = [(*p, 0) for p in square], [unit, half * unit] * 4 + [unit]
        spline.knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]

    (contour,) = read(draw)
    assert contour.closed
    assert contour.length == pytest.approx(TURN, rel=1e-12)
    dense = np.concatenate([s.point(np.linspace(0, 1, 101)) for s in contour.segments])
    assert np.abs(np.linalg.norm(dense, axis=-1) - 1).max() < 1e-12


def test_unclamped_closed_splines_begin_at_their_first_inner_knot(read):
    ring = [(np.cos(a), np.sin(a), 0) for a in np.arange(8) * TURN / 8]

    def draw(m):
        spline = m.add_spline(degree=3)
        spline.control_points, spline.knots = ring + ring[:3], np.arange(15.0)
        spline.closed = True

    (contour,) = read(draw)
    assert contour.closed
    assert len(contour.segments) == 8
    radii = np.linalg.norm(samples(contour)[:, 0], axis=-1)  # at the knots: (1 + 4 + 1)-weighted neighbours
    assert np.allclose(radii, (4 + 2 * np.cos(TURN / 8)) / 6, atol=1e-15)


@TOGETHER
@given(TEN)
def test_fit_points_are_passed_as_cad_programs_do(read, seeds):
    splines = [np.random.default_rng(seed).normal(size=(3 + k % 7, 3)) for k, seed in enumerate(seeds)]
    found = read(lambda m: [m.add_spline(fit_points=points) for points in splines])
    for contour, points in zip(found, splines, strict=True):
        through = np.concatenate([samples(contour)[:, 0], [contour.end]])
        assert np.abs(through - points).max() < 1e-12
        theirs = ezdxf.math.fit_points_to_cad_cv(points)
        knots = np.unique(np.round(theirs.knots(), 12))
        middle = [theirs.point(t).xyz for t in (knots[:-1] + knots[1:]) / 2]
        assert np.abs(samples(contour)[:, 4] - middle).max() < 1e-9


def test_fit_points_with_tangents_and_closed_ones(read):
    points = [(0, 0), (1, 1), (2, 0)]

    def draw(m):
        m.add_spline(fit_points=points, dxfattribs={"start_tangent": (0, 5, 0), "end_tangent": (0, -5, 0)})
        m.add_spline(fit_points=[(5, 0), (6, 1), (7, 0), (6, -1)]).closed = True

    tangents, ring = read(draw)
    for u, direction in ((0.0, 1.0), (1.0, -1.0)):
        slope = tangents.segments[int(u) * -1].derivative(np.array(u))
        assert np.allclose(slope / np.linalg.norm(slope), [0, direction, 0], atol=1e-12)
    assert ring.closed
    for before, after in zip(ring.segments, ring.segments[1:] + ring.segments[:1], strict=True):
        a, b = before.derivative(np.array(1.0)), after.derivative(np.array(0.0))
        assert np.allclose(a / np.linalg.norm(a), b / np.linalg.norm(b), atol=1e-9)
