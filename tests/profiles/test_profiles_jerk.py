"""Jerk-limited starts and stops: the S-curve against its own motion in time, and profiles integrated as plans are."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline
from strategies import floats

from pathcontrol import (
    Circle,
    ConstantRate,
    ConstantSpeed,
    ExtendedMotionPlan,
    InputError,
    Line,
    Projection,
    TaskError,
    WaypointPath,
    check_task,
    load_robot,
    simulate,
)
from pathcontrol.profiles.jerk.s_curve import Approach, SCurve
from pathcontrol.profiles.jerk.start_stop import SmoothStartStop, distance
from pathcontrol.profiles.limited.limited import limited
from pathcontrol.profiles.limited.motion_limit import MotionLimit
from pathcontrol.profiles.motion import JointMotion, ToolMotion
from pathcontrol.profiles.tool_speed import ToolSpeed
from pathcontrol.tasks.profile import END_TIME

few = settings(max_examples=15)
seeds = st.integers(0, 9999)
speeds, accelerations, jerks = floats(0.3, 3.0), floats(0.2, 10.0), floats(0.5, 200.0)


def spline(seed, n=3):
    """A path of some 4 rad through random postures."""
    return WaypointPath(np.random.default_rng(seed).uniform(-0.6, 0.6, (6, n)), 1.0)


def in_time(path, profile, period=2e-3, cells=10000):
    """s and the speed ‖q_d'‖ϑ after so many whole periods of the plan ṡ = ϑ(s), to where 0.1 mrad are left.

    t = ∫ds/ϑ by Gauss's rule on cells that grow from nothing at both ends, inverted by a spline with the slopes ϑ.
    """
    last = path.s_end - 1e-4 / np.linalg.norm(path.dq_d(np.asarray(path.s_end)))
    x, (nodes, weights) = np.linspace(0, 1, cells + 1), np.polynomial.legendre.leggauss(5)
    s = path.s0 + (last - path.s0) * x**3 * (10 - 15 * x + 6 * x**2)
    half = np.diff(s) / 2
    slowness = 1 / profile.theta(path, s[:-1, None] + half[:, None] * (1 + nodes))
    plan = CubicHermiteSpline(np.append(0, np.cumsum(half * (slowness @ weights))), s, profile.theta(path, s))
    s = plan(np.arange(0, plan.x[-1], period))
    return s, np.linalg.norm(path.dq_d(s), axis=-1) * profile.theta(path, s)


# --- the curves -----------------------------------------------------------------------------------------------


def rise_in_time(v_0, V, a, j, t):
    """v, v̇ and distance at times t of the quickest rise, by adding up its three phases."""
    t_1 = min(np.sqrt((V - v_0) / j), a / j)
    t_2 = max((V - v_0) / a - a / j, 0.0)
    d, v, acc = np.zeros_like(t), np.full_like(t, v_0), np.zeros_like(t)
    left = t
    for length, jerk in ((t_1, j), (t_2, 0.0), (t_1, -j)):
        h = np.clip(left, 0.0, length)
        d, v, acc = d + v * h + acc * h**2 / 2 + jerk * h**3 / 6, v + acc * h + jerk * h**2 / 2, acc + jerk * h
        left = left - h
    return v, acc, d, 2 * t_1 + t_2


@given(floats(1e-4, 0.5), floats(1e-3, 3.0), accelerations, jerks)
def test_the_s_curve_is_its_motion_in_time(v_0, rise, a, j):
    V = v_0 + rise
    duration = rise_in_time(v_0, V, a, j, np.zeros(1))[-1]
    v, acceleration, d, _ = rise_in_time(v_0, V, a, j, np.linspace(0, duration, 101))
    curve = SCurve(v_0, V, a, j)
    assert curve.length == pytest.approx(d[-1], rel=1e-12)
    got, slope = curve.speed(d)
    assert np.allclose(got, v, rtol=1e-9)
    # near its ends the curve's v̇ grows with the square root of what rounding makes of the distance
    assert np.allclose(got * slope, acceleration, rtol=1e-6, atol=1e-6 * a)
    assert np.allclose(curve.speed(np.array([curve.length, 9.0 + curve.length])), [[V, V], [0, 0]], atol=1e-6 * a)


@given(speeds, accelerations, jerks)
def test_the_approach_is_smooth_within_its_limits_and_exponential_at_last(V, a, j):
    curve = Approach(V, a, j)
    d = curve.length * np.linspace(0, 1, 20001)[1:] ** 3  # denser where v is small
    v, slope = curve.speed(d)
    acceleration = v * slope
    jerk = v[:-1] * np.diff(acceleration) / np.diff(d)
    assert (np.diff(v) >= 0).all()
    assert v[-1] == pytest.approx(V)
    assert acceleration[-2] > 0  # and not before
    assert acceleration.max() <= a * (1 + 1e-9)
    # but for the cells where the jerk jumps or v̇ comes to 0 as a square root of the distance
    assert np.quantile(np.abs(jerk), 0.99) <= j * (1 + 1e-2)
    tail = min(j, a / END_TIME, V / (1.5 * END_TIME**2)) * END_TIME**3
    assert np.allclose(v[d < tail], d[d < tail] / END_TIME, rtol=1e-12)
    for before, after in curve.speed(tail * np.array([1 - 1e-9, 1 + 1e-9])):
        assert before == pytest.approx(after, rel=1e-6)


@few
@given(seeds)
def test_distance_is_the_length_of_the_chords(seed):
    path = spline(seed)
    s = np.linspace(*path.one_traverse, 2001)
    along = distance(path, JointMotion(), s)
    fine = np.linspace(*path.one_traverse, 40001)
    chords = np.append(0, np.cumsum(np.linalg.norm(np.diff(path.q_d(fine), axis=0), axis=-1)))
    # chords are shorter by κ²Δ²/24 of their length; the spline between its knots is of fourth order
    assert np.allclose(along(fine), chords, rtol=0, atol=1e-7 * chords[-1])


# --- the profile ----------------------------------------------------------------------------------------------


@few
@given(seeds, speeds, accelerations, floats(1.0, 60.0))
def test_acceleration_and_jerk_stay_within_limits_in_time(seed, speed, a, j):
    path = spline(seed)
    _, v = in_time(path, SmoothStartStop(path, ConstantSpeed(speed), a, j), period := 2e-3)
    # differences are means of v̇ and v̈ over one and two periods, but for what the splines σ(s) and s(t) are off
    assert np.abs(np.diff(v)).max() / period <= a * (1 + 1e-5)
    assert np.abs(np.diff(v, 2)).max() / period**2 <= j * (1 + 1e-3)
    assert v.max() <= speed * (1 + 1e-12)
    assert (v > 0).all()


def test_a_long_path_is_taken_at_the_speed_of_the_profile_and_a_short_one_is_not():
    reached = []
    for length in (4.0, 0.2):
        line = Line([0.0, 0.0], [length, 0.0], 1.0)
        _, v = in_time(line, SmoothStartStop(line, ConstantSpeed(1.0), 2.0, 10.0))
        top = int(np.argmax(v))
        assert (np.diff(v[: top + 1]) > -1e-9).all()
        assert (np.diff(v[top:]) < 1e-9).all()
        reached.append(v.max())
    assert reached[0] == 1.0
    assert 0.2 < reached[1] < 0.6


def test_time_of_a_line_is_that_of_its_phases():
    """Rise from v₀ and fall take their own time, what is between is steady, and the end is exponential."""
    length, speed, a, j = 3.0, 0.8, 2.0, 10.0
    line = Line([0.0, 0.0], [length, 0.0], 1.0)
    profile = SmoothStartStop(line, ConstantSpeed(speed), a, j)
    s, _ = in_time(line, profile, period=1e-4)
    start = rise_in_time(profile.start_speed, speed, a, j, np.zeros(1))[-1]
    stop = rise_in_time(j * END_TIME**2 / 2, speed, a, j, np.zeros(1))[-1] - END_TIME  # whose first T the end replaces
    end = END_TIME * np.log(j * END_TIME**3 / 1e-4)
    rise, fall = SCurve(profile.start_speed, speed, a, j).length, Approach(speed, a, j).length
    assert len(s) * 1e-4 == pytest.approx(start + (length - rise - fall) / speed + stop + end, abs=2e-4)


@few
@given(seeds, speeds, accelerations, jerks)
def test_the_slope_is_the_derivative(seed, speed, a, j):
    path = spline(seed)
    task = path.with_profile(SmoothStartStop(path, ConstantSpeed(speed), a, j))
    check_task(task, 3)
    at = np.random.default_rng(seed).uniform(0.001, 0.999, 200)
    s, h = path.s0 + at * (path.s_end - path.s0), 1e-6 * (path.s_end - path.s0)
    difference = (task.theta(s + h) - task.theta(s - h)) / (2 * h)
    slope = task.dtheta(s)
    # ϑ' jumps at one place, where the last exponential ends in a steady crawl, and is steep at the start
    off = np.abs(difference - slope) > 1e-4 * (np.abs(slope) + np.abs(slope).max())
    assert off.sum() <= 2
    assert np.array_equal(task.at(s).dtheta, slope)


@few
@given(seeds, st.sampled_from(["rate", "limited"]))
def test_any_profile_is_begun_and_ended_and_never_exceeded(seed, kind):
    path, a, j = spline(seed), 2.0, 10.0
    inner = ConstantRate(0.5) if kind == "rate" else limited(path, MotionLimit(speed=1.0, normal=2.0, tangential=4.0))
    profile = SmoothStartStop(path, inner, a, j)
    s = np.linspace(path.s0, path.s_end, 4001)
    theta, without = profile.theta(path, s), inner.theta(path, s)
    assert (theta > 0).all()
    assert (theta <= without * (1 + 1e-12)).all()
    middle = np.abs(s - s.mean()) < 0.1 * (s[-1] - s[0])
    assert np.allclose(theta[middle], without[middle], rtol=1e-12)
    # continuous where the start ends and the other profile takes over
    low, high = s[0], s[np.argmax(theta > without * (1 - 1e-9))]
    for _ in range(60):
        place = (low + high) / 2
        ramp = profile.theta(path, place) < inner.theta(path, place) * (1 - 1e-9)
        low, high = (place, high) if ramp else (low, place)
    assert profile.theta(path, low) == pytest.approx(profile.theta(path, high), rel=1e-7)
    assert theta[0] == pytest.approx(min(5e-5 * j / np.linalg.norm(path.dq_d(s[0])), without[0]), rel=1e-9)


def test_a_tool_is_started_and_stopped_smoothly():
    robot, a, j, period = load_robot("cicese_2dof"), 1.0, 8.0, 2e-3
    path, tool = Line([0.2, 0.8], [1.2, 1.8], 1.0), ToolMotion(load_robot("cicese_2dof"), "tool")
    profile = SmoothStartStop(path, ToolSpeed(robot, "tool", 0.4), a, j, motion=tool)
    s, _ = in_time(path, profile, period, cells=2000)
    tip = robot.frame_pose(path.q_d(s), "tool")[:, :3, 3]
    v = np.linalg.norm(robot.frame_motion(path.q_d(s), path.dq_d(s), path.ddq_d(s), "tool")[0][:, :3], axis=-1)
    v *= profile.theta(path, s)
    assert np.abs(np.diff(v)).max() / period <= a * (1 + 1e-5)
    assert np.abs(np.diff(v, 2)).max() / period**2 <= j * (1 + 1e-3)
    # the speed is really that of the tip: chords of the poses in one period
    assert np.allclose(np.linalg.norm(np.diff(tip, axis=0), axis=-1) / period, (v[1:] + v[:-1]) / 2, atol=1e-5)
    assert v.max() == pytest.approx(0.4, rel=1e-12)


def test_start_speed_is_where_it_begins():
    line = Line([0.0, 0.0], [3.0, 0.0], 1.0)
    begin = partial(SmoothStartStop, line, ConstantSpeed(0.5), 2.0, 10.0)
    assert begin(start_speed=0.2).theta(line, np.array(0.0)) == pytest.approx(0.2)
    assert begin().theta(line, np.array(0.0)) == pytest.approx(0.5 * 10.0 * 0.01**2)
    # no start is needed where the profile is slower than that
    assert begin(start_speed=0.7).theta(line, np.array(0.0)) == pytest.approx(0.5)


# --- with a controller ----------------------------------------------------------------------------------------


def test_controllers_bring_it_to_rest_without_a_jolt(ideal_arm):
    """The plan of a run, its end included, keeps the limit of the profile; a constant speed brakes with v/T instead."""
    line, a = Line([0.7, 1.2], [0.0, 0.0], 0.5), 2.0
    smooth = line.with_profile(SmoothStartStop(line, ConstantSpeed(0.5), a, 10.0))
    braking = []
    for path in (line, smooth):
        law = ExtendedMotionPlan(ideal_arm, path, 800.0, [45.0, 100.0], 0.0)
        run = simulate(law, line.start, duration=6.0, progress=False)
        braking.append(-np.diff(run.array("sdot")[0]).min() / 2.5e-3)
        assert line.s_end - 1e-3 < run.array("s")[0, -1] <= line.s_end
    assert braking[0] > 2 * a
    assert braking[1] < 1.01 * a


@pytest.mark.parametrize("start_speed", [None, 0.2])
def test_dry_friction_holds_a_law_without_a_plan_unless_it_starts_fast_enough(arm, start_speed):
    line = Line([0.7, 1.2], [0.0, 0.0], 0.5)
    profile = SmoothStartStop(line, ConstantSpeed(0.5), 2.0, 10.0, start_speed=start_speed)
    law = Projection(arm, line.with_profile(profile), 800.0, [45.0, 100.0], friction="viscous")
    run = simulate(law, line.start, duration=2.0, progress=False)
    assert (run.array("s")[0, -1] > 0.3) == (start_speed is not None)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999, 0.99999])
def test_the_plan_of_a_controller_continues_the_exponential(share):
    robot = load_robot("cicese_2dof")
    line = Line([0.7, 1.2], [0.0, 0.0], 0.5)
    task = line.with_profile(SmoothStartStop(line, ConstantSpeed(0.5), 2.0, 10.0))
    law = ExtendedMotionPlan(robot, task, 800.0, [45.0, 100.0], 20.0)
    tail = 0.9 * 10.0 * END_TIME**3
    s = np.array(line.s_end - tail * (1 - share))
    assert float(law.point(s).theta) == pytest.approx(float(line.s_end - s) / END_TIME, rel=1e-9)
    assert float(law.point(s).dtheta) == pytest.approx(-1 / END_TIME, rel=1e-9)


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (partial(SmoothStartStop, Circle(1.0, 1.0), ConstantSpeed(1.0), 1.0, 1.0), TaskError, ["period", "open path"]),
        (partial(SmoothStartStop, Line([0.0], [1.0], 1.0), ConstantSpeed(1.0), 0.0, 1.0), InputError, ["acceleration"]),
        (partial(SmoothStartStop, Line([0.0], [1.0], 1.0), ConstantSpeed(1.0), 1.0, -1.0), InputError, ["jerk = -1"]),
        (
            partial(SmoothStartStop, Line([0.0], [1.0], 1.0), ConstantSpeed(1.0), 1.0, 1.0, start_speed=0),
            InputError,
            ["start_speed = 0"],
        ),
    ],
)
def test_bad_starts(make, kind, words):
    with pytest.raises(kind) as error:
        make()
    assert all(word in str(error.value) for word in words), str(error.value)


def test_it_describes_itself():
    line = Line([0.0, 0.0], [1.0, 0.0], 1.0)
    told = SmoothStartStop(line, ConstantSpeed(1.0), 2.0, 10.0).describe()
    assert told == {
        "profile": "SmoothStartStop",
        "acceleration": 2.0,
        "jerk": 10.0,
        "start_speed": pytest.approx(5e-4),
        "motion": "the arm",
        "around": {"profile": "ConstantSpeed", "speed": 1.0},
    }
