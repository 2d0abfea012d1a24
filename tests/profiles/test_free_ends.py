"""Time-optimal profiles with free ends: as fast as independent methods find, and never slower than with given ends."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.sparse import coo_array, vstack
from two_link import PUBLISHED, START_RATE, TwoLinkLine, least_time, straight_line

from pathcontrol import (
    CartesianPath,
    Circle,
    InputError,
    ToolCurve,
    Viscous,
    WaypointPath,
    load_robot,
    time_optimal,
)

ARM, TWO_LINK = load_robot("cicese_2dof"), load_robot("two_link")
seeds = st.integers(0, 2**32 - 1)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-2, 2), st.floats(-2, 2))
def test_the_two_link_arm_has_the_published_dynamics(q1, q2, v1, v2):
    q, v, c, s = np.array([q1, q2]), np.array([v1, v2]), np.cos(q2), np.sin(q2)
    assert TWO_LINK.mass_matrix(q) == pytest.approx(np.array([[3.75 + 2 * c, 1 + c], [1 + c, 1]]), abs=1e-12)
    weight = 9.81 * np.array([2.5 * np.cos(q1) + np.cos(q1 + q2), np.cos(q1 + q2)])
    assert TWO_LINK.gravity(q) == pytest.approx(weight, abs=1e-12)
    coriolis = s * np.array([-2 * v1 * v2 - v2**2, v1**2])
    assert TWO_LINK.inverse_dynamics(q, v, 0 * q) - weight == pytest.approx(coriolis, abs=1e-12)
    assert TWO_LINK.limits.effort.tolist() == [30.0, 15.0]


def random_path(seed):
    return WaypointPath(np.random.default_rng(seed).uniform(-1.2, 1.2, (4, 2)), 1.0)


@pytest.mark.parametrize("viscous", [(0.0, 0.0), (4.0, 2.0)])
def test_the_two_link_arm_takes_the_least_time(viscous):
    arm, (least, last) = TWO_LINK.with_friction(Viscous(viscous)), least_time(viscous)
    excess = []
    for points in (501, 1001, 2001):
        profile = time_optimal(arm, TwoLinkLine(), margin=0.0, points=points, start_rate=START_RATE, end_rate="free")
        assert np.sqrt(profile.squared[[0, -1]]) == pytest.approx([START_RATE, last], rel=0.5 / points)
        excess.append(profile.traversal_time - least)
    # every limit is kept at both ends of a cell: the time is above the least one, by half as much for twice the cells
    assert excess[0] == pytest.approx(2 * excess[1], rel=0.05)
    assert excess[1] == pytest.approx(2 * excess[2], rel=0.05)
    assert 0 < excess[1] < 1.2e-3 * least


def test_the_least_time_is_the_published_one():
    n, published = np.array(list(PUBLISHED)), np.array(list(PUBLISHED.values()))
    limit = (n[2] * published[2] - n[1] * published[1]) / (n[2] - n[1])  # their error falls as 1/n, too
    assert least_time()[0] == pytest.approx(limit, abs=2e-5)
    profile = time_optimal(
        TWO_LINK, TwoLinkLine(), velocity=None, margin=0.0, points=5000, start_rate=START_RATE, end_rate="free"
    )
    assert profile.traversal_time == pytest.approx(published[2], abs=4e-4)
    assert profile.limited_by == pytest.approx({"torque of joint_1": 1.0}, abs=0.01)


def test_a_rate_along_a_tool_curve_is_its_speed():
    curve = ToolCurve.line([0.0, 0.0, 1.5], [1.5, 0.0, 0.0])
    path = CartesianPath(TWO_LINK, "tool", curve, start=straight_line(0.0)[0], tolerance=1e-8)
    profile = time_optimal(TWO_LINK, path, margin=0.0, start_rate=1.0, end_rate="free")
    ahead = path.q_d(path.s0 + 1e-6 * profile.theta(path, np.array(path.s0)))
    start, later = (np.exp(1j * np.cumsum(q)).sum() for q in (path.start_posture, ahead))
    assert abs(later - start) == pytest.approx(1e-6, rel=1e-4)  # of the tool in 1 µs
    assert profile.traversal_time == pytest.approx(least_time()[0], rel=1.2e-3)


def by_linear_program(robot, path, s, first):
    """The least time by a direct method: the largest ϑ² at the knots within the torque limits at both ends of cells."""
    q, dq, ddq = path.q_d(s), path.dq_d(s), path.ddq_d(s)
    weight = robot.gravity(q)
    inertia = robot.inverse_dynamics(q, 0 * q, dq) - weight
    centrifugal = robot.inverse_dynamics(q, dq, ddq) - weight
    cells, width, n = np.arange(len(s) - 1), np.diff(s), robot.n
    rows, limits = [], []
    for end in (0, 1):
        own, u = slice(end, len(s) - 1 + end), inertia[end : len(s) - 1 + end] / (2 * width[:, None])
        for sign in (1, -1):
            for i in range(n):
                here, there = (sign * (centrifugal[own, i] * side + slope * u[:, i]) for side, slope in _sides(end))
                place = (np.tile(cells, 2), np.concatenate([cells, cells + 1]))
                rows.append(coo_array((np.concatenate([here, there]), place), shape=(len(cells), len(s))))
                limits.append(robot.limits.effort[i] - sign * weight[own, i])
    bounds = [(first**2, first**2)] + [(1e-9, None)] * len(cells)
    found = linprog(-np.ones(len(s)), A_ub=vstack(rows).tocsr(), b_ub=np.concatenate(limits), bounds=bounds)
    assert found.success
    rate = np.sqrt(found.x)
    return (2 * width / (rate[1:] + rate[:-1])).sum()


def _sides(end):
    """The share of ϑ² and the sign of its slope, at both ends of a cell, in a limit at one ``end``."""
    return ((1 - end, -1), (end, 1))


@settings(max_examples=8)
@given(seeds)
def test_it_is_as_fast_as_a_direct_method(seed):
    arm, path = ARM.with_friction(Viscous(np.zeros(2))), random_path(seed)
    profile = time_optimal(arm, path, velocity=None, margin=0.0, points=300, start_rate=0.05, end_rate="free")
    direct = by_linear_program(arm, path, profile.s, 0.05)
    # ours gives way between the knots, too
    assert direct * (1 - 1e-6) < profile.traversal_time < 1.01 * direct


@settings(max_examples=8)
@given(seeds, st.sampled_from(["start_rate", "end_rate"]), st.floats(0.01, 0.99))
def test_no_given_rate_is_faster_than_a_free_one(seed, name, share):
    path, options = random_path(seed), {"points": 300}
    free = time_optimal(ARM, path, **options, **{name: "free"})
    rate = float(np.sqrt(free.squared[0 if name == "start_rate" else -1]))
    slower = time_optimal(ARM, path, **options, **{name: share * rate})
    slow = time_optimal(ARM, path, **options)
    # cells that are exceeded between their ends are given less in steps, which differ from one profile to the next
    assert free.traversal_time < (1 + 5e-5) * slower.traversal_time
    if share * rate > np.sqrt(slow.squared[0 if name == "start_rate" else -1]):
        assert slower.traversal_time < (1 + 5e-5) * slow.traversal_time
    same = time_optimal(ARM, path, **options, **{name: rate})
    assert same.traversal_time == pytest.approx(free.traversal_time, rel=1e-9)
    assert free.used.max() < 1 + 1e-3


@settings(max_examples=8)
@given(seeds)
def test_without_friction_a_path_is_as_fast_backwards(seed):
    arm, path = ARM.with_friction(Viscous(np.zeros(2))), random_path(seed)
    there = time_optimal(arm, path, points=300, start_rate=0.1, end_rate="free")
    back = time_optimal(arm, path.reversed(), points=300, start_rate="free", end_rate=0.1)
    assert back.squared[::-1] == pytest.approx(there.squared, rel=1e-4)


def test_free_ends_need_an_open_path_and_their_word():
    path = random_path(0)
    for name in ("start_rate", "end_rate"):
        with pytest.raises(InputError, match=rf"{name} = 'fre', expected a number .* or 'free'; did you mean 'free'"):
            time_optimal(ARM, path, **{name: "fre"})
        with pytest.raises(InputError, match=f"{name} for a closed path"):
            time_optimal(ARM, Circle(0.4, 1.0), **{name: "free"})
    with pytest.raises(InputError, match="end_rate and end_time"):
        time_optimal(ARM, path, end_rate="free", end_time=0.1)
    with pytest.raises(InputError, match="end_time = 'free', expected numbers"):
        time_optimal(ARM, path, end_time="free")
