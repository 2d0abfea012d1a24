"""The distance to Γ where ϑ has corners, against brute force on dense grids that hold the corners."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pathcontrol as pc


@lru_cache(maxsize=1)
def dense(task):
    """A dense grid with all corners in it, and the path there."""
    lower, upper = task.one_traverse
    s = np.linspace(lower, upper, 20_001)
    if task.profile_knots is not None:
        s = np.union1d(s, np.clip(task.profile_knots, lower, upper))
    return s, task.at(s)


def brute_force(task, q, qd, weight=1.0):
    """The least distance on a dense grid, refined about the best of it."""
    s, point = dense(task)
    for _ in range(4):
        distance = np.hypot(
            np.linalg.norm(point.q_d - q, axis=-1), weight * np.linalg.norm(point.velocity - qd, axis=-1)
        )
        best = int(distance.argmin())
        found = distance[best]
        s = np.linspace(s[max(best - 1, 0)], s[min(best + 1, len(s) - 1)], 201)
        point = task.at(s)
    return found


def a_table(random, lower, upper, closed):
    """ϑ² at irregular knots, with steep and flat cells side by side."""
    knots = np.sort(np.concatenate([[lower], random.uniform(lower, upper, 25), [upper]]))
    squared = random.uniform(0.05, 4.0, len(knots))
    squared[-1] = squared[0] if closed else squared[-1]
    return pc.TabulatedProfile(knots, squared, upper - lower if closed else None)


def profiled(kind, path, random, arm):
    lower, upper = path.one_traverse
    if kind == "limited":
        return path.with_profile(pc.limited(path, pc.MotionLimit(speed=1.5, tangential=2.0, normal=2.0), points=200))
    if kind == "time-optimal":
        return path.with_profile(pc.time_optimal(arm, path, points=100))
    if kind == "jerk-limited":
        return path.with_profile(pc.SmoothStartStop(path, pc.ConstantSpeed(1.5), 2.0, 10.0))
    tabulated = path.with_profile(a_table(random, lower, upper, path.closed))
    made = {
        "table": lambda: tabulated,
        "reversed": tabulated.reversed,
        "scaled": lambda: tabulated.scaled([0.5, 2.0]),
        "by arc length": tabulated.by_arc_length,
        "a section": lambda: tabulated.between(lower + 0.1, upper - 0.1),
        "jerk-limited table": lambda: path.with_profile(pc.SmoothStartStop(path, tabulated.profile, 2.0, 10.0)),
    }
    return made[kind]()


OPEN = ["limited", "time-optimal", "table", "reversed", "scaled", "by arc length", "a section"]
KINDS = [(kind, closed) for kind in OPEN for closed in (True, False)]


@pytest.mark.parametrize(("kind", "closed"), [*KINDS, ("jerk-limited", False), ("jerk-limited table", False)])
@settings(max_examples=max(1, settings.default.max_examples // 25))
@given(seed=st.integers(0, 10**6))
def test_it_is_a_global_minimum_where_the_profile_has_corners(ideal_arm, kind, closed, seed):
    random = np.random.default_rng(seed)
    path = pc.WaypointPath(random.normal(size=(5, 2)), speed=1.0, closed=closed)
    task = profiled(kind, path, random, ideal_arm)
    q, qd = random.normal(size=(2, 6, 2)) * np.array([1.0, 2.0])[:, None, None]
    found, s = pc.distance_to_gamma(task, q, qd, return_s=True)
    for distance, *state in zip(found, q, qd, strict=True):
        assert distance <= brute_force(task, *state) * (1 + 1e-9) + 1e-12
    point = task.at(s)
    there = np.linalg.norm(np.concatenate([point.q_d - q, point.velocity - qd], axis=-1), axis=-1)
    np.testing.assert_allclose(found, there, rtol=1e-9)


def test_the_corner_itself_is_found():
    """Γ of a straight line whose ϑ² rises and falls again has a corner; what lies beyond it is nearest to it."""
    line = pc.Line([0.0, 0.0], [1.0, 0.0], speed=1.0)
    task = line.with_profile(pc.TabulatedProfile([0.0, 0.37 * line.s_end, line.s_end], [0.01, 9.0, 0.01]))
    corner = task.at(np.array(0.37 * line.s_end))
    beyond = corner.velocity * 1.5
    distance, s = pc.distance_to_gamma(task, corner.q_d, beyond, return_s=True)
    assert distance == pytest.approx(np.linalg.norm(beyond - corner.velocity), abs=1e-9)
    assert s == pytest.approx(0.37 * line.s_end, abs=1e-9)


def test_joined_paths_and_sequences_keep_their_corners():
    random = np.random.default_rng(5)
    first = pc.Line([0.0, 0.0], [1.0, 0.0], speed=1.0)
    second = pc.Line([1.0, 0.0], [2.0, 0.0], speed=1.0)
    slow = [one.with_profile(a_table(random, one.s0, one.s_end, False)) for one in (first, second)]
    flat = np.append(slow[1].profile.squared[1:], 1.0)
    level = slow[0].at(np.array(first.s_end)).theta ** 2
    slow[1] = second.with_profile(pc.TabulatedProfile(slow[1].profile.s, np.append(level, flat[:-1])))
    for task in (pc.concatenated(slow), pc.PathSequence(slow)):
        for q, qd in zip(random.normal(size=(8, 2)), 2 * random.normal(size=(8, 2)), strict=True):
            assert pc.distance_to_gamma(task, q, qd) <= min(brute_force(one, q, qd) for one in slow) * (1 + 1e-9)


def test_with_braking_the_end_of_an_open_path_is_at_rest():
    line = pc.Line([0.7, 1.2], [0.0, 0.0], speed=2.0)
    assert pc.distance_to_gamma(line, [0.0, 0.0], [0.0, 0.0]) > 0.1
    assert pc.distance_to_gamma(line, [0.0, 0.0], [0.0, 0.0], braking=True) < 1e-12
    circle = pc.Circle(1.0, 2.0)
    state = np.array([0.9, 0.2]), np.array([-0.3, 1.7])
    assert pc.distance_to_gamma(circle, *state, braking=True) == pc.distance_to_gamma(circle, *state)
