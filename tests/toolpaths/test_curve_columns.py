"""Many Bézier curves worked out together are, each, what one is alone."""

from __future__ import annotations

import numpy as np
import pytest
from drawings import svg, write

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.drawing.pieces import NOTHING, Curve, Curves
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.bezier_columns import boxes, end_tangents, measure_bounds, measure_lengths
from pathcontrol.toolpaths.segments.cusps import is_plain
from pathcontrol.toolpaths.smoothing.corners import corners, end_tangent, start_tangent
from pathcontrol.toolpaths.svg.reader import read_svg


def odd_and_random(degree: int, count: int = 10) -> np.ndarray:
    """Control points (k, degree + 1, 3): at random, on a grid, flat, with a cusp, with handles of no length."""
    rng = np.random.default_rng(degree)
    points = rng.uniform(-0.1, 0.1, (count, degree + 1, 3))
    grid = rng.integers(-2, 3, (count, degree + 1, 3)) * 0.01
    flat = rng.uniform(-1, 1, (count, degree + 1, 1)) * rng.normal(size=(count, 1, 3))
    planar = points * [1, 1, 0]
    still = planar.copy()
    still[:, 1] = still[:, 0]
    found = [points, grid, flat, planar, still]
    if degree == 3:
        cusp = np.array([[0, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 0.0]])
        turn = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
        found += [cusp @ turn, cusp @ turn + 1e-7 * rng.normal(size=(count, 4, 3))]
    stacked = np.concatenate(found)
    return stacked[np.ptp(stacked, axis=1).any(1)]


@pytest.mark.parametrize("degree", [2, 3])
def test_segments_of_many_are_those_of_each(degree):
    points = odd_and_random(degree)
    together = Curves(points).segments()
    alone = [segment for row in points for segment in Curve(row).segments()]
    assert len(together) == len(alone)
    for one, other in zip(together, alone, strict=True):
        assert type(one) is type(other)
        assert np.array_equal(one.points, other.points)
    assert 0 < is_plain(points, NOTHING).sum() < len(points)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_lengths_and_boxes_of_many_are_those_of_each(degree):
    points = odd_and_random(max(degree, 2), 5)[:, : degree + 1] if degree < 4 else odd_and_random(4, 5)
    points = points[np.ptp(points, axis=1).any(1)]
    many = [Bezier(row) for row in points]
    measure_lengths(many)
    measure_bounds(many)
    for curve, row in zip(many, points, strict=True):
        alone = Bezier(row)
        assert curve.length == pytest.approx(alone.arc_length.total, rel=1e-11)
        for mine, theirs in zip(curve.bounds, (alone._least(1.0), -alone._least(-1.0)), strict=True):
            assert np.abs(mine - theirs).max() < 1e-9 * (1 + np.abs(row).max())


@pytest.mark.parametrize("degree", [2, 3])
def test_boxes_touch_their_curves(degree):
    points = odd_and_random(degree)
    low, high = boxes(points)
    u = np.linspace(0, 1, 2001)
    for row, lower, upper in zip(points, low, high, strict=True):
        drawn = Bezier(row).point(u)
        assert (drawn >= lower - 1e-12).all()
        assert (drawn <= upper + 1e-12).all()
        assert np.abs(drawn.min(0) - lower).max() < 1e-6
        assert np.abs(drawn.max(0) - upper).max() < 1e-6


def test_tangents_of_many_are_those_of_each():
    segments = [segment for degree in (2, 3) for segment in Curves(odd_and_random(degree)).segments()]
    segments.append(Bezier(np.array([[0, 0, 0], [1, 1, 0], [2, 0, 0.0]]), np.array([1.0, 2.0, 1.0])))
    segments += segments[:2]
    starts, ends = end_tangents(segments)
    for segment, start, end in zip(segments, starts, ends, strict=True):
        assert np.abs(start - start_tangent(segment)).max() < 1e-7
        assert np.abs(end - end_tangent(segment)).max() < 1e-7


def test_corners_between_curves(tmp_path):
    (contour,) = read_svg(write(tmp_path, svg('<path d="M0 0C1 1 2 1 3 0C4 -1 5 -1 6 0C5 1 5 2 6 3z"/>')))
    found = corners(contour)
    assert [corner.segment for corner in found] == [1, 2, 3]
    assert np.degrees([corner.turn for corner in found]) == pytest.approx([90, 161.565051177, 161.565051177])
    assert found[0].station == pytest.approx(contour.segments[0].length + contour.segments[1].length)


@pytest.mark.parametrize("letters", ["C", "c", "Q", "q", "L", "l"])
def test_runs_of_one_command_are_its_repetition(tmp_path, letters):
    rng = np.random.default_rng(7)
    size = {"C": 6, "Q": 4, "L": 2}[letters.upper()]
    rows = [" ".join(map(repr, row)) for row in rng.uniform(-9, 9, (40, size)).round(4).tolist()]
    run = f"M3 4{letters}{' '.join(rows)}T1 2S1 2 3 4"
    each = f"M3 4{' '.join(letters + row for row in rows)}T1 2S1 2 3 4"
    (one,), (other,) = (read_svg(write(tmp_path, svg(f'<path d="{data}" stroke="red"/>'))) for data in (run, each))
    assert len(one.segments) == len(other.segments)
    for mine, theirs in zip(one.segments, other.segments, strict=True):
        assert np.abs(mine.points - theirs.points).max() < 1e-15


def test_too_many_subpaths_end_in_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr("pathcontrol.toolpaths.svg.pen.MAX_CONTOURS", 100)
    path = write(tmp_path, svg(f'<path d="{"M0 0L1 1" * 101}" stroke="red"/>'))
    with pytest.raises(ToolpathError, match="more than 100 subpaths"):
        read_svg(path)
