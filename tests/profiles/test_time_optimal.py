"""Time-optimal profiles: within every limit, and as fast as the limits allow."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol import (
    Coulomb,
    ExtendedMotionPlan,
    Line,
    Lissajous,
    PathTask,
    Stribeck,
    TaskError,
    Viscous,
    WaypointPath,
    check_task,
    load_robot,
)
from pathcontrol.profiles.topp.time_optimal import time_optimal
from pathcontrol.tasks.profile import END_TIME

LOCKED = {"cicese_2dof": {}, "ur5": {}, "panda": {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}}
every_arm = pytest.mark.parametrize("name", LOCKED)
seeds = st.integers(0, 2**32 - 1)


@cache
def load(name):
    if name != "cicese_2dof":
        pytest.importorskip("example_robot_data")
    return load_robot(name, lock=LOCKED[name])


def frictions(robot, share=0.1):
    """All kinds of friction, in shares of the torque limits."""
    level, speed = share * robot.limits.effort, robot.limits.velocity
    viscous = Viscous(share * robot.limits.effort / speed)
    falling = Stribeck(0.7 * level, level, np.full(robot.n, 0.1))
    return [viscous, Coulomb(level), viscous + Coulomb(level, 0.6 * level), viscous + falling]


def spline(robot, seed, closed=False, count=6, reach=1.2):
    """A random spline around the middle of the joints' ranges."""
    middle = np.clip(np.clip(robot.limits.lower, -3, 3) + np.clip(robot.limits.upper, -3, 3), -3, 3) / 2
    postures = middle + np.random.default_rng(seed).uniform(-reach, reach, (count, robot.n))
    return WaypointPath(postures, 1.0, closed=closed)


class Relabelled(PathTask):
    """One traverse of another path, open, with a parameter ``factor`` times as long."""

    def __init__(self, path, factor=1.0):
        self.path, self.factor = path, factor
        self.s0, self.s_end = (factor * s for s in path.one_traverse)

    def q_d(self, s):
        return self.path.q_d(np.asarray(s) / self.factor)

    def dq_d(self, s):
        return self.path.dq_d(np.asarray(s) / self.factor) / self.factor

    def ddq_d(self, s):
        return self.path.ddq_d(np.asarray(s) / self.factor) / self.factor**2

    def theta(self, s):
        return np.ones_like(s)


def shares(robot, points, limits):
    """The largest shares of the limits that a task uses at its points, by inverse dynamics."""
    acceleration = points.velocity_slope * points.theta[..., None]
    torque = robot.inverse_dynamics(points.q_d, points.velocity, acceleration) + robot.friction.torque(points.velocity)
    use = {"velocity": points.velocity, "acceleration": acceleration, "torque": torque}
    return {kind: float((np.abs(use[kind]) / limit).max()) for kind, limit in limits.items()}


def densely(profile, count=10):
    """Points within every cell of a profile, and just inside its ends."""
    at = np.concatenate([[1e-9], np.arange(1, count) / count, [1 - 1e-9]])
    return (profile.s[:-1, None] + np.diff(profile.s)[:, None] * at).ravel()


def own_limits(robot, margin=0.0):
    return {"velocity": robot.limits.velocity, "torque": (1 - margin) * robot.limits.effort}


# --- within the limits --------------------------------------------------------------------------------------


@every_arm
@settings(max_examples=6)
@given(seeds, st.integers(0, 3), st.booleans(), st.booleans(), st.sampled_from([60, 300, 1000]))
def test_no_limit_is_exceeded_anywhere(name, seed, kind, closed, accelerations, points):
    robot = load(name)
    robot = robot.with_friction(frictions(robot)[kind])
    path = spline(robot, seed, closed, count=4 + seed % 5)
    limits = own_limits(robot, margin=0.1)
    if accelerations:
        limits["acceleration"] = np.random.default_rng(seed).uniform(2.0, 20.0, robot.n)
    profile = time_optimal(robot, path, acceleration=limits.get("acceleration"), margin=0.1, points=points)
    used = shares(robot, path.with_profile(profile).at(densely(profile)), limits)
    assert max(used.values()) < 1.001, used


def test_no_limit_is_exceeded_on_a_path_of_many_pieces_whose_corners_of_curvature_are_at_knots():
    robot = load("cicese_2dof")
    path = spline(robot, 2, count=50, reach=0.5)
    profile = time_optimal(robot, path, margin=0.0, points=200)
    assert np.isin(path.knots, profile.s).all()
    used = shares(robot, path.with_profile(profile).at(densely(profile, 20)), own_limits(robot))
    assert max(used.values()) < 1.001, used


def test_a_path_that_winds_much_is_resolved_whatever_the_points():
    robot, path = load("cicese_2dof"), Lissajous([0.3, 0.3], [20, 21], 1.0)
    few, many = (time_optimal(robot, path, points=points).traversal_time for points in (150, 1500))
    assert few < 1.03 * many


@every_arm
def test_the_controllers_end_a_path_within_the_limits_if_the_profile_foresees_it(name):
    robot = load(name).with_friction(frictions(load(name))[2])
    path = spline(robot, 5)
    task = path.with_profile(time_optimal(robot, path, margin=0.0, end_time=END_TIME))
    law = ExtendedMotionPlan(robot, task, K_p=np.full(robot.n, 100.0), K_v=np.full(robot.n, 20.0), k=1.0)
    left = np.geomspace(1e-7, 1.0, 20001) * (path.s_end - path.s0)
    assert max(shares(robot, law.point(path.s_end - left), own_limits(robot)).values()) < 1.001


@given(seeds)
@settings(max_examples=5)
def test_a_joint_that_holds_still_has_no_dry_friction_to_overcome(seed):
    arm = load("cicese_2dof").with_friction(Coulomb(np.array([5.0, 14.5])))
    path = Line([0.1, 0.05], [0.1 + 1.0 + seed % 7 / 7, 0.05], 1.0)
    profile = time_optimal(arm, path, margin=0.0)
    assert max(shares(arm, path.with_profile(profile).at(densely(profile)), own_limits(arm)).values()) < 1.001
    with pytest.raises(TaskError, match="joint_2"):
        time_optimal(arm, Line([0.1, 0.2], [1.0, 0.9], 1.0), margin=0.0)


class Slow(PathTask):
    """Joint 2 is slowest at s = 0, q_2' = s² + ``least``: it turns back and forth again there if that is negative."""

    s0, s_end = -1.0, 1.0

    def __init__(self, least):
        self.least = least

    def q_d(self, s):
        return np.stack([0.3 * s, s**3 / 3 + self.least * s], -1)

    def dq_d(self, s):
        return np.stack([0.3 + 0 * s, s**2 + self.least], -1)

    def ddq_d(self, s):
        return np.stack([0 * s, 2 * s], -1)

    def theta(self, s):
        return np.ones_like(s)


def test_a_joint_that_turns_back_between_two_samples_is_noticed():
    arm = load("cicese_2dof").with_friction(Coulomb(np.array([7.0, 1.0]), np.array([7.0, 20.0])))
    time_optimal(arm, Slow(1e-5))
    with pytest.raises(TaskError, match="joint_2"):
        time_optimal(arm, Slow(-1e-9))


# --- as fast as they allow ----------------------------------------------------------------------------------


def by_toppra(robot, path, s, rates, dry, velocity):
    """Traversal time of toppra on the grid s, torque-limited, without viscous friction."""
    toppra = pytest.importorskip("toppra")
    constraint, effort = toppra.constraint, robot.limits.effort

    class Geometry(toppra.interpolator.AbstractGeometricPath):
        dof, path_interval, waypoints = path.n, np.array([path.s0, path.s_end]), None

        def __call__(self, s, order=0):
            return [path.q_d, path.dq_d, path.ddq_d][order](np.asarray(s, dtype=float))

    interpolation = constraint.DiscretizationType.Interpolation
    torque = np.stack([-effort, effort], -1)
    limits = [constraint.JointTorqueConstraint(robot.inverse_dynamics, torque, dry, interpolation)]
    if velocity:
        speed = robot.limits.velocity
        limits.append(constraint.JointVelocityConstraint(np.stack([-speed, speed], -1)))
    instance = toppra.algorithm.TOPPRA(limits, Geometry(), gridpoints=s, solver_wrapper="seidel")
    _, rate, _ = instance.compute_parameterization(*rates)
    return float((2 * np.diff(s) / (rate[1:] + rate[:-1])).sum())


@every_arm
def test_it_is_as_fast_as_toppra(name):
    for seed in range(5):
        dry = (seed % 4 == 3) * 0.05 * load(name).limits.effort
        robot = load(name).with_friction(Coulomb(dry))
        path = spline(robot, seed, count=3 + seed % 7, reach=(0.4, 1.2)[seed % 2])
        kwargs = {"velocity": seed % 3 > 0, "margin": 0.0, "start_rate": 0.01, "end_rate": 0.02}
        profile = time_optimal(robot, path, **kwargs)
        reference = by_toppra(robot, path, profile.s, (0.01, 0.02), dry, kwargs["velocity"])
        assert profile.traversal_time == pytest.approx(reference, rel=2e-3)


@every_arm
@settings(max_examples=4)
@given(seeds, st.integers(0, 2), st.booleans(), st.booleans())
def test_a_limit_binds_nearly_everywhere(name, seed, kind, closed, velocity):
    robot = load(name)
    robot = robot.with_friction(frictions(robot)[kind])
    profile = time_optimal(robot, spline(robot, seed, closed), velocity=velocity)
    # but in the cells where one limit takes over from another, or where speed is lowered for what is in between
    assert (profile.used > 0.99).mean() > 0.96
    assert profile.used.max() < 1 + 1e-3


def fastest_on_lattice(robot, path, profile, factors):
    """The least time of all profiles with ϑ² ∈ ``factors`` × that of ``profile``, by dynamic programming.

    The torques are within their limits at both ends of each cell, with ϑ² linear in between.
    """
    s, at = profile.s, path.with_profile(profile).at(profile.s)
    cost = np.where(factors == 1, 0.0, np.inf)
    for i in range(len(s) - 1):
        x, y = np.broadcast_arrays(profile.squared[i] * factors[:, None], profile.squared[i + 1] * factors)
        allowed = np.ones(x.shape, dtype=bool)
        for j, squared in ((i, x), (i + 1, y)):
            qd = at.dq_d[j] * np.sqrt(squared)[..., None]
            qdd = at.dq_d[j] * ((y - x) / (2 * (s[i + 1] - s[i])))[..., None] + at.ddq_d[j] * squared[..., None]
            torque = robot.inverse_dynamics(np.broadcast_to(at.q_d[j], qd.shape), qd, qdd) + robot.friction.torque(qd)
            allowed &= (np.abs(torque) <= robot.limits.effort * (1 + 1e-9)).all(-1)
        times = np.where(allowed, 2 * (s[i + 1] - s[i]) / (np.sqrt(x) + np.sqrt(y)), np.inf)
        cost = (cost[:, None] + times).min(0)
    return cost[factors == 1].item()


@pytest.mark.parametrize(
    ("name", "seed", "share"), [("cicese_2dof", 1, 0.05), ("cicese_2dof", 4, 0.6), ("panda", 5, 0.6)]
)
def test_no_profile_on_a_lattice_is_faster_with_viscous_friction(name, seed, share):
    robot = load(name).with_friction(frictions(load(name), share)[0])
    path = spline(robot, seed, count=4)
    profile = time_optimal(robot, path, velocity=None, margin=0.0, points=120)
    near = np.geomspace(1e-3, 0.1, 8)
    factors = np.concatenate([[1.0], np.linspace(0.5, 1.6, 13), 1 - near, 1 + near])
    assert fastest_on_lattice(robot, path, profile, factors) > 0.995 * profile.traversal_time


@given(seeds, st.floats(0.1, 20.0), st.floats(0.3, 5.0))
@settings(max_examples=5)
def test_bang_bang_and_trapezoid(seed, acceleration, speed):
    direction = np.random.default_rng(seed).uniform(0.1, 1.0, 2)
    length, arm = 1.7, load("cicese_2dof")
    path = Line([0, 0], length * direction / np.linalg.norm(direction), 1.0)
    limit = acceleration * direction / np.linalg.norm(direction)  # s̈ ≤ acceleration
    ends = {"torque": None, "acceleration": limit, "start_rate": 1e-5, "end_rate": 1e-5}
    free = time_optimal(arm, path, velocity=None, **ends)
    assert free.traversal_time == pytest.approx(2 * np.sqrt(length / acceleration), rel=1e-3)
    capped = time_optimal(arm, path, velocity=speed * direction / np.linalg.norm(direction), points=2000, **ends)
    if speed**2 < length * acceleration:
        assert capped.traversal_time == pytest.approx(length / speed + speed / acceleration, rel=1e-3)
    else:
        assert capped.traversal_time == pytest.approx(free.traversal_time, rel=1e-6)


@given(seeds)
@settings(max_examples=5)
def test_velocity_limits_alone_cap_the_rate(seed):
    arm, path = load("cicese_2dof"), spline(load("cicese_2dof"), seed)
    limit = np.array([0.7, 1.1])
    profile = time_optimal(arm, path, velocity=limit, torque=None)
    with np.errstate(divide="ignore"):
        cap = (limit / np.abs(path.dq_d(profile.s))).min(-1)
    assert (profile.theta(path, profile.s) < cap * (1 + 1e-12)).all()
    assert np.median(profile.theta(path, profile.s) / cap) == pytest.approx(1, abs=1e-12)
    assert set(profile.limiting) <= {"velocity of joint_1", "velocity of joint_2"}


@given(st.floats(0.2, 2.0), st.floats(0.1, 1.0))
@settings(max_examples=5)
def test_a_joint_alone_keeps_its_speed_but_where_it_turns(amplitude, speed):
    path = Lissajous([amplitude, 0.5], [1, 2], 1.0)  # joint 2, without a limit, moves where joint 1 turns back
    profile = time_optimal(load("cicese_2dof"), path, velocity=[speed, np.inf], torque=None)
    assert profile.traversal_time == pytest.approx(4 * amplitude / speed, rel=1e-3)


@given(seeds, st.floats(1.2, 9.0))
@settings(max_examples=5)
def test_time_scales_with_the_root_of_the_acceleration_limits(seed, factor):
    arm, rng = load("cicese_2dof"), np.random.default_rng(seed)
    path = spline(arm, seed, closed=True)
    limit = rng.uniform(1.0, 5.0, 2)
    slow, fast = (time_optimal(arm, path, velocity=None, torque=None, acceleration=a) for a in (limit, factor * limit))
    assert slow.traversal_time == pytest.approx(np.sqrt(factor) * fast.traversal_time, rel=1e-6)


@every_arm
@settings(max_examples=2)
@given(seeds)
def test_time_depends_on_the_path_only(name, seed):
    robot = load(name).with_friction(frictions(load(name))[2])
    path = spline(robot, seed)
    times = [time_optimal(robot, Relabelled(path, factor)).traversal_time for factor in (1.0, 1e-6, 1e6)]
    assert np.allclose(times, times[0], rtol=1e-6)


@every_arm
@settings(max_examples=2)
@given(seeds)
def test_a_larger_margin_is_never_faster(name, seed):
    robot = load(name).with_friction(frictions(load(name), 0.05)[2])
    path = spline(robot, seed, reach=0.6)
    times = [time_optimal(robot, path, margin=m).traversal_time for m in (0.0, 0.05, 0.1, 0.2)]
    assert (np.diff(times) > -1e-4 * times[0]).all()


@given(seeds)
@settings(max_examples=5)
def test_the_way_back_takes_as_long_if_the_limits_are_symmetric(seed):
    arm, there = load("cicese_2dof"), spline(load("cicese_2dof"), seed)
    back = WaypointPath(there.points[::-1], 1.0)
    kwargs = {"torque": None, "acceleration": [3.0, 7.0], "start_rate": 0.01, "end_rate": 0.01}
    times = [time_optimal(arm, path, **kwargs).traversal_time for path in (there, back)]
    assert times[0] == pytest.approx(times[1], rel=1e-3)


# --- the ends -----------------------------------------------------------------------------------------------


@every_arm
@settings(max_examples=2)
@given(seeds, st.integers(0, 3))
def test_a_closed_path_is_taken_without_a_stop(name, seed, kind):
    robot = load(name).with_friction(frictions(load(name))[kind])
    path = spline(robot, seed, closed=True)
    profile = time_optimal(robot, path)
    assert profile.squared[0] == profile.squared[-1]
    assert profile.theta(path, path.s0 + path.period) == profile.theta(path, path.s0)
    assert profile.traversal_time < time_optimal(robot, Relabelled(path)).traversal_time
    check_task(path.with_profile(profile), robot.n)


def test_an_open_path_begins_and_ends_slowly_but_not_at_rest():
    arm, path = load("cicese_2dof"), Line([0, 0], [1, 0], 1.0)
    profile = time_optimal(arm, path, torque=None, acceleration=[4.0, 4.0])
    assert np.allclose(profile.theta(path, np.array([0.0, 1.0])), 4.0 * 2.5e-3)  # after 2.5 ms
    given_rates = time_optimal(arm, path, start_rate=0.3, end_rate=0.05)
    assert np.allclose(given_rates.theta(path, np.array([0.0, 1.0])), [0.3, 0.05])
