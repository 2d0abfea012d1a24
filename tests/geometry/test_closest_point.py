"""The numerical projection: stationary, global, continuous where asked to be, and the same for one and for many."""

from __future__ import annotations

import tracemalloc
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from strategies import floats, tasks, vectors, wobbles

from pathcontrol import Circle, ConstantRate, Ellipse, Line, Lissajous, PathTask, TaskError, WaypointPath


def stationarity(task, s, q):
    """|cos| of the angle between e_p and the path."""
    e, d = task.q_d(s) - q, task.dq_d(s)
    return np.abs((e * d).sum(-1)) / np.maximum(np.linalg.norm(d, axis=-1) * (1 + np.linalg.norm(e, axis=-1)), 1e-300)


@given(tasks(), vectors(2, 4.0))
def test_it_is_the_global_minimum(task, q):
    s = PathTask.sigma_bar(task, q)
    dense = task.q_d(np.linspace(task.s0, task.s0 + task.period, 20_001))
    best = np.linalg.norm(dense - q, axis=-1).min()
    assert task.s0 <= s <= task.s0 + task.period
    assert np.linalg.norm(task.q_d(s) - q) <= best * (1 + 1e-12) + 1e-12
    assert stationarity(task, s, q) < 1e-10


@given(floats(0.2, 3.0), vectors(2, 3.0).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_it_finds_the_circles_closed_form(radius, q):
    task = Circle(radius, 1.0)
    difference = task.sigma_bar(q) - PathTask.sigma_bar(task, q)
    assert abs((difference + np.pi) % (2 * np.pi) - np.pi) < 1e-9


def test_it_finds_the_nearest_branch_of_a_figure_of_eight():
    task = Lissajous([1.0, 1.0], [1, 2], 1.0)
    # both branches cross at the origin (s = 0 and s = π); beside it each is nearest to its own points
    for s in (0.05, np.pi - 0.05, np.pi + 0.05, 2 * np.pi - 0.05):
        q = task.q_d(s) + 0.01 * task.ddq_d(s)
        assert abs(task.sigma_bar(q) - s) < 0.1


def test_warm_start_follows_its_own_branch_through_the_crossing():
    task = Lissajous([1.0, 1.0], [1, 2], 1.0)
    s, true = 2.9, np.linspace(2.9, 3.4, 101)
    rng = np.random.default_rng(1)
    for t in true:
        s = task.sigma_bar(task.q_d(t) + 0.02 * rng.normal(size=2), near=s)
        assert abs(s - t) < 0.1


def test_warm_start_counts_laps_both_ways():
    task = Lissajous([1.0, 0.5], [1, 2], 1.0)
    for direction in (1, -1):
        s = 0.0
        for t in direction * np.linspace(0, 3 * task.period, 300):
            s = float(task.sigma_bar(task.q_d(t), near=s))
        assert s == pytest.approx(direction * 3 * task.period, abs=1e-6)
    circle = Circle(1.0, 1.0)
    assert circle.sigma_bar(circle.q_d(0.3), near=100.0) == pytest.approx(0.3 + 2 * np.pi * 16)


def test_warm_start_falls_back_to_the_global_minimum_after_a_jump():
    task = Lissajous([1.0, 0.5], [1, 2], 1.0)
    q = task.q_d(4.0)
    assert task.sigma_bar(q, near=1.0) == pytest.approx(4.0, abs=1e-9)


@settings(max_examples=5)
@given(wobbles())
def test_many_are_as_one(task):
    rng = np.random.default_rng(0)
    q = rng.normal(size=(2, 5, 2)) * 2
    s = task.sigma_bar(q)
    # the path itself is a matrix product, whose rounding depends on the shape
    assert np.allclose(s, [[task.sigma_bar(x) for x in row] for row in q], rtol=0, atol=1e-12)
    near = s + 0.05
    assert np.allclose(
        task.sigma_bar(q, near),
        [[task.sigma_bar(x, n) for x, n in zip(*rows, strict=True)] for rows in zip(q, near, strict=True)],
    )


@pytest.mark.parametrize("teeth", [64, 128, 100])
def test_details_that_repeat_with_the_grid_are_not_missed(teeth):
    class Gear(PathTask):
        period = 2 * np.pi

        def q_d(self, s):
            return (1 + 3 / teeth * np.sin(teeth * s))[..., None] * np.stack([np.cos(s), np.sin(s)], -1)

        def theta(self, s):
            return 1.0

    task, s = Gear(), np.random.default_rng(0).uniform(0, 6, 60)
    q = task.q_d(s)
    assert np.abs(task.q_d(task.sigma_bar(q)) - q).max() < 1e-9


def test_one_sharp_end_does_not_shorten_the_sight_of_the_warm_start():
    """Inside a thin ellipse the other side is nearer, but continuity keeps the side one is on."""
    for b in (0.1, 1e-2, 1e-3):
        task = Ellipse((1.0, b), 1.0)
        assert task.sigma_bar([5e-4, -0.3 * b], near=np.pi / 2) == pytest.approx(np.pi / 2, abs=1e-2)
        assert task.sigma_bar([5e-4, -0.3 * b]) == pytest.approx(-np.pi / 2 % (2 * np.pi), abs=1e-2)


def test_nan_stays_where_it_is():
    task = Lissajous([1.0, 1.0], [1, 2], 1.0)
    q = np.array([[np.nan, 0.0], [0.0, 1.0]])
    for near in (None, [0.0, 0.0]):
        s = task.sigma_bar(q, near)
        assert np.isnan(s[0])
        assert s[1] == task.sigma_bar(q[1], None if near is None else 0.0)


def test_open_paths_end():
    class Arc(PathTask):
        s_end = 1.5

        def q_d(self, s):
            return np.stack([np.cos(s), np.sin(s)], -1)

        def theta(self, s):
            return 1.0

    task = Arc()
    assert task.sigma_bar([2.0, -1.0]) == 0
    assert task.sigma_bar([-1.0, 1.0]) == 1.5
    assert task.sigma_bar([1.0, 1.0]) == pytest.approx(np.pi / 4)
    assert task.sigma_bar([2.0, -1.0], near=0.01) == 0


def test_an_endless_path_says_what_to_do():
    class Spiral(PathTask):
        def q_d(self, s):
            return np.stack([s * np.cos(s), s * np.sin(s)], -1)

        def theta(self, s):
            return 1.0

    with pytest.raises(TaskError, match=r"period.*sigma_bar"):
        Spiral().sigma_bar([1.0, 0.0])


def test_line_projection_is_the_numerical_one():
    task = Line([0.0, 1.0, -1.0], [2.0, 0.0, 1.0], 1.0)
    q = np.random.default_rng(0).normal(size=(50, 3)) * 2
    assert np.allclose(task.sigma_bar(q), PathTask.sigma_bar(task, q), atol=1e-9)


# --- long paths ---------------------------------------------------------------------------------------------


def zigzag(passes: int, each: int) -> np.ndarray:
    """Waypoints of parallel passes 0.002 apart."""
    x, y = np.broadcast_arrays(np.linspace(0, 1, each), 0.002 * np.arange(passes)[:, None])
    points = np.stack([x, y], axis=-1).copy()
    points[1::2] = points[1::2, ::-1]
    return points.reshape(-1, 2)


def spiral(turns: int, each: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(turns * each) / each
    return (0.05 + 0.001 * angle / np.pi)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def details(count: int, n: int) -> np.ndarray:
    """A bend of small random details, each a few times larger than the distance between waypoints."""
    t, rng = 3e-5 * np.arange(count), np.random.default_rng(0)
    return np.stack([np.cos(t * (1 + 0.2 * i) + i) for i in range(n)], axis=-1) + 3e-4 * rng.normal(size=(count, n))


LONG = {
    "zigzag": lambda: zigzag(1000, 100),
    "long straights and fine passes": lambda: np.concatenate([zigzag(40, 2), 0.2 + 0.01 * zigzag(999, 100)]),
    "spiral": lambda: spiral(250, 400),
    "details": lambda: details(30_000, 3),
}


def about(path: PathTask, count: int, seed: int = 0) -> np.ndarray:
    """Postures on the path, beside it, and far from it."""
    rng = np.random.default_rng(seed)
    beside = rng.normal(size=(count, path.n)) * 10 ** rng.uniform(-5, 0, size=(count, 1))
    return path.q_d(np.sort(rng.uniform(*path.one_traverse, size=count))) + beside


class Counting(WaypointPath):
    """Counts the parameters at which the path is asked for."""

    asked = 0

    def q_d(self, s):
        self.asked += np.size(s)
        return super().q_d(s)


@cache
def passes_of(count: int) -> Counting:
    """A long path of parallel passes, on which several tests search."""
    return Counting(zigzag(count, 100), 1.0)


@settings(max_examples=12)
@given(st.integers(0, 9999), st.integers(2, 4), st.integers(4, 40), st.booleans())
def test_the_global_minimum_of_random_splines(seed, n, count, closed):
    rng = np.random.default_rng(seed)
    path = WaypointPath(rng.normal(size=(count, n)), 1.0, closed=closed, parametrisation="uniform")
    q = about(path, 50, seed)
    s = path.sigma_bar(q)
    dense = path.q_d(np.linspace(*path.one_traverse, 500 * count))
    best = np.array([np.linalg.norm(dense - x, axis=-1).min() for x in q])
    assert (np.linalg.norm(path.q_d(s) - q, axis=-1) <= best * (1 + 1e-12) + 1e-14).all()
    inside = (s > path.s0) & (s < path.one_traverse[1])
    assert stationarity(path, s, q)[inside].max(initial=0) < 1e-9


@pytest.mark.parametrize("name", LONG)
def test_the_global_minimum_of_up_to_a_hundred_thousand_segments(name):
    path = passes_of(1000) if name == "zigzag" else WaypointPath(LONG[name](), 1.0)
    q = about(path, 300)
    found = np.linalg.norm(path.q_d(path.sigma_bar(q)) - q, axis=-1)
    dense = path.q_d(np.linspace(*path.one_traverse, 300_001))
    sampled = cKDTree(dense, balanced_tree=False).query(q)[0]
    assert (found <= sampled * (1 + 1e-12) + 1e-13).all()
    step = np.linalg.norm(np.diff(dense, axis=0), axis=-1).max()
    assert (found >= sampled - step).all()


def test_a_detail_of_a_long_path_is_not_missed():
    """One ripple a millionth of the path long, which no equal division would meet."""
    line = np.stack([np.linspace(0, 100, 101), np.zeros(101)], axis=-1)
    ripple = 50.5 + 1e-4 * np.array([[0, 0], [0.25, 1], [0.5, 0], [0.75, -1], [1, 0]]) - [0, 50.5]
    path = WaypointPath(np.concatenate([line[:51], ripple, line[51:]]), 1.0)
    assert path.sigma_bar(ripple[1] + [0, 1e-5]) == pytest.approx(path.parameters[52], abs=2e-3)
    assert np.linalg.norm(path.q_d(path.sigma_bar(ripple)) - ripple, axis=-1).max() < 1e-12


def test_memory_is_bounded():
    path = WaypointPath(zigzag(1000, 100), 1.0)
    q = about(path, 10_000)
    tracemalloc.start()
    s = path.sigma_bar(q)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.isfinite(s).all()
    assert peak < 200e6


def test_the_local_search_asks_as_little_of_a_long_path_as_of_a_short_one():
    asked = []
    for passes in (10, 100, 1000):
        path = passes_of(passes)
        s = float(path.parameters[550])
        q = path.q_d(np.array(s)) + np.array([0.001, 0.01])
        path.asked = 0
        found = path.sigma_bar(q, near=s)
        assert np.linalg.norm(path.q_d(found) - q) == pytest.approx(0.01, abs=1e-6)
        asked.append(path.asked)
    assert asked[0] == asked[1] == asked[2] < 15


def test_once_built_the_global_search_asks_little():
    for passes in (10, 100, 1000):
        path = passes_of(passes)
        q = about(path, 1)
        path.sigma_bar(q)
        path.asked = 0
        path.sigma_bar(q)
        assert path.asked < 200


@settings(max_examples=12)
@given(st.integers(0, 9999), st.integers(2, 4), st.integers(6, 20), st.booleans())
def test_the_local_search_finds_the_first_minimum_downhill(seed, n, count, closed):
    rng = np.random.default_rng(seed)
    path = WaypointPath(rng.normal(size=(count, n)), 1.0, closed=closed)
    lower, upper = path.one_traverse
    near, size = rng.uniform(lower, upper, size=10), 10 ** rng.uniform(-3, 0.3, size=(10, 1))
    tangent = path.dq_d(near) / np.linalg.norm(path.dq_d(near), axis=-1, keepdims=True)
    offset = size * rng.normal(size=(10, n))
    q = path.q_d(near) + offset - 0.9 * tangent * (offset * tangent).sum(-1, keepdims=True)  # about normal to the path
    for x, start, found in zip(q, near, path.sigma_bar(q, near), strict=True):
        direction = -np.sign((path.q_d(start) - x) @ path.dq_d(start))
        s = start + direction * np.linspace(0, upper - lower, 20_001)
        s = s if closed else s[(s >= lower) & (s <= upper)]
        rises = direction * ((path.q_d(s) - x) * path.dq_d(s)).sum(-1) > 0
        expected = s[rises.argmax()] if rises.any() else s[-1]
        assert found == pytest.approx(expected, abs=1e-4 * (upper - lower))


def test_where_newton_fails_the_next_minimum_downhill_is_found():
    """Over a row of ripples, at a distance of many of them: from ripple to ripple, never farther, never back."""
    t, height, ripple, wave = np.linspace(0, 2, 2001), 0.05, 2e-3, 0.02
    path = WaypointPath(np.stack([t, ripple * np.cos(2 * np.pi * t / wave)], axis=-1), 1.0)
    x = np.linspace(0.1, 1.9, 750)
    s, found = float(path.sigma_bar([0.1, 0.0])), []
    for q in np.stack([x, np.full_like(x, height)], axis=-1):
        s = float(path.sigma_bar(q, near=s))
        found.append(s)
    p = path.q_d(np.array(found))
    # a ripple is left where its steepest flank is normal to the error
    assert (x - p[:, 0]).max() < 1.01 * (height + ripple) * ripple * 2 * np.pi / wave
    assert np.diff(p[:, 0]).min() > 0
    assert np.diff(p[:, 0]).max() < wave


def test_many_on_a_long_path_are_as_one():
    path = passes_of(100)
    q = about(path, 40)
    q[7] = np.nan
    s = path.sigma_bar(q)
    assert np.isnan(s[7])
    assert np.array_equal(s, [path.sigma_bar(x) for x in q], equal_nan=True)
    near = np.random.default_rng(0).uniform(*path.one_traverse, size=40)
    assert np.array_equal(
        path.sigma_bar(q, near), [path.sigma_bar(x, z) for x, z in zip(q, near, strict=True)], equal_nan=True
    )


def test_knots_are_those_of_the_pieces():
    path = WaypointPath(zigzag(5, 10), 1.0)
    assert np.allclose(path.knots, path.parameters)
    assert path.with_profile(ConstantRate(1.0)).knots is not None
    assert Lissajous([1.0, 1.0], [1, 2], 1.0).knots is None


def test_a_path_with_a_hole_is_refused():
    class Hole(PathTask):
        s_end = 1.0

        def q_d(self, s):
            return np.stack([s, np.where(np.abs(s - 0.5) < 0.01, np.nan, 0.0)], axis=-1)

        def theta(self, s):
            return 1.0

    with pytest.raises(TaskError, match=r"nan.*at s = 0\.49"):
        Hole().sigma_bar([0.2, 0.2])


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_global_minimum_near_centres_of_curvature(seed):
    """There the distance hardly changes along the path, and minima lie close together."""
    rng = np.random.default_rng(seed)
    task = WaypointPath(rng.normal(size=(12, 2)), speed=1.0)
    point = task.at(rng.uniform(task.s0, task.s_end, 400))
    square = np.square(point.dq_d).sum(-1, keepdims=True)
    bend = (point.ddq_d - point.dq_d * (point.dq_d * point.ddq_d).sum(-1, keepdims=True) / square) / square
    away = 1 + 10 ** rng.uniform(-4, -1, size=(400, 1)) * rng.normal(size=(400, 1))
    q = point.q_d + away * bend / np.square(bend).sum(-1, keepdims=True)
    s = task.sigma_bar(q)
    distance = np.linalg.norm(task.q_d(s) - q, axis=-1)
    best, _ = cKDTree(task.q_d(np.linspace(task.s0, task.s_end, 20_001))).query(q)
    assert (distance <= best * (1 + 1e-9)).all()
    assert (stationarity(task, s, q)[(s > task.s0) & (s < task.s_end)] < 1e-9).all()
