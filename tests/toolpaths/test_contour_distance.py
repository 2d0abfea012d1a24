"""The distance to a contour of many curves is the least of the distances to its segments, and of that to samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pathcontrol.toolpaths.contour import Contour
from pathcontrol.toolpaths.segments.arc import Arc
from pathcontrol.toolpaths.segments.bezier import Bezier
from pathcontrol.toolpaths.segments.segment import Polyline


def chain(degree: int, count: int, seed: int = 0) -> Contour:
    """Curves through a random walk, with a corner at each joint."""
    rng = np.random.default_rng(seed)
    joints = np.cumsum(rng.normal(size=(count + 1, 3)) * 0.01, axis=0)
    inner = joints[:-1, None] + rng.normal(size=(count, degree - 1, 3)) * 0.01
    return Contour(tuple(Bezier.of_each(np.concatenate([joints[:-1, None], inner, joints[1:, None]], axis=1))))


def flower(count: int) -> Contour:
    """A smooth closed curve of cubics."""
    t = np.linspace(0.0, 2 * np.pi, count + 1)
    radius, slope = 0.1 + 0.02 * np.sin(7 * t), 0.14 * np.cos(7 * t)
    p = np.stack([radius * np.cos(t), radius * np.sin(t), 0 * t], axis=-1)
    p[-1] = p[0]
    d = np.stack([slope * np.cos(t) - p[:, 1], slope * np.sin(t) + p[:, 0], 0 * t], axis=-1) * (t[1] / 3)
    points = np.stack([p[:-1], p[:-1] + d[:-1], p[1:] - d[1:], p[1:]], axis=1)
    return Contour(tuple(Bezier.of_each(points)), closed=True)


def mixed() -> Contour:
    """Cubics and others in turn, so that there are gaps between the cubics."""
    cubics = [Bezier(np.array([[i, 0, 0], [i + 0.1, 0.5, 0], [i + 0.4, -0.5, 0.2], [i + 0.5, 0, 0]])) for i in range(4)]
    others = [Polyline(np.array([[i + 0.5, 0, 0], [i + 0.7, 0.3, 0], [i + 1, 0, 0]])) for i in range(3)]
    x, y, none = np.array([-0.25, 0, 0]), np.array([0, 0.25, 0]), np.zeros(3)
    others[1] = Arc(np.array([1.75, 0, 0]), x, y, 0.0, np.pi, none)
    segments = [segment for pair in zip(cubics, others, strict=False) for segment in pair]
    return Contour((*segments, cubics[-1]))


def near(contour: Contour, count: int = 60) -> np.ndarray:
    """Points around a contour, close to it, and off its joints."""
    rng = np.random.default_rng(1)
    lower, upper = contour.bounds
    size = float(np.linalg.norm(upper - lower))
    around = rng.uniform(lower - 0.1 * size, upper + 0.1 * size, (count, 3))
    on = np.concatenate([segment.point(rng.uniform(size=2)) for segment in contour.segments])
    joints = np.array([segment.first for segment in contour.segments])
    return np.concatenate(
        [around, on + 1e-3 * size * rng.normal(size=on.shape), on, joints, joints + np.array([0, 0, 0.01])]
    )


CONTOURS = {
    "lines": chain(1, 24),
    "parabolas": chain(2, 24),
    "cubics": chain(3, 24),
    "one": chain(3, 1),
    "one line": chain(1, 1),
    "quintics": chain(5, 5),
    "smooth": flower(36),
    "mixed": mixed(),
    "a handle of no length": Contour((Bezier(np.array([[0, 0, 0], [0, 0, 0], [1, 1, 0], [2, 0, 0]])),) * 1),
}


@pytest.mark.parametrize("name", CONTOURS)
def test_the_distance_is_that_of_the_nearest_segment(name):
    contour = CONTOURS[name]
    x = near(contour)
    size = float(np.linalg.norm(contour.bounds[1] - contour.bounds[0]))
    least = np.min([segment.distance(x) for segment in contour.segments], axis=0)
    assert np.abs(contour.distance(x) - least).max() < 1e-9 * size


@pytest.mark.parametrize("name", CONTOURS)
def test_no_sample_of_a_contour_is_nearer_than_its_distance(name):
    contour = CONTOURS[name]
    x, u = near(contour, 30), np.linspace(0.0, 1.0, 2001)
    samples = np.concatenate([s.point(u) for s in contour.segments])
    step = max(float(np.linalg.norm(np.diff(s.point(u), axis=0), axis=-1).max()) for s in contour.segments)
    brute, found = cKDTree(samples, balanced_tree=False).query(x)[0], contour.distance(x)
    assert (found <= brute + 1e-9).all()
    assert (found >= brute - step).all()


def test_points_that_are_not_known_have_no_distance_and_no_points_none():
    for contour in (flower(12), mixed()):
        x = np.array([[0.1, 0.2, 0.3], [np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]])
        assert np.isfinite(contour.distance(x)).tolist() == [True, False, False]
        assert contour.distance(np.empty((0, 3))).shape == (0,)
        assert contour.distance(x.reshape(3, 1, 3)).shape == (3, 1)


def test_the_centre_of_a_wheel_is_as_far_from_all_of_it():
    angle = np.linspace(0.0, 2 * np.pi, 201)
    handle = 4 / 3 * np.tan(angle[1] / 4)
    p, d = (
        np.stack([f(angle), g(angle), 0 * angle], axis=-1)
        for f, g in ((np.cos, np.sin), (lambda a: -np.sin(a), np.cos))
    )
    points = np.stack([p[:-1], p[:-1] + handle * d[:-1], p[1:] - handle * d[1:], p[1:]], axis=1)
    wheel = Contour(tuple(Bezier.of_each(points)))
    rise = np.linspace(0.0, 2.0, 9)
    x = rise[:, None] * [0.0, 0.0, 1.0]
    np.testing.assert_allclose(wheel.distance(x), np.hypot(1.0, rise), rtol=1e-9)
