"""The numerical projection: stationary, global, continuous where asked to be, and the same for one and for many."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from strategies import floats, tasks, vectors, wobbles

from pathcontrol import Circle, Ellipse, Line, Lissajous, PathTask, TaskError


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
        for t in direction * np.linspace(0, 3 * task.period, 900):
            s = float(task.sigma_bar(task.q_d(t), near=s))
        assert s == pytest.approx(direction * 3 * task.period, abs=1e-6)
    circle = Circle(1.0, 1.0)
    assert circle.sigma_bar(circle.q_d(0.3), near=100.0) == pytest.approx(0.3 + 2 * np.pi * 16)


def test_warm_start_falls_back_to_the_global_minimum_after_a_jump():
    task = Lissajous([1.0, 0.5], [1, 2], 1.0)
    q = task.q_d(4.0)
    assert task.sigma_bar(q, near=1.0) == pytest.approx(4.0, abs=1e-9)


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
