"""Tables of quintic pieces against the tasks that they stand for."""

from __future__ import annotations

from ctypes import addressof

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.engine.gamma_distance import distances_to_gamma
from pathcontrol.engine.library import load_library
from pathcontrol.engine.path_table import has_same_projection, make_table, path_struct
from pathcontrol.errors import EngineError


class Rose(pc.PathTask):
    """Only q_d and ϑ, as a user writes it."""

    period = 2 * np.pi

    def q_d(self, s):
        radius = 1 + 0.3 * np.cos(3 * s)
        return np.stack([radius * np.cos(s), radius * np.sin(s)], axis=-1)

    def theta(self, s):
        return 1.5 + np.cos(2 * s) * np.sin(s)


class Offset(Rose):
    """A projection that is not the nearest point."""

    def sigma_bar(self, q, near=None):
        return np.asarray(super().sigma_bar(q, near)) + 0.01


LINE = pc.Line([0.7, 1.2], [0.0, -0.3], speed=0.8)
CURVE = pc.WaypointPath([[0.0, 0.0], [0.5, 0.8], [1.0, 0.1], [1.2, -0.5]], speed=0.6)
CLOSED = pc.WaypointPath([[1.0, 0.0], [0.2, 0.9], [-0.8, 0.1], [0.1, -0.8]], speed=0.6, closed=True)
TASKS = {
    "circle": pc.Circle(1.0, 2.0),
    "lissajous": pc.Lissajous([0.5, 0.3, 0.4], [1, 2, 3], 0.7),
    "line": LINE,
    "waypoints": CURVE,
    "closed waypoints": CLOSED,
    "own": Rose(),
    "smooth ends": CURVE.with_profile(pc.SmoothStartStop(CURVE, pc.ConstantSpeed(0.5), acceleration=1.0, jerk=5.0)),
}


def _evaluate(task, s):
    path, memory = path_struct(task)
    out = np.empty((len(s), 3 * task.n + 2))
    load_library().pathcontrol_evaluate(addressof(path), len(s), s.ctypes.data, out.ctypes.data)
    assert memory is not None
    return np.split(out, [task.n, 2 * task.n, 3 * task.n, 3 * task.n + 1], axis=-1)


@pytest.mark.parametrize("name", TASKS)
def test_the_engine_evaluates_what_a_task_says(name):
    task = TASKS[name]
    law = pc.ComputedTorque(_arm(task.n), task, 100.0, 10.0)
    lower, upper = task.sampled_interval
    laps = 2.0 if task.closed else 0.0
    s = np.random.default_rng(0).uniform(lower - laps, upper + laps, 500)
    point = law.point(s)
    q_d, dq_d, ddq_d, theta, dtheta = _evaluate(task, s)
    extent, slope = np.ptp(point.q_d, axis=0).max(), np.abs(point.dq_d).max()
    assert np.abs(q_d - point.q_d).max() <= 2e-11 * extent
    assert np.abs(dq_d - point.dq_d).max() <= 4e-9 * slope
    assert np.abs(ddq_d - point.ddq_d).max() <= 1e-6 * max(slope, np.abs(point.ddq_d).max())
    assert np.abs(theta[:, 0] - point.theta).max() <= 4e-11 * point.theta.max()
    assert np.abs(dtheta[:, 0] - point.dtheta).max() <= 1e-7 * max(1.0, np.abs(point.dtheta).max())


def _arm(n):
    from random_arms import random_arm

    return random_arm(n, n)


@pytest.mark.parametrize("name", TASKS)
def test_the_nearest_point_of_the_engine_is_that_of_the_task(name):
    task = TASKS[name]
    path, _ = path_struct(task)
    rng = np.random.default_rng(1)
    lower, upper = task.sampled_interval
    near = rng.uniform(lower, upper, 200)
    q = task.q_d(near) + rng.normal(0, 0.05, (200, task.n))
    followed, anywhere = np.empty(200), np.empty(200)
    nearest = load_library().pathcontrol_nearest
    nearest(addressof(path), 200, q.ctypes.data, near.ctypes.data, followed.ctypes.data)
    nearest(addressof(path), 200, q.ctypes.data, None, anywhere.ctypes.data)
    numeric = pc.PathTask.sigma_bar(task, q)
    away = [np.linalg.norm(task.q_d(s) - q, axis=-1) for s in (anywhere, numeric)]
    assert np.abs(away[0] - away[1]).max() < 1e-9
    assert np.abs(followed - pc.PathTask.sigma_bar(task, q, near=near)).max() < 1e-7
    assert has_same_projection(task, path)


def test_a_projection_of_its_own_that_is_not_the_nearest_point_is_noticed():
    task = Offset()
    assert not has_same_projection(task, path_struct(task)[0])


def test_a_table_is_made_once_and_again_when_its_task_has_changed():
    task = Rose()
    first = path_struct(task)[0]
    assert path_struct(task)[0] is first
    task.q_d = lambda s: np.stack([np.cos(s), np.sin(s)], axis=-1)
    task.__dict__.pop("_path_derivative", None)
    assert path_struct(task)[0] is not first


def test_a_path_that_goes_on_for_ever_has_no_table():
    class Endless(pc.PathTask):
        def q_d(self, s):
            return np.stack([s, np.sin(s)], axis=-1)

        def theta(self, s):
            return 1.0 + 0 * s

    with pytest.raises(EngineError, match="neither ends nor repeats"):
        make_table(Endless())


def test_a_path_with_a_corner_has_no_table():
    class Corner(pc.PathTask):
        s_end = 2.0

        def q_d(self, s):
            return np.stack([s, 0.3 * np.sin(40 * np.abs(s - 0.77)) * (1 + 1e-3 * np.sin(1e5 * s))], axis=-1)

        def theta(self, s):
            return 1.0 + 0 * s

    with pytest.raises(EngineError, match="not smooth enough"):
        make_table(Corner())


@pytest.mark.parametrize("braking", [False, True])
@pytest.mark.parametrize("name", TASKS)
def test_distances_to_gamma_are_the_global_minima_of_a_dense_search(name, braking):
    """Against samples of Γ: no farther than the nearest of them, and no nearer than that by more than their spacing."""
    task, rng = TASKS[name], np.random.default_rng(2)
    lower, upper = task.sampled_interval
    s = np.linspace(lower, upper, 20001)
    law = pc.ComputedTorque(_arm(task.n), task, 100.0, 10.0)
    point = law.point(s) if braking else task.at(s)
    gamma = np.concatenate([point.q_d, point.velocity], axis=-1)
    along = np.linspace(lower, upper, 300)
    walk = np.cumsum(rng.normal(0, 0.02, (300, 2 * task.n)), axis=0)
    here = law.point(along) if braking else task.at(along)
    states = np.concatenate([here.q_d, here.velocity], axis=-1) + walk
    states[100] = rng.normal(0, 1, 2 * task.n)  # a jump
    q, qd = states[:, : task.n], states[:, task.n :]
    distance, found = distances_to_gamma(task, q, qd, 1.0, braking)
    sampled = np.min(np.linalg.norm(gamma[None, ::4] - states[:, None], axis=-1), axis=1)
    spacing = np.linalg.norm(np.diff(gamma[::4], axis=0), axis=-1).max()
    assert (distance <= sampled + 1e-9).all()
    assert (distance >= sampled - spacing).all()
    there = law.point(found) if braking else task.at(found)
    stated = np.linalg.norm(np.concatenate([there.q_d, there.velocity], axis=-1) - states, axis=-1)
    assert np.abs(stated - distance).max() < 1e-8
    order = rng.permutation(300)
    shuffled, there = distances_to_gamma(task, q[order], qd[order], 1.0, braking)
    assert np.abs(shuffled - distance[order]).max() < 1e-12
    batch = [np.stack([one, one[order]]) for one in (q, qd)]
    for together, alone in zip(distances_to_gamma(task, *batch, 1.0, braking), (distance, found), strict=True):
        assert np.array_equal(together[0], alone)  # each series by itself
    assert np.array_equal(distances_to_gamma(task, *batch, 1.0, braking)[1][1], there)


def test_distances_to_gamma_are_those_of_the_search_in_python(monkeypatch):
    from pathcontrol.analysis import gamma

    task, rng = Rose(), np.random.default_rng(3)
    q, qd = rng.normal(0, 0.8, (2, 200, 2))
    fast = pc.distance_to_gamma(task, q, qd, 0.3)

    def refuse(*_):
        raise EngineError("no")

    monkeypatch.setattr(gamma, "distances_to_gamma", refuse)
    assert np.abs(pc.distance_to_gamma(task, q, qd, 0.3) - fast).max() < 1e-9
